"""Notes from which the rig of a scan is opened again, and what a result was made with."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from dsl_core.devices.registry import default_options
from dsl_core.errors import StoreError
from dsl_core.io.scan.origin import (
    calibration_digest,
    is_of_this_computer,
    model_notes,
    model_of_notes,
    refuse_other_rig,
    rig_notes,
    rig_of_notes,
)
from dsl_core.simulation.published_rig import published_rig


def test_the_rig_of_a_scan_is_found_again_wherever_it_is_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    notes = rig_notes("replay", {"scan": "scans/a.dsl", "speed": "2"})
    monkeypatch.chdir(tmp_path.parent)
    assert rig_of_notes(notes) == ("replay", {"scan": str(tmp_path / "scans/a.dsl"), "speed": "2"})


@pytest.mark.parametrize(
    "notes", [{}, {"scanned_with": 3}, {"scanned_with": "a", "scanned_with_options": "{"},
              {"scanned_with": "a", "scanned_with_options": "[1]"}],
)  # fmt: skip
def test_notes_that_name_no_rig_legibly_name_none(notes: dict[str, object]) -> None:
    assert rig_of_notes(notes) is None


def test_options_that_nobody_noted_are_none() -> None:
    assert rig_of_notes({"scanned_with": "twin"}) == ("twin", {})
    assert rig_of_notes({"scanned_with": "twin", "scanned_with_options": '{"noise": 1}'}) == (
        "twin",
        {"noise": "1"},
    )


def _refuse(stored: dict[str, str], given: dict[str, str]) -> None:
    refuse_other_rig(Path("a.dsl"), stored, given, default_options)


def test_another_scene_or_rig_is_refused_with_what_differs() -> None:
    stored = rig_notes("twin", {"scene": "plane", "depth_mm": "650"})
    with pytest.raises(
        StoreError, match=r"the option scene is plane in the scan and sphere now\. Open the rig as"
    ):
        _refuse(stored, rig_notes("twin", {"scene": "sphere", "depth_mm": "650"}))
    with pytest.raises(
        StoreError, match=r"its rig is twin in the scan and lab now; .*seed is not given in the"
    ):
        _refuse(rig_notes("twin", {}), rig_notes("lab", {"seed": "3"}))


def test_the_same_rig_and_devices_of_a_script_are_not_another() -> None:
    stored = rig_notes("twin", {"scene": "plane", "depth_mm": "650"})
    _refuse(stored, rig_notes("twin", {"depth_mm": "650.0", "scene": "plane"}))
    _refuse(stored, {"note": "mine"})
    _refuse({}, stored)


@pytest.mark.parametrize(
    "options",
    [{"film": "on"}, {"scene": "color-checker", "sigma": "0.0"}, {"device": "cuda"}, {"realtime": "on"}],
)
def test_options_that_change_no_picture_make_no_other_rig(options: dict[str, str]) -> None:
    _refuse(rig_notes("twin", {}), rig_notes("twin", options))
    _refuse(rig_notes("twin", options), rig_notes("twin", {}))


def test_an_option_that_only_one_of_two_has_is_said_with_its_default() -> None:
    with pytest.raises(StoreError, match=r"a\.dsl .*: the option film is off in the scan and on now\."):
        _refuse(rig_notes("twin", {"film": "off"}), rig_notes("twin", {}))


def test_a_scan_knows_its_computer_and_user_without_naming_them(monkeypatch: pytest.MonkeyPatch) -> None:
    notes = rig_notes("twin", {})
    assert is_of_this_computer(notes)
    assert len(notes["scanned_on"]) == 16
    assert not is_of_this_computer({})
    monkeypatch.setattr("platform.node", lambda: "another")
    assert not is_of_this_computer(notes)


def test_a_computer_that_is_in_another_network_is_still_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.node", lambda: "Marias-Book.fritz.box")
    notes = rig_notes("lab", {})
    home = hashlib.sha256(f"Marias-Book.fritz.box\n{Path.home()}".encode()).hexdigest()[:16]
    assert is_of_this_computer(notes)
    assert is_of_this_computer({"scanned_on": home}), "as earlier versions noted it"
    monkeypatch.setattr("platform.node", lambda: "Marias-Book.local")
    assert is_of_this_computer(notes)


def test_a_calibration_is_the_same_whatever_it_is_called() -> None:
    rig = published_rig()
    digest = calibration_digest(rig)
    assert len(digest) == 32
    assert calibration_digest(rig.model_copy(update={"name": "another"})) == digest
    assert calibration_digest(rig.model_copy(update={"white_scale": 2 * rig.white_scale})) != digest


def test_a_result_says_which_model_it_was_made_with() -> None:
    rig = published_rig()
    assert model_of_notes(model_notes(rig, "grid")) == (calibration_digest(rig), "grid")
    assert model_of_notes({}) == (None, "auto")
