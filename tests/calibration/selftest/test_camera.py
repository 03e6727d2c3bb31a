"""Black level, noise, hot pixels and the line of exposures from readings with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.selftest.camera import Dark, Transfer, check_camera, count_hot_pixels
from dsl_core.calibration.selftest.readings import RegionSizes
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.selftest import Measured
from tests.cases.cycle_readings import table

BLACK_DN = 260.0


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
