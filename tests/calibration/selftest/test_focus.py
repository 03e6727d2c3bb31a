"""The blur of projected bars is measured without bias."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from dsl_core.calibration.selftest.focus import BAR_PX, BarFrames, bar_levels, check_focus
from dsl_core.errors import CalibrationError

BLACK_DN = 260.0


def bar_frames(blur_px: float, pitch_px: float, noise: bool = True) -> BarFrames:
    """Bars with slanted, blurred edges under uneven light, as a camera sees them."""
    rng = np.random.default_rng(0)
    row, column = np.mgrid[:120, :300]
    place = column + 0.13 * row + 2.0
    edges = pitch_px * np.arange(-2, 300 / pitch_px + 4)
    sign = np.where(np.arange(len(edges)) % 2, -1.0, 1.0)
    share = sum(s * ndtr((place - e) / blur_px) for e, s in zip(edges, sign, strict=True))
    light = 2000 * (1 - 0.3 * column / 300)

    def frame(part: NDArray[np.float64]) -> NDArray[np.uint16]:
        signal = light * part
        shot = rng.standard_normal(signal.shape) * np.sqrt(signal / 10 + 1) if noise else 0.0
        return np.asarray(np.rint(BLACK_DN + signal + shot), np.uint16)

    return BarFrames((frame(share), frame(share)), (frame(1 - share), frame(1 - share)))


@pytest.mark.parametrize(("blur_px", "pitch_px"), [(0.3, 17.8), (1.07, 30.0), (2.5, 71.6)])
def test_the_blur_of_edges_is_measured_without_bias(blur_px: float, pitch_px: float) -> None:
    found = check_focus(bar_frames(blur_px, pitch_px), BLACK_DN)
    assert found.camera_px.value == pytest.approx(blur_px, abs=0.02 + 0.02 * blur_px)
    assert abs(found.camera_px.value - blur_px) < 5 * found.camera_px.std + 0.01 * blur_px
    assert found.projector_px.value == pytest.approx(found.camera_px.value * BAR_PX / pitch_px, rel=0.02)
    assert found.worst_px.value >= found.projector_px.value * 0.99


def test_a_picture_without_edges_is_refused() -> None:
    flat = np.full((100, 200), 1000, np.uint16)
    with pytest.raises(CalibrationError, match="No clear edges"):
        check_focus(BarFrames((flat, flat), (flat, flat)), BLACK_DN)
    with pytest.raises(CalibrationError, match="Focus"):
        check_focus(bar_frames(25.0, 30.0), BLACK_DN)


def test_bars_and_inverse_fill_the_picture() -> None:
    bars, inverse = bar_levels(640, 200, False), bar_levels(640, 200, True)
    assert (bars.astype(int) + inverse == 200).all()
    assert (np.diff(bars.astype(int)) != 0).sum() == 15
