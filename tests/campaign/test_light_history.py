"""What a drift check finds of the light stays with the calibration in the library."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.campaign.light_history import keep_check, light_check
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Provenance, Rig
from tests.cases.small_rig import small_rig

CHECKED = "2026-03-22T10:00:00+00:00"
FIGURES = tuple(
    Figure(name=f"white signal, {colour}, over calibration", value=value, std=std, unit="1")
    for colour, value, std in (("red", 0.98, 0.001), ("green", 0.99, 0.003), ("blue", 1.01, 0.002))
)


@pytest.fixture
def rig() -> Rig:
    return small_rig().model_copy(update={"provenance": Provenance(created="2026-03-01T10:00:00+00:00")})


def test_a_check_says_what_became_of_the_light_and_since_when(rig: Rig) -> None:
    found = light_check(rig, FIGURES, CHECKED)
    assert found is not None
    assert (found.checked, found.calibrated) == (CHECKED, rig.provenance.created)
    assert (found.levels, found.std) == ((0.98, 0.99, 1.01), 0.003)
    assert light_check(rig, FIGURES[:2], CHECKED) is None
    assert light_check(small_rig(), FIGURES, CHECKED) is None


def test_checks_are_kept_with_the_current_version_alone(tmp_path: Path, rig: Rig) -> None:
    library = CalibrationLibrary(tmp_path)
    first = library.store("lab", rig)
    assert keep_check(library, "lab", FIGURES, CHECKED)
    assert keep_check(library, "lab", FIGURES, "2026-03-29T10:00:00+00:00")
    known = library.find("lab")
    assert [check.checked[:10] for check in known.rig.light_checks] == ["2026-03-22", "2026-03-29"]
    assert known.rig.model_copy(update={"light_checks": ()}) == rig
    assert not keep_check(library, f"lab@{first.stamp}", FIGURES, CHECKED)
    assert not keep_check(library, "lab", FIGURES[:1], CHECKED)
    assert library.find("lab") == known
