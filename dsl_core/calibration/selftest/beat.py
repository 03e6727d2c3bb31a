"""The colour beat by measurement: how much repeats at one exposure differ."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.selftest.camera import Transfer
from dsl_core.calibration.selftest.readings import Readings, RegionSizes
from dsl_core.model.calibration.selftest import Beat, Measured


def check_beats(
    readings: Readings, black_dn: float, transfer: Transfer, sizes: RegionSizes
) -> tuple[Beat, ...]:
    """A `Beat` for each exposure, in the order of first use."""
    exposures = list(dict.fromkeys(readings.exposure_ms.tolist()))
    return tuple(
        _beat(readings[readings.exposure_ms == exposure], exposure, black_dn, transfer, sizes)
        for exposure in exposures
    )


def _beat(
    repeats: Readings, exposure_ms: float, black_dn: float, transfer: Transfer, sizes: RegionSizes
) -> Beat:
    signal = repeats.mean_dn - black_dn
    mean = signal.mean(0)
    ratios = signal[:, [0, 2]] / signal[:, [1]]
    channels = 100 * signal.std(0, ddof=1) / mean
    ratio = float((100 * ratios.std(0, ddof=1) / ratios.mean(0)).max())
    # Relative standard deviation of a standard deviation of normal numbers.
    share = 1 / np.sqrt(2 * (len(repeats) - 1))
    measured = [Measured(value=float(value), std=float(share * value)) for value in channels]
    floor = 100 * transfer.mean_std(mean, sizes.pixels) / mean
    return Beat(
        exposure_ms=exposure_ms,
        channels_percent=(measured[0], measured[1], measured[2]),
        ratio_percent=Measured(value=ratio, std=share * ratio),
        floor_percent=float(floor.max()),
    )
