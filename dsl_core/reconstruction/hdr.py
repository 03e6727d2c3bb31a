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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.plan import Setting
from dsl_core.model.rig import ProjectorResponse, Sensor
from dsl_core.optics.sensor import raw_variance

Array = NDArray[np.float32]

#: Rows merged at a time, so that all buffers stay in the processor's cache; even, to keep the Bayer phase.
_BLOCK_ROWS = 32


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


def setting_gains_ms(settings: Sequence[Setting], response: ProjectorResponse) -> NDArray[np.float64]:
    """Exposure x pattern radiance above the projector's black, ms at full drive, shape (settings,)."""
    black = response.radiance(0.0)
    return np.array([s.exposure_ms * float(response.radiance(s.level) - black) for s in settings])


class HdrMerger:
    """Merges frame by frame; keeps its buffers, so one merger serves one thread."""

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
        full_dn = sensor.full_scale_dn
        margin = 0.02 * full_dn if saturation_margin_dn is None else saturation_margin_dn
        self._limit_dn = int(np.ceil(full_dn - margin))
        self._gain = [np.float32(gain) for gain in gains_ms]
        self._shot = [gain / np.float32(sensor.electrons_per_dn) for gain in self._gain]
        for black in blacks:
            self._check_shape(black.mean)
        self._black = [black.mean for black in blacks]
        self._floor = [
            (raw_variance(sensor, black.mean - sensor.black_level_dn) + black.variance).astype(np.float32)
            for black in blacks
        ]
        block = (_BLOCK_ROWS, self.shape[1])
        self._signal = [np.empty(block, np.float32) for _ in blacks]
        self._open = [np.empty(block, np.float32) for _ in blacks]
        self._work = [np.empty(block, np.float32) for _ in range(4)]

    def merge(
        self,
        raws: Sequence[NDArray[np.unsignedinteger]],
        out: MergedFrame | None = None,
        levels: Sequence[float] | None = None,
    ) -> MergedFrame:
        """Merge one raw mosaic per setting, in the order of the gains; writes into ``out`` if given.

        ``levels`` is the light that each was exposed to, relative to what the gains assume (None: all 1).
        Raises `DecodeError` when a frame is missing, has another size, or is not of whole numbers.
        """
        if len(raws) != len(self._black):
            raise DecodeError(f"The bracket has {len(self._black)} settings, given {len(raws)} frames.")
        for raw in raws:
            self._check_shape(raw)
            if not np.issubdtype(raw.dtype, np.unsignedinteger):
                raise DecodeError(f"Raw frames contain unsigned whole numbers, not {raw.dtype}.")
        if out is None:
            out = MergedFrame(
                np.empty(self.shape, np.float32), np.empty(self.shape, np.float32), np.empty(self.shape, bool)
            )
        light = [np.float32(level) for level in levels or [1.0] * len(raws)]
        with np.errstate(divide="ignore", invalid="ignore"):
            for start in range(0, self.shape[0], _BLOCK_ROWS):
                rows = slice(start, min(start + _BLOCK_ROWS, self.shape[0]))
                block = MergedFrame(out.radiance[rows], out.variance[rows], out.saturated[rows])
                self._merge_block([raw[rows] for raw in raws], rows, block, light)
        return out

    def _merge_block(
        self, raws: list[NDArray[np.unsignedinteger]], rows: slice, out: MergedFrame, light: list[np.float32]
    ) -> None:
        count = rows.stop - rows.start
        signal, gains = [a[:count] for a in self._signal], [a[:count] for a in self._open]
        total, weight, term, expected = (a[:count] for a in self._work)
        total[...] = 0
        weight[...] = 0
        for i, raw in enumerate(raws):
            np.subtract(raw, self._black[i][rows], out=signal[i])
            # The gain of a saturated value is zero, so that it drops out of every sum.
            np.multiply(self._gain[i] * light[i], raw < self._limit_dn, out=gains[i])
            weight += gains[i]
            np.greater(gains[i], 0, out=term)
            term *= signal[i]
            total += term
        np.equal(weight, 0, out=out.saturated)
        np.divide(total, weight, out=expected)
        total[...] = 0
        # Negative becomes zero, and so does what is saturated everywhere and not a number here.
        np.fmax(expected, total, out=expected)
        weight[...] = 0
        for i in range(len(raws)):
            np.multiply(expected, self._shot[i] * light[i], out=term)
            term += self._floor[i][rows]
            np.divide(gains[i], term, out=term)
            weight += np.multiply(term, gains[i], out=gains[i])
            term *= signal[i]
            total += term
        np.divide(total, weight, out=out.radiance)
        np.divide(1, weight, out=out.variance)
        if out.saturated.any():
            self._bound(rows, out, light)

    def _bound(self, rows: slice, out: MergedFrame, light: list[np.float32]) -> None:
        """The least radiance that saturates every setting, where every setting is saturated."""
        bounds = [
            (self._limit_dn - black[rows]) / (gain * level)
            for black, gain, level in zip(self._black, self._gain, light, strict=True)
        ]
        np.copyto(out.radiance, np.max(bounds, axis=0), where=out.saturated)

    def _check_shape(self, image: NDArray[np.generic]) -> None:
        if image.shape != self.shape:
            raise DecodeError(
                f"A frame has shape {image.shape}; {self.shape} is needed. All frames of a bracket come from"
                " one camera and crop."
            )
