"""What a drift check finds of the light stays with the calibration in the library."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.campaign.light_history import keep_check, light_check
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Provenance, Rig
from dsl_core.reconstruction.calibration_age import scale_in_words, scale_rel_std, unseen_since
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


def test_a_check_is_kept_where_nobody_noted_when_the_light_was_calibrated(tmp_path: Path) -> None:
    """A verdict asks for it, and scans of its day know their light by it."""
    library, scanned = CalibrationLibrary(tmp_path), "2026-03-22T12:00:00+00:00"
    library.store("imported", small_rig())
    assert "light not checked since the calibration" in scale_in_words(small_rig(), scanned, 0.03)
    assert keep_check(library, "imported", FIGURES, CHECKED)
    known = library.find("imported").rig
    assert [check.levels for check in known.light_checks] == [(0.98, 0.99, 1.01)]
    assert "(light checked on 2026-03-22)" in scale_in_words(known, scanned, scale_rel_std(known, scanned))
    assert scale_rel_std(known, scanned) == pytest.approx((0.02**2 + 0.003**2) ** 0.5)
    assert "found the light -2.0% ± 0.3% off" in unseen_since(known, scanned)


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
