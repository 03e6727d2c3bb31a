"""Where the first orders of projected lines appear on a known plane, seen through a bandpass filter.

For a tile of the image the film model says how columns change from pixel to pixel; what it may get wrong
there is one shift. Shift, brightness of the three colours and a dark offset of the tile are fitted to all
its pixels in all line frames at once, with the profile that line, blur and filter give. That works for any
step of the lines: what frames do not sample, neighbouring pixels do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.film.order_paths import (
    LineFrames,
    Passband,
    Paths,
    reach_px,
    trace_paths,
    values_near,
)
from dsl_core.calibration.film.order_paths import tile_count as count_tiles
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import Correspondence
from dsl_core.optics.shading import Plane

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Columns of plain background on either side of the profile.
FLANK_PX = 4.0
#: The farthest search for a first guess, and how near to the zero order line frames are not searched, in
#: columns at a focal length of `FOCAL_PX`: a film unlike its data sheet turns orders by angles.
SEARCH_PX, ZERO_ORDER_PX, FOCAL_PX = 40.0, 60.0, 983.0
#: Rounds of the fit; the first finds the brightness that the shift needs.
ROUNDS = 5
#: A tile's light counts when it stands this many deviations above nothing.
LIT_SIGMAS = 6.0
#: Error of the modelled profile relative to its peak, added to each variance.
MODEL_ERROR = 0.005


@dataclass(frozen=True)
class TileColumns:
    """Columns of one order at one wavelength: a pixel for each tile, its depth, column (px) and deviation."""

    order: int
    wavelength_nm: float
    tiles: Ints
    pixels: Ints
    depth_mm: Floats
    column_px: Floats
    std_px: Floats

    def __len__(self) -> int:
        return len(self.tiles)


def fit_columns(
    rig: Rig, plane: Plane, frames: LineFrames, passband: Passband, model: Correspondence
) -> TileColumns:
    """Fit every tile's shift, from within a few columns of the model; tiles without light are left out."""
    paths = trace_paths(rig, plane, frames.pixels, passband, model)
    near = values_near(frames, paths, reach_px(frames.lines, paths, passband) + FLANK_PX)
    count, sample = count_tiles(rig), near.sample
    tiles, colour = paths.tiles[sample], paths.colour[sample]
    shading, per_nm = paths.shading[sample], paths.per_nm[sample]
    fitted = _TileFit(np.zeros((count, 5)), np.zeros((count, 5)), np.ones(count))
    shift, weight = np.zeros(count), 1 / near.variance
    half, sign = frames.lines.width_px / 2, np.sign(per_nm)
    for _ in range(ROUNDS):
        off = near.line_px - paths.column_px[sample] - shift[tiles]
        start, stop = (passband.centroid_nm + paths.wavelength(sample, off + side * half) for side in (-1, 1))
        light, slope = passband.between(start, stop, colour)
        brightness = fitted.values[tiles, colour]
        along = -sign * slope / per_nm * shading * brightness
        fitted = _fit_tiles(tiles, count, colour, sign * light * shading, along, near.value, weight)
        shift = shift + np.nan_to_num(fitted.values[:, 4]).clip(-2, 2)
        peak = fitted.values[tiles, colour] * shading * np.abs(light).max(initial=0)
        weight = 1 / (near.variance + (MODEL_ERROR * peak) ** 2)
    chosen, at = paths.middle
    lit = (fitted.values[chosen, :3] / fitted.std[chosen, :3].clip(1e-30)).max(1) > LIT_SIGMAS
    std = fitted.std[chosen, 4] * np.sqrt(fitted.chi_square[chosen].clip(1))
    good = lit & (np.abs(fitted.values[chosen, 4]) < 0.2) & np.isfinite(std) & (std > 0) & (std < 1)
    return _shifts(paths, passband, chosen[good], at[good], shift, std[good])


@dataclass(frozen=True)
class _TileFit:
    """Brightness of R, G, B, dark offset and shift of every tile (tiles, 5), deviations, chi-square."""

    values: Floats
    std: Floats
    chi_square: Floats


def _fit_tiles(
    tiles: Ints, count: int, colour: Ints, g: Floats, along: Floats, y: Floats, weight: Floats
) -> _TileFit:
    """Weighted linear least squares of each tile; ``along`` is the derivative by the shift, zero: unknown."""
    normal, right = np.zeros((count, 5, 5)), np.zeros((count, 5))

    def total(values: Floats, mine: slice | NDArray[np.bool_] = slice(None)) -> Floats:
        return np.bincount(tiles[mine], values[mine], count).astype(np.float64)

    for c in range(3):
        mine = colour == c
        normal[:, c, c] = total(weight * g * g, mine)
        normal[:, c, 3] = normal[:, 3, c] = total(weight * g, mine)
        normal[:, c, 4] = normal[:, 4, c] = total(weight * g * along, mine)
        right[:, c] = total(weight * g * y, mine)
    normal[:, 3, 3], right[:, 3] = total(weight), total(weight * y)
    normal[:, 3, 4] = normal[:, 4, 3] = total(weight * along)
    normal[:, 4, 4], right[:, 4] = total(weight * along**2), total(weight * along * y)
    size = np.sqrt(np.diagonal(normal, axis1=1, axis2=2))
    size = np.where(size > 0, size, 1.0)
    # A colour that is blind to the filter has no light and no part in anything.
    scaled = normal / (size[:, :, None] * size[:, None, :]) + 1e-9 * np.eye(5)
    inverse = np.linalg.inv(scaled)
    values = (inverse @ (right / size)[:, :, None])[:, :, 0] / size
    values[normal[:, 4, 4] <= 0, 4] = 0.0
    left = y - values[tiles, colour] * g - values[tiles, 3] - values[tiles, 4] * along
    chi = total(weight * left**2) / np.maximum(np.bincount(tiles, minlength=count) - 5, 1)
    return _TileFit(values, np.sqrt(np.diagonal(inverse, axis1=1, axis2=2).clip(0)) / size, chi)


def search_px(rig: Rig) -> tuple[float, float]:
    """How far `search_columns` searches, and how near to the zero order it does not, whole columns (px).

    In proportion to the focal length, yet no less than what lines and their blur take anywhere.
    """
    times = max(1.0, rig.projector.fx_px / FOCAL_PX)
    return float(round(SEARCH_PX * times)), float(round(ZERO_ORDER_PX * times))


def search_columns(
    rig: Rig, plane: Plane, frames: LineFrames, passband: Passband, model: Correspondence
) -> TileColumns:
    """The same from as far off as `search_px`, to a few columns: the brightest place along the columns."""
    paths = trace_paths(rig, plane, frames.pixels, passband, model)
    farthest_px, unused_px = search_px(rig)
    near = values_near(frames, paths, farthest_px)
    near = near.only(np.abs(near.line_px - paths.zero_px[near.sample]) > unused_px)
    count, bins = count_tiles(rig), int(2 * farthest_px) + 1
    off = np.rint(near.line_px - paths.column_px[near.sample] + farthest_px).astype(np.int64)
    cell = paths.tiles[near.sample] * bins + off.clip(0, bins - 1)
    light = (passband.signal / passband.signal.max())[paths.colour[near.sample]] * paths.shading[near.sample]
    kernel = np.ones(2 * round(reach_px(frames.lines, paths, passband) / 2) + 1)

    def profile(values: Floats) -> Floats:
        table = np.bincount(cell, values, count * bins).reshape(count, bins)
        return np.apply_along_axis(np.convolve, 1, table, kernel, "same")

    power, signal = profile(light**2 / near.variance), profile(light * near.value / near.variance)
    level = np.divide(signal, power, out=np.zeros_like(signal), where=power > 0)
    best = np.where(power > 0.2 * power.max(1, keepdims=True), level, -np.inf).argmax(1)
    rows, place = np.arange(count), np.arange(bins)
    # Between lines far apart the level is flat: the middle of what is bright, not its first place.
    bright = (level - 0.5 * level[rows, best][:, None]).clip(0) * (
        np.abs(place - best[:, None]) < len(kernel)
    )
    middle = (bright * place).sum(1) / bright.sum(1).clip(1e-30)
    sigmas = (level[rows, best] - np.median(level, 1)) * np.sqrt(power[rows, best])
    chosen, at = paths.middle
    # A peak at the end of the search is the flank of something else.
    good = (sigmas[chosen] > LIT_SIGMAS) & (np.abs(best[chosen] - farthest_px) < farthest_px - 3)
    width = np.full(int(good.sum()), 1 + frames.lines.step_px / 8)
    return _shifts(paths, passband, chosen[good], at[good], middle - farthest_px, width)


def _shifts(
    paths: Paths, passband: Passband, tiles: Ints, at: Ints, shift: Floats, std: Floats
) -> TileColumns:
    return TileColumns(
        passband.order,
        passband.centroid_nm,
        tiles,
        paths.pixels[at],
        paths.depth_mm[at],
        paths.column_px[at] + shift[tiles],
        std,
    )
