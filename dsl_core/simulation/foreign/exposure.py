"""What happens to a frame's light: a projector that drifts, lamps that flicker, and uneven pixels."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.simulation.foreign.variants import Foreign

Signal = NDArray[np.float32]
#: Loss of the projector's light, and how long it takes to reach it and to come back, s.
DRIFT_SHARE, DRIFT_S = 0.03, 300.0
#: Light of the room's lamps, DN per ms; beats of its flicker: frequency, Hz, and share of the light.
LAMPS_DN_PER_MS, BEATS = 0.03, ((0.37, 0.07), (1.13, 0.05), (2.71, 0.05))
#: Standard deviation of pixel gains; share of hot pixels, and their mean dark current, DN per ms.
GAIN_STD, HOT_SHARE, HOT_DN_PER_MS = 0.01, 5e-4, 0.3


def light_level(foreign: Foreign, time_s: float) -> float:
    """Light of the projector relative to that at the start."""
    if not foreign.has("light-drift"):
        return 1.0
    return float(1 - DRIFT_SHARE * 0.5 * (1 - np.cos(np.pi * time_s / DRIFT_S)))


def lamps(foreign: Foreign, start_s: float, exposure_ms: float) -> float:
    """Mean light of the lamps over an exposure, DN per ms."""
    if not foreign.has("flicker"):
        return 0.0
    half_s = 0.0005 * exposure_ms
    total = 1.0
    for k, (hertz, share) in enumerate(BEATS):
        total += share * np.sinc(2 * hertz * half_s) * np.sin(2 * np.pi * hertz * (start_s + half_s) + k)
    return float(LAMPS_DN_PER_MS * total)


@lru_cache(maxsize=4)
def uneven_pixels(seed: int, rows: int, columns: int) -> tuple[Signal, Signal]:
    """Gain of every pixel, and dark current, DN per ms, zero for all but hot ones; both (rows, columns)."""
    rng = np.random.default_rng([seed, 6151])
    gain = 1 + GAIN_STD * rng.standard_normal((rows, columns))
    hot = (rng.random((rows, columns)) < HOT_SHARE) * rng.exponential(HOT_DN_PER_MS, (rows, columns))
    return gain.astype(np.float32), hot.astype(np.float32)


def exposed(foreign: Foreign, light: Signal, ambient_dn_per_ms: float, time_s: float, ms: float) -> Signal:
    """Signal (DN per ms) of an exposure of so many ms that starts at a time.

    ``light`` is the projector's at the start plus the steady ambient light.
    """
    steady = np.float32(ambient_dn_per_ms)
    light = (light - steady) * np.float32(light_level(foreign, time_s)) + steady
    light = light + np.float32(lamps(foreign, time_s, ms))
    if not foreign.has("prnu"):
        return light
    gain, hot = uneven_pixels(foreign.seed, *light.shape)
    return np.asarray(light * gain + hot)
