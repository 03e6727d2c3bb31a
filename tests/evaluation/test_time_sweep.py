"""A sweep: errors over seconds, how sure they are, and what none beats."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.evaluation.time_sweep import FIGURES, SweepPoint, best_points, require_sweep, rms_std

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


def test_the_deviation_of_an_rms_is_that_of_many_repeats() -> None:
    maps = [np.random.default_rng(seed).normal(0, 0.4, (60, 80)) for seed in range(60)]
    spread = np.std([np.sqrt(np.mean(each**2)) for each in maps], ddof=1)
    found = [rms_std(each) for each in maps]
    assert np.mean([each for each in found if each is not None]) == pytest.approx(spread, rel=0.3)


def test_without_an_error_nothing_is_said_of_its_deviation() -> None:
    assert rms_std(np.zeros((12, 16))) is None
    assert rms_std(np.full((12, 16), np.nan)) is None
