"""A change is dated where one difference between neighbours is as large as all of it, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.reconstruction.light.step_date import Change, _covariance, date_of_step

COUNT, NOISE = 80, 0.1
CHANGE = Change(after=5, before=70, total=1.0)


Floats = NDArray[np.float64]


def differences(course: Floats, seed: int = 0) -> tuple[Floats, Floats]:
    """Of shots whose quantity is measured with noise; the first few are not known."""
    seen = course + np.random.default_rng(seed).normal(0, NOISE, COUNT)
    steps = np.concatenate([[np.nan], np.diff(seen)])
    steps[:10] = np.nan
    return steps, np.full(COUNT, NOISE * np.sqrt(2))


def jump(at: int, by: float = 1.0) -> Floats:
    return np.where(np.arange(COUNT) >= at, by, 0.0)


@pytest.mark.parametrize("at", [14, 33, 66])
@pytest.mark.parametrize("slope", [0.0, 0.02])
def test_a_step_is_dated_whatever_the_scene_changes_meanwhile(at: int, slope: float) -> None:
    assert date_of_step(CHANGE, *differences(jump(at) + slope * np.arange(COUNT))) == at


def test_a_steady_change_has_no_date() -> None:
    for seed in range(10):
        assert date_of_step(CHANGE, *differences(np.linspace(0, 1.2, COUNT), seed)) is None


def test_a_step_where_no_difference_is_known_has_no_date() -> None:
    assert date_of_step(CHANGE, *differences(jump(8))) is None
    assert date_of_step(Change(0, 8, 1.0), *differences(jump(6))) is None


@pytest.mark.parametrize("scale", [0.02, 1.0, 50.0])
def test_several_changes_are_no_single_one_whatever_their_unit(scale: float) -> None:
    change = Change(CHANGE.after, CHANGE.before, scale)
    several, one = differences(jump(20) + jump(40, -1.0) + jump(50)), differences(jump(20))
    assert date_of_step(change, *(scale * each for each in several)) is None
    assert date_of_step(change, *(scale * each for each in one)) == 20


def test_a_faint_step_is_dated_where_something_else_changed() -> None:
    """Three deviations could be chance at one of many shots, but hardly at the one that is named."""
    steps, stds = differences(jump(33), 4)
    many = stds * 3
    assert date_of_step(CHANGE, steps, many) is None
    assert date_of_step(CHANGE, steps, many, (33, 60)) == 33
    assert date_of_step(CHANGE, steps, many, (60,)) is None


def test_differences_vary_by_the_scene_as_well_as_by_noise() -> None:
    more, noise = np.random.default_rng(3).normal(0, 0.5, 2001), np.full(2001, 0.3)
    covariance = _covariance(more, noise)
    assert np.diag(covariance) == pytest.approx(np.full(2001, 0.5**2), rel=0.1)
    assert np.diag(covariance, 1) == pytest.approx(np.full(2000, -(0.3**2) / 2))
