"""Levels of frames from the sum of light and the smoothness of first orders, on frames made by hand."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from dsl_core.model.plan import CapturePlan, Columns, GrayCode, ScanLines
from dsl_core.patterns.images import spectral_profiles
from dsl_core.reconstruction.light.line_levels import LineLevels, candidates, line_levels
from dsl_core.reconstruction.merge import LineStack

PLAN = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(), projector_size_px=(120, 60))
SHAPE = (24, 120)


def levels(gains: np.ndarray, plan: CapturePlan = PLAN) -> LineLevels | None:
    """Of frames with this light: 85 % of each line straight, the rest spread over 40 columns beside it."""
    rng = np.random.default_rng(5)
    profiles = gaussian_filter1d(spectral_profiles(plan)[:, :, 0].astype(float), 0.9, axis=1)
    column = np.broadcast_to(np.arange(SHAPE[1]), SHAPE)
    surface = rng.uniform(5, 20, SHAPE)

    def seen(pattern: np.ndarray) -> np.ndarray:
        beside = np.roll(np.convolve(pattern, np.ones(40) / 40, mode="same"), 25)
        return (0.85 * pattern + 0.15 * beside) * surface

    light = np.array([seen(each) for each in profiles])
    sure = np.full(SHAPE, 0.02)
    white = seen(np.ones(SHAPE[1])) + 0.02 * rng.normal(size=SHAPE)
    frames = light * gains[:, None, None] + 0.02 * rng.normal(size=light.shape)
    stack = LineStack(frames.astype(np.float32), np.full(light.shape, 0.02), np.zeros(SHAPE, np.float32))
    whites = (white, sure**2)
    return line_levels(plan, column, whites, stack.pick(candidates(column, whites)))


def test_levels_of_flickering_frames_are_found() -> None:
    gains = 1 + 0.1 * np.random.default_rng(2).uniform(-1, 1, PLAN.spectral_count)
    found = levels(gains)
    assert found is not None
    inner = slice(4, -4)  # the outermost lines light few pixels
    off = (found.log - np.log(gains))[inner]
    assert np.std(off) < 0.15 * np.std(np.log(gains))
    assert np.std(off) < 2 * np.median(found.std)
    assert found.quick == pytest.approx(0.058, rel=0.3)


def test_steady_frames_are_found_steady() -> None:
    found = levels(np.ones(PLAN.spectral_count))
    assert found is not None
    assert np.std(found.log[4:-4]) < 0.005
    assert found.quick < 0.004


def test_patterns_that_cover_columns_unevenly_say_nothing() -> None:
    some = tuple(tuple((float(x < 6 * k), 0.5, 0.5) for x in range(120)) for k in range(10))
    plan = PLAN.model_copy(update={"spectral": Columns(levels=some)})
    assert levels(np.ones(10), plan) is None
