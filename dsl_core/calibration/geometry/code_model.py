"""Where the projector sees points of a board, from the grey values of a Gray code instead of its bits.

Near a transition of a bit the difference of pattern and inverse, over their sum, changes gradually, since
the projector's pixels are blurred and a camera pixel is wide. Every boundary of projector pixels is the
transition of one bit, so that every camera pixel locates itself far below one projector pixel. Around a
corner a quadratic map from camera to projector is fitted to all bits of all pixels at once; blur and contrast
are fitted too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.geometry.boards import grey_of, saturated
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.gray_code import bit_counts, gray_bit
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: Only the finest bits change within such a window often enough to matter.
FINEST_BITS = 5
ROUNDS = 6
#: Samples of a projector pixel in the tables of blurred bits.
OVERSAMPLE = 16
#: Blur (standard deviation, projector px) at the start, and its range.
START_BLUR_PX, BLUR_RANGE_PX = 0.7, (0.15, 3.0)
#: Differences farther from the model than this many robust deviations do not count.
OUTLIER_SIGMAS = 4.0
#: Pixels with less light than this share of the brightest ones are in shadow.
LEAST_LIGHT = 0.01
#: Pixels that a corner needs.
MIN_PIXELS = 30
#: Eigenvalues below this share of the largest count as zero.
RANK = 1e-10


@dataclass(frozen=True)
class CodeLight:
    """The finest bits of one axis in the pictures of a pose.

    ``contrast`` (bits, rows, columns) is the difference of pattern and inverse over their sum, from -1 to 1;
    ``weight`` (rows, columns) the inverse of its variance up to a factor, 0 where a pixel must not count.
    ``signs`` (bits, projector pixels) is the pattern itself, -1 or 1.
    """

    contrast: NDArray[np.float32]
    weight: NDArray[np.float32]
    signs: Floats


def gray_code_of(frames: PoseFrames, projector_size_px: tuple[int, int]) -> GrayCode:
    """The Gray code of a pose, which has rows unless there are pictures for the bits of columns only."""
    return GrayCode(rows=len(frames.pairs) != 2 * (projector_size_px[0] - 1).bit_length())


def code_light(frames: PoseFrames, projector_size_px: tuple[int, int]) -> list[CodeLight]:
    """The finest bits of columns, and of rows if they are coded."""
    bits_of = bit_counts(gray_code_of(frames, projector_size_px), projector_size_px)
    black = grey_of(frames.black)
    white = grey_of(frames.white)
    light = np.maximum(white - black, 0)
    usable = np.isfinite(white) & (light > LEAST_LIGHT * np.quantile(light, 0.99)) & ~saturated(frames)
    variance = light if frames.variance is None else np.asarray(frames.variance, np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Noise of pattern and inverse, which together are as bright as white, over their sum.
        weight = np.where(usable, light**2 / variance, 0).astype(np.float32)
    weight[~np.isfinite(weight)] = 0
    found = []
    for first, bits, size in zip((0, bits_of[0]), bits_of, projector_size_px, strict=True):
        if not bits:
            continue
        pairs = range(first + max(bits - FINEST_BITS, 0), first + bits)
        contrast = np.stack([_contrast(frames, pair, black) for pair in pairs])
        signs = np.stack([2.0 * gray_bit(size, first + bits - 1 - pair) - 1 for pair in pairs])
        found.append(CodeLight(contrast, weight, signs))
    return found


def _contrast(frames: PoseFrames, pair: int, black: NDArray[np.float32]) -> NDArray[np.float32]:
    one, other = grey_of(frames.pairs[2 * pair]), grey_of(frames.pairs[2 * pair + 1])
    total = one + other - 2 * black
    return np.asarray(np.divide(one - other, total, out=np.zeros_like(total), where=total > 0))


@dataclass(frozen=True)
class CornerWindow:
    """Pixels (rows, columns) around a corner, and the six terms of a quadratic map there, (pixels, 6).

    Terms are those of the distance from the corner in units of the window's radius, the constant first, so
    that the first coefficient of a map is its value at the corner.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    terms: Floats
    radius_px: float

    @classmethod
    def around(cls, point_px: Floats, radius_px: float, shape: tuple[int, ...]) -> CornerWindow:
        """All pixels of a picture within a radius of a point (column, row)."""
        reach = int(np.ceil(radius_px))
        middle = np.rint(point_px).astype(int)
        rows, columns = (
            np.arange(max(at - reach, 0), min(at + reach + 1, size))
            for at, size in ((middle[1], shape[0]), (middle[0], shape[1]))
        )
        y, x = (part.ravel() for part in np.meshgrid(rows, columns, indexing="ij"))
        u, v = (x - point_px[0]) / radius_px, (y - point_px[1]) / radius_px
        inside = u**2 + v**2 <= 1
        u, v = u[inside], v[inside]
        terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], 1)
        return cls(y[inside], x[inside], terms, radius_px)


def refine_maps(light: CodeLight, windows: Sequence[CornerWindow], maps: Floats) -> Floats:
    """Quadratic maps (corners, 6) of camera pixels to projector columns (or rows), px.

    ``maps`` come from decoded bits and must be right within a pixel. A window without light keeps its map.
    """
    seen = [
        (light.contrast[:, w.rows, w.columns].astype(float), light.weight[w.rows, w.columns].astype(float))
        for w in windows
    ]
    fit = _CodeFit(START_BLUR_PX, 1.0, np.full(len(light.signs), np.inf))
    maps = maps.copy()
    for _ in range(ROUNDS):
        table = _BitTable(light.signs, fit.blur_px)
        fit = fit.improved(table, windows, seen, maps)
        maps = fit.steps(_BitTable(light.signs, fit.blur_px), windows, seen, maps)
    return maps


class _BitTable:
    """Blurred bits and their slopes at any place."""

    def __init__(self, signs: Floats, blur_px: float) -> None:
        from scipy.ndimage import gaussian_filter1d

        fine = np.repeat(signs, OVERSAMPLE, 1)
        sigma = blur_px * OVERSAMPLE
        self.values = gaussian_filter1d(fine, sigma, axis=1, mode="nearest")
        self.slopes = np.gradient(self.values, axis=1) * OVERSAMPLE
        # The equation of diffusion: blur changes a profile by its curvature.
        self.by_blur = np.gradient(self.slopes, axis=1) * OVERSAMPLE * blur_px

    def at(self, place_px: Floats, *tables: Floats) -> list[Floats]:
        """Tables at places (pixels,), each (bits, pixels), linear between samples."""
        last = self.values.shape[1] - 1
        position = ((place_px + 0.5) * OVERSAMPLE - 0.5).clip(0, last - 1e-6)
        whole = position.astype(np.int64)
        part = position - whole
        return [table[:, whole] * (1 - part) + table[:, whole + 1] * part for table in tables]


@dataclass(frozen=True)
class _CodeFit:
    """What all windows share: blur, contrast, and noise of each bit (times the root of the weight).

    Light scattered between surfaces takes contrast from all fine bits alike.
    """

    blur_px: float
    strength: float
    sigma: Floats

    def improved(
        self,
        table: _BitTable,
        windows: Sequence[CornerWindow],
        seen: Sequence[tuple[Floats, Floats]],
        maps: Floats,
    ) -> _CodeFit:
        """Blur by a step of Gauss and Newton, contrast by least squares, noises by the median residual."""
        place = np.concatenate([w.terms @ m for w, m in zip(windows, maps, strict=True)])
        contrast = np.concatenate([c for c, _ in seen], 1)
        weight = np.concatenate([w for _, w in seen])
        value, by_blur = table.at(place, table.values, table.by_blur)
        residual = contrast - self.strength * value
        used = weight * self._near(residual, weight)
        strength = float((used * value * contrast).sum() / max((used * value**2).sum(), 1e-30))
        residual = contrast - strength * value
        change = strength * by_blur
        step = (used * change * residual).sum() / max((used * change**2).sum(), 1e-30)
        blur = float(np.clip(self.blur_px + np.clip(step, -0.3, 0.3), *BLUR_RANGE_PX))
        lit = weight > 0
        scatter = residual[:, lit] * np.sqrt(weight[lit])
        sigma = robust_std(scatter, 1) if lit.any() else np.ones(len(contrast))
        return _CodeFit(blur, strength, np.maximum(sigma, 1e-6))

    def steps(
        self,
        table: _BitTable,
        windows: Sequence[CornerWindow],
        seen: Sequence[tuple[Floats, Floats]],
        maps: Floats,
    ) -> Floats:
        """The maps after one step of Gauss and Newton."""
        from dsl_core.calibration.geometry.window_sums import normal_equations

        values, slopes = (np.ascontiguousarray(each.T) for each in (table.values, table.slopes))
        sums = [
            normal_equations(
                window.terms, start, contrast.T, weight, values, slopes, OVERSAMPLE, self.strength,
                self.sigma, OUTLIER_SIGMAS,
            )
            for window, (contrast, weight), start in zip(windows, seen, maps, strict=True)
        ]  # fmt: skip
        if not sums:
            return maps
        squares, rights = np.stack([each[0] for each in sums]), np.stack([each[1] for each in sums])
        # The pseudoinverse: directions that no pixel tells of are left alone.
        strength, directions = np.linalg.eigh(squares)
        known = np.abs(strength) > RANK * np.abs(strength).max(1, keepdims=True)
        along = np.where(known, np.einsum("nij,ni->nj", directions, rights), 0.0)
        along /= np.where(known, strength, 1.0)
        step = np.einsum("nij,nj->ni", directions, along)
        limit = np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(1), 1e-12))
        enough = np.array([each[2] >= MIN_PIXELS for each in sums])
        return np.asarray(maps + (enough * limit)[:, None] * step)

    def _near(self, residual: Floats, weight: Floats) -> NDArray[np.bool_]:
        """Differences that are not outliers."""
        return np.asarray(np.abs(residual) * np.sqrt(weight) <= OUTLIER_SIGMAS * self.sigma[:, None])
