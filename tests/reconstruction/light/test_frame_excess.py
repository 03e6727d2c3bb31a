"""Excess of frames where no order of their line arrives, by pictures made by hand."""

import numpy as np
import pytest

from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import ProjectorResponse
from dsl_core.reconstruction.light.frame_excess import FEWEST, Halo, Pictures, Places

#: A line every ten columns; what is 4 to 9 columns away is reached by no order.
LINES = ScanLines(width_px=2, step_px=10)
COLUMN = np.repeat(np.arange(100.0), 100)


def excess(frames: np.ndarray, unlit_px: tuple[float, float] = (4.0, 9.0)) -> np.ndarray:
    places = Places(LINES, COLUMN, 15.0, unlit_px)
    pictures = Pictures(frames, np.ones_like(frames), np.zeros(len(COLUMN)))
    no_halo = Halo(np.zeros(len(COLUMN)), ProjectorResponse(blur_px=0.6))
    return pictures.where_unlit(places, np.ones((1, len(COLUMN))), no_halo)[..., 0]


def test_a_pixel_that_is_far_off_counts_as_one_that_is_off_by_four_deviations() -> None:
    frames = np.full((3, len(COLUMN)), 2.0)
    unlit = np.flatnonzero((np.abs(COLUMN - 11.0) >= 4) & (np.abs(COLUMN - 11.0) < 9))
    frames[1, unlit[5]] += 500.0
    more, std = excess(frames)
    assert more[[0, 2]] == pytest.approx(2.0)
    assert more[1] - 2.0 == pytest.approx(4.0 / len(unlit), rel=0.05)
    assert std[1] == pytest.approx(len(unlit) ** -0.5, rel=0.01)


def test_too_few_unlit_pixels_tell_nothing() -> None:
    frames = np.full((3, len(COLUMN)), 2.0)
    assert FEWEST < 100
    assert np.isnan(excess(frames, (4.0, 4.0))).all()
