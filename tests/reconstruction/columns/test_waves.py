"""Waves in the columns of a part of the picture."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan, LineComb, ScanLines
from dsl_core.optics.line_set import LineSet
from dsl_core.reconstruction.columns.waves import wave_std_px

LINES = LineSet.of(CapturePlan(spectral=ScanLines(width_px=5, step_px=2)))


def columns() -> np.ndarray:
    """A tilted plane under noise, with a wave in the left half of the picture."""
    y, x = np.mgrid[:160, :240].astype(float)
    column = 40 + 0.83 * x + 0.113 * y + 0.0004 * x**2
    column[:, :120] += 0.06 * np.sin(np.pi * column[:, :120])
    return np.asarray(column + 0.005 * np.random.default_rng(0).standard_normal(column.shape))


def test_waves_widen_the_deviation_where_they_are() -> None:
    std = wave_std_px(columns(), np.ones((160, 240), bool), LINES)
    assert std[:, :120].min() > 0.9 * 0.06 / np.sqrt(2)
    assert std[:, :120].max() < 1.1 * 0.06 / np.sqrt(2)
    assert std[:, 120:].max() < 0.002


def test_nothing_is_said_of_pixels_that_no_single_lines_refined() -> None:
    refined = np.ones((160, 240), bool)
    refined[:, ::7] = False
    assert not wave_std_px(columns(), refined, LINES).any()
    assert not wave_std_px(columns(), ~refined, None).any()
    comb = LineSet.of(CapturePlan(spectral=LineComb(shifts_px=(0, 0, 0))))
    assert not wave_std_px(columns(), np.ones((160, 240), bool), comb).any()


@pytest.mark.parametrize("shape", [(8, 12), (3, 40)])
def test_pictures_too_small_to_tell_have_none(shape: tuple[int, int]) -> None:
    assert not wave_std_px(np.zeros(shape), np.ones(shape, bool), LINES).any()
