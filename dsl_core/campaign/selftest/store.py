"""The captures of a self-test on disk: one compressed NumPy archive, there whole or not at all."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from dsl_core.calibration.selftest.focus import BarFrames
from dsl_core.calibration.selftest.readings import Readings, RegionSizes
from dsl_core.calibration.selftest.record import SelfTestCapture
from dsl_core.errors import StoreError
from dsl_core.io.atomic import store_error, write_atomic

ARCHIVE_NAME = "selftest.npz"
_VERSION = 1
_NUMBERS = ("wanted_ms", "shortest_ms", "claimed_latency_ms", "show_s", "frames", "duration_s")


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
    about |= {"version": _VERSION, "bit_depth": capture.sizes.bit_depth, "parts": list(capture.parts)}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, about=np.array(json.dumps(about)), **arrays)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise store_error(folder, error) from error
    write_atomic(folder / ARCHIVE_NAME, buffer.getbuffer())
    return folder / ARCHIVE_NAME


def load_capture(folder: Path) -> SelfTestCapture:
    """Read the archive of a folder; raises `StoreError` when it is missing, damaged or of another version."""
    path = folder / ARCHIVE_NAME
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            about = json.loads(str(stored["about"]))
            if about["version"] != _VERSION:
                raise ValueError(f"version {about['version']} instead of {_VERSION}")
            return _unpacked({name: stored[name] for name in stored.files}, about)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise StoreError(
            f"{path} is missing, damaged or of another version ({error}). Capture the self-test again."
        ) from error


def _unpacked(arrays: dict[str, Any], about: dict[str, Any]) -> SelfTestCapture:
    parts = {
        part: Readings(**{each.name: arrays[f"{part}/{each.name}"] for each in fields(Readings)})
        for part in about["parts"]
    }
    bars, inverse, dark = arrays["bars"], arrays["inverse"], arrays["dark_frames"]
    return SelfTestCapture(
        parts=parts,
        sizes=RegionSizes(arrays["pixels"], arrays["beside"], about["bit_depth"]),
        bars=BarFrames((bars[0], bars[1]), (inverse[0], inverse[1])),
        dark_frames=(dark[0], dark[1]),
        **{name: about[name] for name in _NUMBERS if name != "wanted_ms"},
        wanted_ms=tuple(about["wanted_ms"]),
    )
