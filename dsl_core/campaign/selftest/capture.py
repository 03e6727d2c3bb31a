"""The captures of a self-test: taken in an order in which each part needs what earlier ones found, and kept.

First the colour cycle, from short exposures; then the latency, from exposures of whole cycles; everything
else uses whole cycles and waits long enough. All of it is kept in one compressed NumPy archive.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import fields, replace
from math import ceil
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dsl_core.calibration.selftest.cycle import Cycle, advised_exposures, find_cycle, has_trusted_times
from dsl_core.calibration.selftest.focus import BarFrames
from dsl_core.calibration.selftest.latency import check_latency
from dsl_core.calibration.selftest.readings import Readings, RegionSizes
from dsl_core.calibration.selftest.record import PUBLISHED_MS, SelfTestCapture, cycle_of, needs_spread
from dsl_core.campaign.selftest.parts import (
    Frames,
    capture_bars,
    capture_beat,
    capture_black,
    capture_cycle,
    capture_dark,
    capture_latency,
    capture_ramps,
    capture_series,
    capture_spread,
    find_level,
    longest_units,
    white_rate,
)
from dsl_core.campaign.selftest.recorder import Recorder
from dsl_core.campaign.selftest.survey import Survey, survey
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, DeviceError, StoreError
from dsl_core.io.atomic import make_folder, write_atomic
from dsl_core.io.reading import require_plain
from dsl_core.optics.sensor import step_of
from dsl_core.progress import Progress

SEED = 20240617
ARCHIVE_NAME = "selftest.npz"
_VERSION = 1
_NUMBERS = ("wanted_ms", "shortest_ms", "claimed_latency_ms", "show_s", "frames", "duration_s")
_PARTS = (
    *("light", "colour cycle", "latency", "dark frames", "ramps", "linearity", "colour beat"),
    *("focus", "black again"),
)
#: Columns of the readings that archives of before lack.
_LATER = ("pair_covariance_dn2", "second_variance_dn2")
#: Exposures are whole multiples of the shortest whole number of cycles that is at least this long.
_UNIT_MS = 8.0
#: Waited in addition to the latency found.
_MARGIN_MS = 10.0

T = TypeVar("T")


class SelfTestRun:
    """One run of all parts; `capture` does it."""

    def __init__(self, devices: DeviceRig, progress: Progress, wanted_ms: tuple[float, ...]) -> None:
        self._recorder = Recorder(devices)
        self._progress = progress
        self._wanted_ms = wanted_ms
        self._rng = np.random.default_rng(SEED)
        self._parts: dict[str, Readings] = {}
        self._done = 0

    def capture(self) -> SelfTestCapture:
        """Take all frames; raises `CalibrationError` or `DeviceError` that names the part."""
        recorder, parts = self._recorder, self._parts
        seen = self._part(lambda: survey(recorder, self._rng))
        recorder.region = seen.region
        cycle = self._part(lambda: self._cycle(seen))
        rate = white_rate(parts["cycle"], seen.black_dn)
        unit_ms = _unit(cycle)
        # Nothing is advised that the camera cannot do.
        longest_ms = longest_units(recorder, unit_ms) * unit_ms
        self._wanted_ms = tuple(dict.fromkeys(min(each, longest_ms) for each in self._wanted_ms))
        self._part(lambda: self._latency(seen, unit_ms, rate))
        parts["dark"], dark_frames = self._part(lambda: capture_dark(recorder, unit_ms))
        parts["ramps"] = self._part(lambda: capture_ramps(recorder, unit_ms, seen.black_dn))
        parts["series"], parts["saturated"] = self._part(
            lambda: capture_series(recorder, unit_ms, seen.black_dn, rate)
        )
        # Before the next picture: the last reading is one that should clip.
        ends_dn = recorder.ends_dn
        parts["beat"] = self._part(
            lambda: capture_beat(recorder, self._exposures(cycle), seen.black_dn, rate, self._rng)
        )
        bars = self._part(lambda: capture_bars(recorder, unit_ms, seen.black_dn, rate))
        parts["black again"] = self._part(lambda: capture_black(recorder))
        return self._packed(replace(seen.sizes, ends_dn=ends_dn), bars, dark_frames)

    def _part(self, work: Callable[[], T]) -> T:
        self._progress.report("self-test", self._done, len(_PARTS))
        try:
            found = work()
        except (CalibrationError, DeviceError) as error:
            raise type(error)(f"Self-test, {_PARTS[self._done]}: {error}") from error
        self._done += 1
        return found

    def _cycle(self, seen: Survey) -> Cycle:
        readings = self._parts["cycle"] = capture_cycle(self._recorder, seen, self._rng)
        spread = None
        if needs_spread(readings, find_cycle(readings, seen.black_dn)):
            rate = white_rate(readings, seen.black_dn)
            spread = self._parts["spread"] = capture_spread(self._recorder, seen, rate, self._rng)
        return cycle_of(readings, spread, seen.black_dn)[0]

    def _latency(self, seen: Survey, unit_ms: float, rate: float) -> None:
        recorder = self._recorder
        readings = capture_latency(recorder, unit_ms, find_level(recorder, seen.black_dn, rate, unit_ms))
        self._parts["latency"] = readings
        found = check_latency(readings, 0.0, has_trusted_times(self._parts["cycle"]), 0.0)
        recorder.settle_ms = found.wait_ms.value + _MARGIN_MS

    def _exposures(self, cycle: Cycle) -> tuple[float, ...]:
        """Exposures whose beat is measured, those the camera has: the published and the advised ones."""
        period = cycle.period_ms
        advised = self._wanted_ms if period is None else advised_exposures(period.value, self._wanted_ms)
        return tuple(dict.fromkeys((*PUBLISHED_MS, *advised)))

    def _packed(self, sizes: RegionSizes, bars: BarFrames, dark_frames: Frames) -> SelfTestCapture:
        recorder = self._recorder
        return SelfTestCapture(
            parts=self._parts,
            sizes=replace(sizes, step_dn=step_of(recorder.counts)),
            bars=bars,
            dark_frames=dark_frames,
            wanted_ms=self._wanted_ms,
            shortest_ms=recorder.devices.camera.info.exposure_range_ms[0],
            claimed_latency_ms=recorder.devices.projector.info.latency_ms,
            show_s=float(np.median(recorder.show_s)),
            frames=recorder.frames,
            duration_s=recorder.duration_s,
        )


def _unit(cycle: Cycle) -> float:
    """The exposure that everything else is a whole multiple of, ms."""
    if cycle.period_ms is None:
        return _UNIT_MS
    return ceil(_UNIT_MS / cycle.period_ms.value) * cycle.period_ms.value


#: More than all frames of a self-test take, bytes.
_MOST_BYTES = 1 << 30
#: What NumPy and zlib raise for an archive that is damaged or made up.
_FAILURES = (
    *(OSError, ValueError, KeyError, EOFError, TypeError, IndexError, AttributeError),
    *(MemoryError, RuntimeError, zipfile.BadZipFile, zlib.error),
)


def save_capture(capture: SelfTestCapture, folder: Path) -> Path:
    """Write the archive into a folder, which is made if need be; raises `StoreError`."""
    arrays: dict[str, Any] = {
        f"{part}/{each.name}": getattr(readings, each.name)
        for part, readings in capture.parts.items()
        for each in fields(Readings)
    }
    arrays |= {"pixels": capture.sizes.pixels, "beside": capture.sizes.beside}
    arrays |= {"bars": np.stack(capture.bars.bars), "inverse": np.stack(capture.bars.inverse)}
    arrays |= {"dark_frames": np.stack(capture.dark_frames)}
    about = {name: getattr(capture, name) for name in _NUMBERS}
    about |= {
        "version": _VERSION,
        "bit_depth": capture.sizes.bit_depth,
        "step_dn": capture.sizes.step_dn,
        "ends_dn": capture.sizes.ends_dn,
        "is_monochrome": capture.sizes.is_monochrome,
        "parts": list(capture.parts),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, about=np.array(json.dumps(about)), **arrays)
    make_folder(folder)
    write_atomic(folder / ARCHIVE_NAME, buffer.getbuffer())
    return folder / ARCHIVE_NAME


def load_capture(folder: Path) -> SelfTestCapture:
    """Read the archive of a folder; raises `StoreError` when it is missing, damaged or of another version."""
    path = folder / ARCHIVE_NAME
    try:
        require_plain(path)
        with zipfile.ZipFile(path) as archive:
            if sum(each.file_size for each in archive.infolist()) > _MOST_BYTES:
                raise ValueError("it unpacks to more than any self-test")
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            about = json.loads(str(stored["about"]))
            if about["version"] != _VERSION:
                raise ValueError(f"version {about['version']} instead of {_VERSION}")
            return _unpacked({name: stored[name] for name in stored.files}, about)
    except _FAILURES as error:
        raise StoreError(
            f"{path} is missing, damaged or of another version ({error}). Capture the self-test again."
        ) from error


def _unpacked(arrays: dict[str, Any], about: dict[str, Any]) -> SelfTestCapture:
    parts = {}
    for part in about["parts"]:
        unknown = dict.fromkeys(_LATER, np.zeros_like(arrays[f"{part}/pair_variance_dn2"]))
        known = {name.split("/")[1]: values for name, values in arrays.items() if name.startswith(f"{part}/")}
        parts[part] = Readings(**{each.name: (unknown | known)[each.name] for each in fields(Readings)})
    bars, inverse, dark = arrays["bars"], arrays["inverse"], arrays["dark_frames"]
    return SelfTestCapture(
        parts=parts,
        sizes=RegionSizes(
            arrays["pixels"],
            arrays["beside"],
            about["bit_depth"],
            step_dn=about.get("step_dn", 1),
            ends_dn=about.get("ends_dn"),
            is_monochrome=about.get("is_monochrome", False),
        ),
        bars=BarFrames((bars[0], bars[1]), (inverse[0], inverse[1])),
        dark_frames=(dark[0], dark[1]),
        **{name: about[name] for name in _NUMBERS if name != "wanted_ms"},
        wanted_ms=tuple(about["wanted_ms"]),
    )
