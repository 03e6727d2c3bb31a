"""Merge the settings of a bracket into one linear frame with a variance per pixel.

A raw value of setting i is ``raw_i = black_i + g_i L + noise`` with the gain ``g_i = exposure x pattern
radiance`` and the radiance ``L`` in DN per ms at full projector drive. Black is subtracted with its
sign: clipping would bias the dark pixels that hold the first orders.

The weights are the inverse variances ``g_i^2 / (floor_i + g_i L / K)`` with K electrons per
DN. ``L`` in them is not the pixel's own noisy value, which would favour values that happen to be low:
it is the ratio ``sum (raw_i - black_i) / sum g_i`` over the unsaturated settings, and only the ratio
of the weights of two settings matters, which hardly depends on it. What remains is less than 0.15
standard deviations, and only where a setting is within its noise of saturation. The weights of section
1.1 of the supplement of "Dispersed Structured Light" (Shin et al., CVPR 2024), trapezoids of the noisy
values themselves, scatter more and are biased near black by about 0.6 standard deviations.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.plan import Setting
from dsl_core.model.rig import ProjectorResponse, Sensor
from dsl_core.optics.sensor import raw_variance
from dsl_core.reconstruction.room import Room

Array = NDArray[np.float32]

_NO_VALUES, _NO_BITS = np.empty((0, 0), np.float32), np.empty((0, 0), np.uint16)
#: Memory that a thread uses for one frame after another.
_rooms = threading.local()


def _room() -> Room:
    if not hasattr(_rooms, "own"):
        _rooms.own = Room()
    own: Room = _rooms.own
    return own


@dataclass(frozen=True)
class BlackFrame:
    """What a setting shows without a pattern: mean (DN) and the variance of that mean (DN^2)."""

    mean: Array
    variance: Array


@dataclass(frozen=True)
class MergedFrame:
    """A merged mosaic, arrays of shape (rows, columns).

    ``radiance`` is in DN per ms at full projector drive, black subtracted, and may be negative by noise.
    Where ``saturated``, every setting is: ``variance`` is infinite and ``radiance`` a lower bound
    (reason `Flag.SATURATED`).
    """

    radiance: Array
    variance: Array
    saturated: NDArray[np.bool_]


def black_frame(frames: Sequence[NDArray[np.unsignedinteger]], sensor: Sensor) -> BlackFrame:
    """Mean of one or more black frames of a setting; its variance follows from the sensor's noise."""
    if not frames:
        raise DecodeError(
            "A setting has no black frame. Capture one: all other frames are measured relative to it."
        )
    mean: Array = np.asarray(np.mean(np.stack(frames), axis=0, dtype=np.float32))
    variance = raw_variance(sensor, np.asarray(mean - sensor.black_level_dn)) / len(frames)
    return BlackFrame(mean, np.asarray(variance, np.float32))


def gained_black(black: Array, dn: float, share: float, level_dn: float) -> Array:
    """Black (DN) with so much more in every pixel, and this share more of what is above its level."""
    return np.asarray(black + np.float32(dn) + np.float32(share) * (black - np.float32(level_dn)), np.float32)


def setting_gains_ms(settings: Sequence[Setting], response: ProjectorResponse) -> NDArray[np.float64]:
    """Exposure x pattern radiance above the projector's black, ms at full drive, shape (settings,)."""
    black = response.radiance(0.0)
    return np.array([s.exposure_ms * float(response.radiance(s.level) - black) for s in settings])


class HdrMerger:
    """Merges frame by frame, in any thread."""

    def __init__(
        self,
        gains_ms: Sequence[float] | NDArray[np.float64],
        blacks: Sequence[BlackFrame],
        sensor: Sensor,
        *,
        saturation_margin_dn: float | None = None,
    ) -> None:
        """Prepare for frames of one size.

        A raw value counts as saturated within ``saturation_margin_dn`` of full scale; by default 2 % of it,
        several sigmas of shot noise.
        """
        if len(gains_ms) != len(blacks) or not blacks:
            raise DecodeError(f"{len(gains_ms)} settings need as many black frames, not {len(blacks)}.")
        if not np.all(np.asarray(gains_ms) > 0):
            raise DecodeError(
                f"Exposure x pattern radiance must be positive, given {np.asarray(gains_ms).tolist()} ms."
            )
        self.shape = blacks[0].mean.shape
        self._level_dn = sensor.black_level_dn
        full_dn = sensor.full_scale_dn
        margin = 0.02 * full_dn if saturation_margin_dn is None else saturation_margin_dn
        self._limit_dn = int(np.ceil(full_dn - margin))
        self._gains: Array = np.asarray(gains_ms, np.float32)
        self._shots: Array = self._gains / np.float32(sensor.electrons_per_dn)
        for black in blacks:
            self._check_shape(black.mean)
        self._black: Array = np.stack([black.mean for black in blacks]).astype(np.float32, copy=False)
        self._floor: Array = np.empty_like(self._black)
        for floor, black in zip(self._floor, blacks, strict=True):
            floor[:] = raw_variance(sensor, black.mean - sensor.black_level_dn) + black.variance

    def merge(
        self,
        raws: Sequence[NDArray[np.unsignedinteger]],
        out: MergedFrame | None = None,
        levels: Sequence[float] | None = None,
        gained: Sequence[tuple[float, float]] | None = None,
    ) -> MergedFrame:
        """Merge one raw mosaic per setting, in the order of the gains; writes into ``out`` if given.

        ``levels`` is the light that each was exposed to, relative to what the gains assume (None: all 1), and
        ``gained`` what each has above its black frame, as in `gained_black` (None: nothing).
        Raises `DecodeError` when a frame is missing, has another size, or is not of whole numbers.
        """
        if out is None:
            out = MergedFrame(
                np.empty(self.shape, np.float32), np.empty(self.shape, np.float32), np.empty(self.shape, bool)
            )
        self._merge(raws, levels, gained, out.radiance, out.variance, _NO_BITS, out.saturated)
        return out

    def merge_std(
        self,
        raws: Sequence[NDArray[np.unsignedinteger]],
        radiance: Array,
        std: NDArray[np.floating],
        levels: Sequence[float] | None = None,
        gained: Sequence[tuple[float, float]] | None = None,
    ) -> None:
        """The same into ``radiance`` and ``std``, of half or single precision, both (rows, columns)."""
        saturated = _room().of("saturated", self.shape, bool)
        if std.dtype == np.float16:
            self._merge(raws, levels, gained, radiance, _NO_VALUES, std.view(np.uint16), saturated)
        else:
            self._merge(raws, levels, gained, radiance, std, _NO_BITS, saturated)
            np.sqrt(std, out=std)

    def _merge(
        self,
        raws: Sequence[NDArray[np.unsignedinteger]],
        levels: Sequence[float] | None,
        gained: Sequence[tuple[float, float]] | None,
        radiance: Array,
        variance: NDArray[np.floating],
        halves: NDArray[np.uint16],
        saturated: NDArray[np.bool_],
    ) -> None:
        # Only who merges frames needs compiled code.
        from dsl_core.reconstruction.hdr_kernels import merge_settings

        if len(raws) != len(self._black):
            raise DecodeError(f"The bracket has {len(self._black)} settings, given {len(raws)} frames.")
        for raw in raws:
            self._check_shape(raw)
            if not np.issubdtype(raw.dtype, np.unsignedinteger):
                raise DecodeError(f"Raw frames contain unsigned whole numbers, not {raw.dtype}.")
        light = np.ones(len(raws), np.float32) if levels is None else np.asarray(levels, np.float32)
        black = self._black
        if gained is not None:
            black = np.stack(
                [gained_black(each, *more, self._level_dn) for each, more in zip(black, gained, strict=True)]
            )
        counts = _room().of("counts", self._black.shape, np.uint16)
        np.stack(raws, out=counts)
        merge_settings(
            counts, black, self._floor, self._gains * light, self._shots * light, self._limit_dn,
            radiance, variance, halves, saturated,
        )  # fmt: skip

    def _check_shape(self, image: NDArray[np.generic]) -> None:
        if image.shape != self.shape:
            raise DecodeError(
                f"A frame has shape {image.shape}; {self.shape} is needed. All frames of a bracket come from"
                " one camera and crop."
            )
