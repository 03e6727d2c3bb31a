"""The captures of a self-test in their order: each part needs what the parts before found.

First the colour cycle, from short exposures; then the latency, from exposures of whole cycles; everything
else uses whole cycles and waits long enough.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from typing import TypeVar

import numpy as np

from dsl_core.calibration.selftest.cycle import Cycle, advised_exposures, find_cycle, has_trusted_times
from dsl_core.calibration.selftest.focus import BarFrames
from dsl_core.calibration.selftest.latency import check_latency
from dsl_core.calibration.selftest.readings import Readings
from dsl_core.calibration.selftest.record import PUBLISHED_MS, SelfTestCapture, cycle_of, needs_spread
from dsl_core.campaign.selftest.eye import BLACK, Eye
from dsl_core.campaign.selftest.light import (
    Frames,
    capture_bars,
    capture_beat,
    capture_dark,
    capture_ramps,
    capture_series,
    find_level,
)
from dsl_core.campaign.selftest.survey import Survey, survey
from dsl_core.campaign.selftest.timing import capture_cycle, capture_latency, capture_spread, white_rate
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, DeviceError
from dsl_core.progress import Progress

SEED = 20240617
_PARTS = ("light", "colour cycle", "latency", "dark frames", "ramps", "linearity", "colour beat", "focus")
#: Exposures are whole multiples of the shortest whole number of cycles that is at least this long.
_UNIT_MS = 8.0
#: Waited in addition to the latency found.
_MARGIN_MS = 10.0

T = TypeVar("T")


class SelfTestRun:
    """One run of all parts; `capture` does it."""

    def __init__(self, devices: DeviceRig, progress: Progress, wanted_ms: tuple[float, ...]) -> None:
        self._eye = Eye(devices)
        self._progress = progress
        self._wanted_ms = wanted_ms
        self._rng = np.random.default_rng(SEED)
        self._parts: dict[str, Readings] = {}
        self._done = 0

    def capture(self) -> SelfTestCapture:
        """Take all frames; raises `CalibrationError` or `DeviceError` that names the part."""
        eye, parts = self._eye, self._parts
        seen = self._part(lambda: survey(eye, self._rng))
        eye.region = seen.region
        cycle = self._part(lambda: self._cycle(seen))
        rate = white_rate(parts["cycle"], seen.black_dn)
        unit_ms = _unit(cycle)
        self._part(lambda: self._latency(seen, unit_ms, rate))
        parts["dark"], dark_frames = self._part(lambda: capture_dark(eye, unit_ms))
        parts["ramps"] = self._part(lambda: capture_ramps(eye, unit_ms, seen.black_dn))
        parts["series"], parts["saturated"] = self._part(
            lambda: capture_series(eye, unit_ms, seen.black_dn, rate)
        )
        parts["beat"] = self._part(
            lambda: capture_beat(eye, self._exposures(cycle), seen.black_dn, rate, self._rng)
        )
        bars = self._part(lambda: capture_bars(eye, unit_ms, seen.black_dn, rate))
        eye.show(BLACK)
        return self._packed(seen, bars, dark_frames)

    def _part(self, work: Callable[[], T]) -> T:
        self._progress.report("self-test", self._done, len(_PARTS))
        try:
            found = work()
        except (CalibrationError, DeviceError) as error:
            raise type(error)(f"Self-test, {_PARTS[self._done]}: {error}") from error
        self._done += 1
        return found

    def _cycle(self, seen: Survey) -> Cycle:
        readings = self._parts["cycle"] = capture_cycle(self._eye, seen, self._rng)
        spread = None
        if needs_spread(readings, find_cycle(readings, seen.black_dn)):
            rate = white_rate(readings, seen.black_dn)
            spread = self._parts["spread"] = capture_spread(self._eye, seen, rate, self._rng)
        return cycle_of(readings, spread, seen.black_dn)[0]

    def _latency(self, seen: Survey, unit_ms: float, rate: float) -> None:
        eye = self._eye
        readings = capture_latency(eye, unit_ms, find_level(eye, seen.black_dn, rate, unit_ms))
        self._parts["latency"] = readings
        found = check_latency(readings, 0.0, has_trusted_times(self._parts["cycle"]), 0.0)
        eye.settle_ms = found.wait_ms.value + _MARGIN_MS

    def _exposures(self, cycle: Cycle) -> tuple[float, ...]:
        """Exposures whose beat is measured: the published and the advised ones."""
        period = cycle.period_ms
        advised = self._wanted_ms if period is None else advised_exposures(period.value, self._wanted_ms)
        return tuple(dict.fromkeys((*PUBLISHED_MS, *advised)))

    def _packed(self, seen: Survey, bars: BarFrames, dark_frames: Frames) -> SelfTestCapture:
        eye = self._eye
        return SelfTestCapture(
            parts=self._parts,
            sizes=seen.sizes,
            bars=bars,
            dark_frames=dark_frames,
            wanted_ms=self._wanted_ms,
            shortest_ms=eye.devices.camera.info.exposure_range_ms[0],
            claimed_latency_ms=eye.devices.projector.info.latency_ms,
            show_s=float(np.median(eye.show_s)),
            frames=eye.frames,
            duration_s=eye.duration_s,
        )


def _unit(cycle: Cycle) -> float:
    """The exposure that everything else is a whole multiple of, ms."""
    if cycle.period_ms is None:
        return _UNIT_MS
    return ceil(_UNIT_MS / cycle.period_ms.value) * cycle.period_ms.value
