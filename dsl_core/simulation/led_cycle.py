"""Projectors that flash their LEDs one after the other: what an exposure catches of each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LEDS = 3


def led_weights(start_ms: float, exposure_ms: float, period_ms: float) -> NDArray[np.float64]:
    """Light of each LED that an exposure catches, relative to what it would at steady light, shape (3,).

    In each period red, green and blue are on for a third each, three times as bright. Exposures of whole
    periods catch exactly one of each, whenever they start.
    """
    whole = round(exposure_ms / period_ms)
    if whole > 0 and abs(exposure_ms - whole * period_ms) < 1e-9 * exposure_ms:
        return np.ones(LEDS)
    ends = np.array([start_ms, start_ms + exposure_ms])
    on = [np.diff(_time_on(ends / period_ms, led))[0] for led in range(LEDS)]
    return np.array(on) * LEDS * period_ms / exposure_ms


def largest_deviation(periods: float) -> float:
    """The most by which an LED's share of an exposure of so many periods differs from one.

    Of a remaining part f of a period an LED is on at least ``f - 2/3`` and at most ``1/3``.
    """
    whole = round(periods)
    if whole > 0 and abs(periods - whole) < 1e-9 * periods:
        return 0.0
    rest = periods - np.floor(periods)
    on = np.array([max(rest - 1 + 1 / LEDS, 0.0), min(rest, 1 / LEDS)])
    return float(np.abs(LEDS * (np.floor(periods) / LEDS + on) / periods - 1).max())


def _time_on(periods: NDArray[np.float64], led: int) -> NDArray[np.float64]:
    """How long an LED was on since time zero, in periods."""
    within = periods - np.floor(periods)
    return np.asarray(np.floor(periods) / LEDS + np.clip(within - led / LEDS, 0, 1 / LEDS))
