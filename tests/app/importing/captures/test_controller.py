"""The guess is kept, corrected, saved and imported by; outcomes that no longer count are dropped."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from dsl_app.importing.captures.controller import CapturesController
from dsl_app.importing.captures.state import NOMINAL, NONE, CapturesState, Imported, Place, captures_view

from dsl_core.errors import StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.scan.folder import ScanReader
from tests.app.importing.captures.small_capture import PROJECTOR, make_capture
from tests.app.support.doubles import InlineRunner, ManualRunner


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """To be read only."""
    return make_capture(tmp_path_factory.mktemp("capture") / "set")


def control_of(tmp_path: Path, runner: InlineRunner | ManualRunner | None = None) -> CapturesController:
    state = CapturesState(tmp_path / "scans")
    return CapturesController(state, runner or InlineRunner(), CalibrationLibrary(tmp_path / "library"))


@pytest.fixture
def control(folder: Path, tmp_path: Path) -> CapturesController:
    made = control_of(tmp_path)
    made.open(folder)
    return made


def troubles(control: CapturesController) -> dict[Place, str]:
    view = captures_view(control.state)
    said = {place: getattr(view, place.value) for place in Place}
    return {place: each.text for place, each in said.items() if each.role == "bad"}


def test_a_folder_is_guessed_listed_and_decoded(control: CapturesController, tmp_path: Path) -> None:
    state = control.state
    assert state.stated.value is not None
    assert state.stated.value.is_guessed
    assert len(state.listing.value.table) == 12
    assert len(state.small.value) == 12
    assert state.decoded.value is not None
    assert state.decoded.value.share > 0.9
    assert state.request.value.target == tmp_path / "scans" / "set.dsl"
    assert captures_view(state).can_import


def test_a_wrong_folder_is_said_beside_it(control: CapturesController, tmp_path: Path) -> None:
    control.open(tmp_path)
    assert "contains 0 pictures" in troubles(control)[Place.FOLDER]
    assert control.state.decoded.value is None
    assert not captures_view(control.state).can_import
    control.guess()
    assert Place.FOLDER in troubles(control)


def test_pictures_of_other_sizes_are_named(folder: Path, tmp_path: Path) -> None:
    from tests.cases.foreign_captures import write

    copy = make_capture(tmp_path / "mixed")
    write(copy, {"im_05.png": np.full((10, 8), 9, np.uint16)})
    control = control_of(tmp_path)
    control.open(copy)
    assert "im_05.png is 8 × 10 px" in troubles(control)[Place.FOLDER]


def test_a_change_is_checked_and_what_is_not_possible_is_not_done(control: CapturesController) -> None:
    state = control.state
    assert state.stated.value is not None
    stripes = [part.kind for part in state.stated.value.mapping.parts].index("stripes")
    control.change_part(stripes, "bits", 6)
    assert "has 12 pictures where the mapping wants 14" in troubles(control)[Place.MAPPING]
    assert state.decoded.value is None
    control.remove_part(stripes)
    assert "nothing is coded" in troubles(control)[Place.MAPPING]
    control.change_part(stripes, "bits", 5)
    assert troubles(control) == {}
    assert not state.stated.value.is_guessed
    assert state.decoded.value is not None


def test_parts_and_files_change_the_mapping(control: CapturesController) -> None:
    control.add_part(0, "skip")
    control.move_part(0, 1)
    control.change_pictures("channel", "red")
    stated = control.state.stated.value
    assert stated is not None
    assert [part.kind for part in stated.mapping.parts][1] == "skip"
    assert stated.mapping.channel == "red"


@pytest.mark.slow
def test_another_projector_is_guessed_again_or_set(control: CapturesController) -> None:
    control.set_projector((32, 30))
    stated = control.state.stated.value
    assert stated is not None
    assert stated.is_guessed
    assert stated.mapping.projector_size_px == (32, 30)
    assert not any("is assumed" in each for each in stated.mapping.unsure)
    control.change_pictures("channel", "red")
    control.set_projector(PROJECTOR)
    stated = control.state.stated.value
    assert stated is not None
    assert (stated.mapping.projector_size_px, stated.mapping.channel) == (PROJECTOR, "red")
    control.set_projector((PROJECTOR[0], 0))
    stated = control.state.stated.value
    assert stated is not None
    assert stated.mapping.projector_size_px == PROJECTOR, "a mapping has a size"


@pytest.mark.slow
def test_a_mapping_as_guessed_is_guessed_again_where_the_size_is_not_known(
    control: CapturesController,
) -> None:
    control.set_projector((32, 30))
    control.set_projector((32, 0))
    stated = control.state.stated.value
    assert stated is not None
    assert stated.is_guessed
    assert any("is assumed" in each for each in stated.mapping.unsure)


@pytest.mark.slow
def test_a_mapping_is_saved_and_used_for_another_folder(control: CapturesController, tmp_path: Path) -> None:
    file = tmp_path / "m.json"
    control.save_mapping(file)
    other = control_of(tmp_path)
    other.open(make_capture(tmp_path / "other"))
    other.load_mapping(file)
    assert control.state.stated.value is not None
    assert other.state.stated.value is not None
    assert other.state.stated.value.mapping == control.state.stated.value.mapping
    assert "--mapping" in other.command_line()
    assert captures_view(other.state).folder.text == "12 pictures, mapping of m.json."
    file.write_text("{}")
    other.load_mapping(file)
    assert "is not a mapping" in troubles(other)[Place.MAPPING]
    control.save_mapping(file / "inside" / "m.json")
    assert Place.MAPPING in troubles(control)


@pytest.mark.slow
def test_one_of_several_captures_is_chosen(tmp_path: Path) -> None:
    both = tmp_path / "both"
    for name in ("left", "right"):
        make_capture(both / name)
    control = control_of(tmp_path)
    control.open(both)
    assert sorted(control.state.sets.value) == ["left", "right"]
    assert captures_view(control.state).asks_set
    control.choose_set("right")
    stated = control.state.stated.value
    assert stated is not None
    assert stated.mapping.name == "right"
    assert sorted(control.state.sets.value) == ["left", "right"]


@pytest.mark.slow
def test_an_outcome_that_no_longer_counts_is_dropped(folder: Path, tmp_path: Path) -> None:
    runner = ManualRunner()
    control = control_of(tmp_path, runner)
    control.open(tmp_path)
    control.open(folder)
    runner.run_all()
    assert troubles(control) == {}
    assert control.state.busy.value == ""
    assert control.state.decoded.value is not None


def test_an_import_ends_with_a_scan(control: CapturesController) -> None:
    ended: list[Imported] = []
    control.state.done.connect(ended.append)
    assert not control.start()
    (made,) = ended
    assert not ScanReader(made.scan).missing()
    assert "have a column" in made.verdict
    assert not control.start()
    assert "already exists" in troubles(control)[Place.TARGET]


def test_a_full_disk_is_said_beside_where_to_save(
    control: CapturesController, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def full(*_: object) -> None:
        raise StoreError("The disk is full. Free some space, or save elsewhere.")

    monkeypatch.setattr("dsl_core.workflows.captures._write", full)
    control.start()
    assert troubles(control) == {Place.TARGET: "The disk is full. Free some space, or save elsewhere."}
    assert not list((tmp_path / "scans").iterdir())
    control.rename("elsewhere", tmp_path)
    assert troubles(control) == {}
    monkeypatch.undo()
    control.start()
    assert (tmp_path / "elsewhere.dsl").is_dir()


def test_a_calibration_is_checked_without_decoding_again(control: CapturesController) -> None:
    decoded = control.state.decoded.value
    control.choose_calibration("absent.json")
    assert "There is no file absent.json" in troubles(control)[Place.CALIBRATION]
    assert not captures_view(control.state).can_import
    control.choose_calibration("")
    assert troubles(control) == {}
    assert control.state.decoded.value is decoded


@pytest.mark.parametrize("calibration", [NONE, NOMINAL])
def test_a_place_that_cannot_be_is_said_beside_it(
    control: CapturesController, tmp_path: Path, calibration: str
) -> None:
    control.choose_calibration(calibration)
    control.rename("first", Path("~no-such-user"))
    assert "~no-such-user is not a home folder" in troubles(control)[Place.TARGET]
    control.rename("ä" * 130, tmp_path)
    assert "The name is too long" in troubles(control)[Place.TARGET]
    assert not captures_view(control.state).can_import
    control.rename("first", tmp_path)
    assert Place.TARGET not in troubles(control)


def test_nothing_stops_an_import_but_its_dialog(folder: Path, tmp_path: Path) -> None:
    runner, ended = ManualRunner(), list[Imported]()
    control = control_of(tmp_path, runner)
    control.state.done.connect(ended.append)
    control.open(folder)
    runner.run_all()
    control.start()
    steps: tuple[Callable[[], object], ...] = (
        lambda: control.open(tmp_path),
        control.guess,
        lambda: control.choose_calibration(NOMINAL),
        lambda: control.set_unit(1000.0),
        lambda: control.set_direction(True),
        lambda: control.set_curves("camera", None),
        lambda: control.set_projector((32, 24)),
        lambda: control.choose_set("left"),
        lambda: control.rename("other", tmp_path),
    )
    for step in steps:
        step()
    assert len(runner.waiting) == 1
    assert control.state.busy.value == "Importing"
    assert control.state.request.value.calibration == NONE
    runner.run_all()
    (made,) = ended
    assert made.scan == tmp_path / "scans" / "set.dsl"
    assert not ScanReader(made.scan).missing()
