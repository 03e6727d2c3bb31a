"""A sweep: errors over seconds, how sure they are, and what none beats."""

from __future__ import annotations

import pytest

from dsl_core.errors import DecodeError
from dsl_core.evaluation.time_sweep import FIGURES, SweepPoint, best_points, require_sweep

DEPTH, REFLECTANCE, _ = FIGURES


def test_best_is_what_no_quicker_scan_beats() -> None:
    points = [
        SweepPoint("slow", 60.0, depth_mm=0.5, reflectance=0.001),
        SweepPoint("quick", 10.0, depth_mm=1.0),
        SweepPoint("good", 30.0, depth_mm=0.3, reflectance=0.01),
    ]
    assert best_points(points, DEPTH) == [1, 2]
    assert best_points(points, REFLECTANCE) == [2, 0]
    with pytest.raises(DecodeError, match="needs two scans"):
        require_sweep(points[:1])


def test_of_equal_scans_all_are_best() -> None:
    points = [SweepPoint(name, 10.0, depth_mm=1.0, reflectance=0.1) for name in ("one", "other")]
    assert best_points([*points, SweepPoint("slow", 20.0, depth_mm=1.0)], DEPTH) == [0, 1]


def test_every_error_says_how_sure_it_is() -> None:
    point = SweepPoint("good", 30.0, 0.3, 0.01, 0.02, 0.001)
    assert [point.words(figure) for figure in FIGURES] == ["0.300 ± 0.010", "0.0200 ± 0.0010", "–"]
    assert [point.std(figure) for figure in FIGURES] == [0.01, 0.001, None]
