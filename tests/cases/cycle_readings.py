"""Readings of short exposures under LEDs that flash one after the other, from formulas alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.selftest.readings import Readings

BLACK_DN = 260.0
#: Channels (columns) of the camera under each LED (rows), DN per ms.
MIX = np.array([[165.0, 44.0, 6.0], [40.0, 307.0, 73.0], [8.0, 32.0, 206.0]])


def table(
    exposure_ms: NDArray[np.float64],
    mean_dn: NDArray[np.float64],
    timestamp_s: NDArray[np.float64] | None = None,
    gap_ms: NDArray[np.float64] | None = None,
) -> Readings:
    """Readings of which only these columns matter."""
    n = len(exposure_ms)
    none = np.zeros(n)
    return Readings(
        exposure_ms=exposure_ms,
        timestamp_s=none if timestamp_s is None else timestamp_s,
        gap_ms=none if gap_ms is None else gap_ms,
        since_show=np.zeros(n, np.int64),
        drive=np.full((n, 3), 255, np.int64),
        mean_dn=mean_dn,
        beside_dn=np.zeros((n, 3)),
        clipped=np.zeros((n, 3)),
        pair_variance_dn2=np.zeros((n, 3)),
        pair_covariance_dn2=np.zeros((n, 3)),
        second_variance_dn2=np.zeros((n, 3)),
        is_pair=np.zeros(n, bool),
    )


def led_time_ms(
    hz: float, start_ms: NDArray[np.float64], exposure_ms: NDArray[np.float64]
) -> NDArray[np.float64]:
    """For how long each exposure sees each LED, times three, (n, 3)."""

    def since_zero(time_ms: NDArray[np.float64]) -> NDArray[np.float64]:
        phase = time_ms[:, None] * hz / 1000 - np.arange(3) / 3
        return np.floor(phase) + np.clip(3 * (phase - np.floor(phase)), 0, 1)

    return np.asarray((since_zero(start_ms + exposure_ms) - since_zero(start_ms)) * 1000 / hz)


def short_exposures(
    hz: float, seed: int = 0, exposure_ms: float = 1.5, jitter_ms: float = 0.0, depth: float = 1.0
) -> Readings:
    """96 exposures at irregular times; ``jitter_ms`` is what the time stamps do not know."""
    rng = np.random.default_rng(seed)
    gap = rng.uniform(5, 45, 96)
    end = np.cumsum(gap + exposure_ms)
    exposures = np.full(96, exposure_ms)
    start = end - exposure_ms + jitter_ms * rng.random(96) + 1000 * rng.random()
    light = depth * led_time_ms(hz, start, exposures) + (1 - depth) * exposure_ms
    signal = light @ MIX * (1 + 3e-4 * rng.standard_normal((96, 3)))
    return table(exposures, BLACK_DN + signal, end / 1000, gap)
