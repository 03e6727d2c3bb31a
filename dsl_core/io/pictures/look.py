"""What reading all pictures of a capture shows: some lines of each, their bits and where these end."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures.camera_raw import BITS
from dsl_core.io.pictures.candidates import Candidate, require_alike
from dsl_core.io.pictures.picture_file import bayer_of, holds_sensor_values, load_values
from dsl_core.io.pictures.value_scale import ValueScale
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.colour import srgb_decode
from dsl_core.patterns.recognition.probes import Probes, ProbeTaker

#: A projector that lights less than this share of the camera's range is as good as off.
LEAST_LIGHT = 0.02
#: Mean values of the four places of a mosaic differ by at least this ratio, its two greens by less.
MOSAIC_RATIO, GREEN_RATIO = 1.12, 1.05


@dataclass(frozen=True)
class Look:
    """What reading all pictures of a candidate showed."""

    probes: Probes
    decoded: Probes
    bit_depth: int | None
    left_aligned: bool
    full_scale: float | None
    bayer: BayerPattern | None
    notes: tuple[str, ...]


def look_at(candidate: Candidate) -> Look:
    """Read all pictures of a candidate; raises `StoreError` where they are no capture of one camera."""
    taker, bits, most, ends = ProbeTaker(), 0, 0.0, ValueScale()
    first: NDArray[Any] | None = None
    brightest: tuple[float, NDArray[np.float32]] | None = None
    colour = is_wide = False
    for picture in candidate.pictures:
        if picture is None:
            continue
        values = load_values(picture)
        first = values if first is None else first
        require_alike(picture, values, first)
        colour = colour or values.ndim == 3
        most = max(most, float(values.max()))
        ends.add(values)
        if values.dtype.kind in "ui":
            bits |= int(np.bitwise_or.reduce(values.ravel()))
            is_wide = is_wide or values.dtype.itemsize > 1
        grey = np.asarray(values.mean(axis=2) if values.ndim == 3 else values, np.float32)
        if brightest is None or grey.mean() > brightest[0]:
            brightest = float(grey.mean()), grey
        taker.add(grey)
    assert first is not None
    assert brightest is not None
    stated = bayer_of(next(each for each in candidate.pictures if each is not None))
    white = ends.white if first.dtype.kind == "f" else None
    depth, aligned = _depth_of(bits, most, is_wide, white is not None) if stated is None else (BITS, False)
    scale = white or float((1 << (16 if aligned else depth or 8)) - 1)
    probes = taker.finish(max(scale, 1e-9))
    decoded = taker.finish(max(scale, 1e-9), srgb_decode)
    if probes.range_share < LEAST_LIGHT:
        raise StoreError(
            f"The pictures of {candidate.name} change by {probes.range_share:.1%} of their range: no"
            " projector's light is seen. Give the folder of a capture, or expose longer."
        )
    notes = (
        ["JPEG has changed values near edges of stripes"] if has_ending(candidate, {".jpg", ".jpeg"}) else []
    )
    bayer = stated or (None if colour else _bayer_of(brightest[1]))
    if bayer is not None and stated is None:
        notes.append(
            f"neighbouring pixels look like a colour mosaic; {bayer} is assumed (red and blue unsure)"
        )
    if white is None and stated is None and holds_sensor_values(first.dtype):
        white = _limit_of(ends.limit, aligned, depth)
        if white is not None:
            notes.append(f"values end at {white:g}: pixels that reach it are taken to be saturated")
    return Look(probes, decoded, depth, aligned, white, bayer, tuple(notes))


def _limit_of(limit: float | None, aligned: bool, depth: int | None) -> float | None:
    """Where values end, None if it is at the largest number of their bits or unknown."""
    unused = 2 ** (16 - depth) - 1 if aligned and depth else 0
    largest = 2**16 - 1 - unused if aligned else 2 ** (depth or 8) - 1
    return None if limit is None or limit >= largest else limit


def _depth_of(bits: int, most: float, is_wide: bool, floats: bool) -> tuple[int | None, bool]:
    """Bit depth and whether values are at the upper end of 16 bits, from all bits that occur."""
    if floats:
        return 16, False
    if not is_wide:
        return None, False
    for depth in (10, 12):
        if most < 2**depth:
            return depth, False
    for depth in (10, 12):
        if bits % 2 ** (16 - depth) == 0:
            return depth, True
    return 16, False


def _bayer_of(picture: NDArray[np.float32]) -> BayerPattern | None:
    means = np.array([[picture[r::2, c::2].mean() for c in (0, 1)] for r in (0, 1)])
    if means.min() <= 0 or means.max() / means.min() < MOSAIC_RATIO:
        return None
    ratios = [max(a, b) / min(a, b) for a, b in ((means[0, 1], means[1, 0]), (means[0, 0], means[1, 1]))]
    if min(ratios) > GREEN_RATIO:
        return None
    return "RGGB" if ratios[0] < ratios[1] else "GRBG"


def has_ending(candidate: Candidate, suffixes: Collection[str]) -> bool:
    """Whether a picture of a candidate has one of these endings, with the dot."""
    return any(p is not None and p.path.suffix.lower() in suffixes for p in candidate.pictures)
