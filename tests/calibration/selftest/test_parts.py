"""Sharpness, latency and hot pixels from readings with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from dsl_core.calibration.selftest.camera import Dark, Transfer, check_camera, count_hot_pixels
from dsl_core.calibration.selftest.focus import BAR_PX, BarFrames, bar_levels, check_focus
from dsl_core.calibration.selftest.latency import check_latency
from dsl_core.calibration.selftest.readings import Readings, RegionSizes
from dsl_core.errors import CalibrationError, DeviceError
from dsl_core.model.calibration.selftest import Measured
from tests.cases.cycle_readings import table

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
    with pytest.raises(CalibrationError, match="no clear edges"):
        check_focus(BarFrames((flat, flat), (flat, flat)), BLACK_DN)
    with pytest.raises(CalibrationError, match="Focus"):
        check_focus(bar_frames(25.0, 30.0), BLACK_DN)


def test_bars_and_inverse_fill_the_picture() -> None:
    bars, inverse = bar_levels(640, 200, False), bar_levels(640, 200, True)
    assert (bars.astype(int) + inverse == 200).all()
    assert (np.diff(bars.astype(int)) != 0).sum() == 15


def latency_readings(late_ms: float, waits: list[float], stale: tuple[int, ...] = ()) -> Readings:
    """Three trials of black and light at each wait, exposures of 10 ms, ``show`` takes 25 ms."""
    rows = [(0, 1000.0, k) for k in range(3)] + [(1, 1000.0, k) for k in range(3)]
    rows += [(lit, wait, k) for wait in waits for _ in range(3) for lit in (0, 1) for k in (0, 1)]
    drive, gap, since = (np.array(each) for each in zip(*rows, strict=True))
    asked = np.where((since == 0) & (np.arange(len(rows)) >= 6), gap, 0.0)
    open_ms = np.where(
        since == 0, np.clip((late_ms - asked) / 10, 0, 1), np.clip((late_ms - asked) / 10 - 1, 0, 1)
    )
    open_ms[:6] = 0
    open_ms[list(stale)] = 1
    share = np.where(drive > 0, 1 - open_ms, open_ms)
    step = 10 + asked + np.where(since == 0, 25.0, 0.0) + 1.0
    readings = table(
        np.full(len(rows), 10.0), 260 + 1000 * share[:, None] * np.ones(3), np.cumsum(step) / 1000, asked
    )
    return replace(readings, since_show=since.astype(np.int64), drive=np.repeat(drive[:, None] * 200, 3, 1))


def test_latency_is_the_shortest_wait_that_never_fails() -> None:
    found = check_latency(latency_readings(0.0, [400, 100, 25, 0]), 25.0, True, 0.0)
    assert (found.wait_ms.value, found.stale_frames, found.checked) == (0.0, 0, 26)
    assert found.blocking_ms.value == pytest.approx(25.0, abs=0.1)
    found = check_latency(latency_readings(40.0, [400, 100, 50, 45, 25]), 25.0, False, 0.012)
    assert found.wait_ms.value == 45.0
    assert found.wait_ms.std == pytest.approx(20 / np.sqrt(12), rel=0.05)
    assert found.blocking_ms.value == pytest.approx(12.0)


def test_a_stale_frame_is_counted_and_a_dead_projector_named() -> None:
    found = check_latency(latency_readings(0.0, [400, 100, 0], stale=(8,)), 25.0, True, 0.0)
    assert (found.stale_frames, found.wait_ms.value) == (1, 0.0)
    with pytest.raises(DeviceError, match="400 ms after"):
        check_latency(latency_readings(420.0, [400, 100]), 25.0, True, 0.0)
    dark = latency_readings(0.0, [400])
    with pytest.raises(DeviceError, match="no difference between black and white"):
        check_latency(replace(dark, mean_dn=np.full_like(dark.mean_dn, 260.0)), 25.0, True, 0.0)


def test_hot_pixels_are_those_that_stand_out_twice() -> None:
    rng = np.random.default_rng(2)
    first, second = (np.rint(260 + rng.standard_normal((60, 80))).astype(np.uint16) for _ in range(2))
    # The faint light of a dark projector ends at a column; its edge is not hot.
    first[:, 30:] += 40
    second[:, 30:] += 40
    assert count_hot_pixels(first, second, 1.0) == 0
    first[0, 5] = second[0, 5] = first[20, 41] = second[20, 41] = 900
    first[40, 40] = 900
    assert count_hot_pixels(first, second, 1.0) == 2


def test_exposures_that_clip_bend_no_line() -> None:
    exposure = np.arange(1.0, 13.0)
    signal = 300 * exposure[:, None] * np.ones(3)
    # One pixel in a hundred clips in the last two frames, which pulls their means down.
    clipped = np.where(signal > 3200, 0.01, 0.0)
    series = replace(table(exposure, BLACK_DN + signal - 8e3 * clipped), clipped=clipped)
    sizes = RegionSizes(np.full(3, 5000), np.zeros(3, np.int64), 12)
    none = np.zeros(3)
    dark = Dark(Measured(value=BLACK_DN, std=0.01), none, none, none, none)
    transfer = Transfer(Measured(value=10.0, std=0.01), Measured(value=1.0, std=0.01))
    end = replace(series[-1:], mean_dn=np.full((1, 3), 4000.0), clipped=np.ones((1, 3)))
    found = check_camera(dark, transfer, series, end, (0, 100), sizes)
    assert max(each.value for each in found.linearity_percent) < 1e-6
    assert (found.useful_dn, found.saturation_dn.value) == (BLACK_DN + 3000, 4000.0)
    with pytest.raises(CalibrationError, match="red channel clips at all but 4 exposures"):
        check_camera(dark, transfer, series[np.array([0, 1, 2, 3, 10, 11])], end, (0, 100), sizes)
