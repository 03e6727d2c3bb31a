"""From an unknown rig to a calibrated one by one command, killed on the way."""

from __future__ import annotations

import json

import pytest

from dsl_core.campaign.recipes import recipe_names
from dsl_core.io.rig_file import load_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig

from .conftest import BEGUN, INTERRUPTED, Calibrated

#: The campaign takes most of it.
pytestmark = pytest.mark.timeout(600)


def test_the_command_ends_with_a_rig_and_a_report(calibrated: Calibrated) -> None:
    assert calibrated.ending.code == 0, calibrated.ending.err
    said = json.loads(calibrated.ending.out)
    assert tuple(said["figures"]) == recipe_names()
    assert all(figure["passed"] for figures in said["figures"].values() for figure in figures)
    rig = load_rig(calibrated.folder / "rig.json")
    assert [note.name for note in rig.calibrations] == list(recipe_names())
    report = (calibrated.folder / "report.html").read_text(encoding="utf-8")
    assert "Calibration of campaign" in report
    assert all(note.title in report for note in rig.calibrations)


def test_the_rig_is_nearer_to_the_truth_than_the_data_sheet(calibrated: Calibrated) -> None:
    rig = load_rig(calibrated.folder / "rig.json")
    nominal = published_rig()
    nominal = nominal.model_copy(update={"camera": nominal.camera.resized(112, 72)})
    truth = random_rig(4, nominal)
    assert rig.film.lines_per_mm == pytest.approx(truth.film.lines_per_mm, rel=2e-3)
    assert rig.pose.vector_mm == pytest.approx(truth.pose.vector_mm, abs=0.5)
    assert rig.projector_response.gamma == pytest.approx(truth.projector_response.gamma, rel=0.01)
    # Few filters tell less of what lies between them.
    for order in (1, -1):
        found, true, start = (each.efficiency[order].at(450.0) for each in (rig, truth, nominal))
        assert abs(found - true) < 0.1 * abs(start - true)


def test_what_was_captured_before_the_kill_is_kept(calibrated: Calibrated) -> None:
    assert BEGUN in calibrated.killed
    assert "bandpass.json" not in calibrated.killed
    assert {f"{name}.json" for name in recipe_names()[:4]} <= set(calibrated.killed)
    others = {"lock", "campaign.json"}
    kept = {p: c for p, c in calibrated.killed.items() if p not in others and not p.startswith(INTERRUPTED)}
    assert len(kept) > 50
    for path, content in kept.items():
        assert (calibrated.folder / path).read_bytes() == content, path
    frames = [p for p in calibrated.killed if p.startswith(INTERRUPTED) and "/frames" in p]
    # A frame that was just being written was none yet: it is cleared away and taken again.
    frames = [p for p in frames if not p.endswith(".partial")]
    assert frames == [p for p in frames if (calibrated.folder / p).exists()]
    assert not ScanReader(calibrated.folder / INTERRUPTED / "scan.dsl").missing()
