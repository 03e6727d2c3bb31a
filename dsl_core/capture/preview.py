"""Frames as people watch them: quick picture, histogram, saturation, focus, and the graphs of a scan.

Intensity graphs grow with the scan and are coarse enough to keep all of them in memory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.display import PLAIN, Display, display_tables
from dsl_core.errors import DecodeError
from dsl_core.model.plan import CapturePlan, LineComb, ScanLines, Shot
from dsl_core.model.rig import BayerPattern

#: Bins of the histogram over the whole range of counts.
BINS = 256
#: Share of saturated pixels that deserves a warning (as in comparable programs).
MANY_SATURATED = 0.005
#: Positions of red, the two greens and blue in a cell of two by two pixels: (row, column).
_SITES: dict[BayerPattern, tuple[tuple[int, int], ...]] = {
    "RGGB": ((0, 0), (0, 1), (1, 0), (1, 1)),
    "BGGR": ((1, 1), (0, 1), (1, 0), (0, 0)),
    "GRBG": ((0, 1), (0, 0), (1, 1), (1, 0)),
    "GBRG": ((1, 0), (0, 0), (1, 1), (0, 1)),
    "MONO": ((0, 0), (0, 1), (1, 0), (1, 1)),
}
#: Channel of each site above.
_CHANNELS = (0, 1, 1, 2)
#: Memory that a scan's graphs may take, bytes.
BUDGET_BYTES = 128 << 20


@dataclass(frozen=True)
class Statistics:
    """What a frame says about its exposure and focus.

    ``histogram`` counts raw pixels, shape (3, BINS), over 0 to full scale; ``saturated`` is the share of raw
    pixels at full scale per channel; ``focus`` is the mean squared gradient of green over its squared mean,
    which rises as edges sharpen and does not depend on exposure; ``mean_dn`` is the mean of each channel.
    """

    histogram: NDArray[np.int64]
    saturated: tuple[float, float, float]
    mean_dn: tuple[float, float, float]
    focus: float


def quick_picture(
    mosaic: NDArray[np.uint16],
    bayer: BayerPattern,
    full_scale_dn: int,
    show_saturation: bool = False,
    display: Display = PLAIN,
) -> NDArray[np.uint8]:
    """RGB picture of half the size, one pixel a Bayer cell, shape (rows // 2, columns // 2, 3), 0 to 255.

    Counts are shown by a square root, so that dark parts can be seen, unless ``display`` says otherwise. With
    ``show_saturation`` a cell with any pixel at full scale is pure red, judged on raw counts. Raises
    `DecodeError` for images below 2 x 2 pixels.
    """
    sites = _cells(mosaic, bayer)
    picture = np.empty((*sites[0].shape, 3), np.uint8)
    green = (sites[1].astype(np.uint32) + sites[2]) >> 1
    # Two pixels of one row are the same colour to a monochrome camera, and would show edges in false colours.
    ends = (green, green) if bayer == "MONO" else (sites[0], sites[3])
    shown = [np.minimum(values, full_scale_dn) for values in (ends[0], green, ends[1])]
    for channel, table in enumerate(display_tables(display, shown, full_scale_dn)):
        picture[..., channel] = table[shown[channel]]
    if show_saturation:
        hit = np.maximum(np.maximum(sites[0], sites[1]), np.maximum(sites[2], sites[3])) >= full_scale_dn
        picture[hit] = (255, 0, 0)
    return picture


def statistics(mosaic: NDArray[np.uint16], bayer: BayerPattern, full_scale_dn: int) -> Statistics:
    """Histogram, saturation, means and focus of a raw mosaic; raises `DecodeError` for images below 2 x 2."""
    sites = _cells(mosaic, bayer)
    shift = max(full_scale_dn.bit_length() - 8, 0)
    histogram = np.zeros((3, BINS), np.int64)
    saturated, total, count = np.zeros(3), np.zeros(3), np.zeros(3)
    for channel, site in zip(_CHANNELS, sites, strict=True):
        bins = np.bincount((site >> shift).ravel(), minlength=BINS)
        histogram[channel] += bins[:BINS]
        histogram[channel, -1] += bins[BINS:].sum()
        saturated[channel] += np.count_nonzero(site >= full_scale_dn)
        total[channel] += site.sum(dtype=np.int64)
        count[channel] += site.size
    red, green, blue = (saturated / count).tolist()
    means = (total / count).tolist()
    return Statistics(histogram, (red, green, blue), (means[0], means[1], means[2]), _focus(sites[1]))


def channels(mosaic: NDArray[np.uint16], bayer: BayerPattern) -> tuple[NDArray[np.uint16], ...]:
    """Red, green (the mean of its two) and blue of every Bayer cell; raises `DecodeError` below 2 x 2."""
    sites = _cells(mosaic, bayer)
    # The mean of two counts may not overflow on its way.
    green = ((sites[1].astype(np.uint32) + sites[2]) >> 1).astype(np.uint16)
    return sites[0], green, sites[3]


def _cells(mosaic: NDArray[np.uint16], bayer: BayerPattern) -> tuple[NDArray[np.uint16], ...]:
    rows, columns = (size // 2 * 2 for size in mosaic.shape)
    if mosaic.ndim != 2 or min(rows, columns) < 2:
        raise DecodeError(
            f"A mosaic needs at least 2 x 2 pixels, not {mosaic.shape}. Check the camera's region."
        )
    whole = mosaic[:rows, :columns]
    return tuple(np.ascontiguousarray(whole[y::2, x::2]) for y, x in _SITES[bayer])


def site_colour(column: int, row: int, bayer: BayerPattern) -> str:
    """The colour that a pixel of the mosaic sees; empty for a monochrome camera.

    >>> site_colour(0, 0, "RGGB"), site_colour(3, 0, "RGGB"), site_colour(5, 7, "RGGB")
    ('red', 'green', 'blue')
    """
    if bayer == "MONO":
        return ""
    return ("red", "green", "green", "blue")[_SITES[bayer].index((row % 2, column % 2))]


def _focus(green: NDArray[np.uint16]) -> float:
    # Every second row is enough for a score and halves the time.
    values = green[::2].astype(np.float32)
    mean = float(values.mean())
    if mean <= 0 or values.shape[1] < 2:
        return 0.0
    return float(np.mean(np.diff(values, axis=1) ** 2)) / mean**2


@dataclass(frozen=True)
class BlockGraph:
    """What a block of pixels saw of each pattern.

    ``position_px`` (patterns,) is where each pattern's first line begins on the projector; ``mean_dn``
    (settings, patterns, 3) are raw counts in R, G, B, of a monochrome camera (settings, patterns, 1), NaN
    where no frame is there yet. The block is ``block_px`` wide and high and holds ``pixel``, ``(x, y)``.
    """

    pixel: tuple[int, int]
    block_px: int
    position_px: NDArray[np.float64]
    mean_dn: NDArray[np.float32]


class BlockGraphs:
    """Collects spectral frames of a plan as block means."""

    def __init__(self, plan: CapturePlan, bayer: BayerPattern, budget_bytes: int = BUDGET_BYTES) -> None:
        """Blocks are as small as the budget allows, and hold whole cells of the mosaic."""
        self._plan, self._bayer = plan, bayer
        width, height = plan.camera_size_px
        count = len(plan.settings) * plan.spectral_count
        self.block_px = 2
        while _bytes(width, height, self.block_px, count) > budget_bytes:
            self.block_px += 2
        shape = (len(plan.settings), plan.spectral_count, 3, height // self.block_px, width // self.block_px)
        self._means = np.zeros(shape, np.float32)
        self._there = np.zeros(shape[:2], bool)

    def add(self, shot: Shot, pixels: NDArray[np.uint16]) -> None:
        """Take a frame; frames of other roles are left out."""
        if shot.role != "spectral":
            return
        cells = self.block_px // 2
        rows, columns = self._means.shape[-2:]
        for channel, values in enumerate(channels(pixels, self._bayer)):
            whole = values[: rows * cells, : columns * cells]
            # The sum over rows first: it runs along memory.
            sums = np.add.reduceat(whole, np.arange(0, rows * cells, cells), axis=0, dtype=np.float32)
            sums = np.add.reduceat(sums, np.arange(0, columns * cells, cells), axis=1)
            self._means[shot.setting, shot.pattern, channel] = sums / cells**2
        self._there[shot.setting, shot.pattern] = True

    def graph(self, pixel: tuple[int, int]) -> BlockGraph | None:
        """The graph of the block around a pixel ``(x, y)``; None outside the image."""
        row, column = pixel[1] // self.block_px, pixel[0] // self.block_px
        rows, columns = self._means.shape[-2:]
        if not (0 <= row < rows and 0 <= column < columns) or self._means.shape[1] == 0:
            return None
        means = self._means[..., row, column].copy()
        means[~self._there] = np.nan
        if self._bayer == "MONO":
            # What stands for green is the mean of two pixels of each cell.
            means = means @ np.array([[0.25], [0.5], [0.25]], np.float32)
        return BlockGraph(pixel, self.block_px, line_positions(self._plan), means)


def line_positions(plan: CapturePlan) -> NDArray[np.float64]:
    """Projector column at which each pattern's first line begins; its number where there are no lines."""
    step = plan.spectral.step_px if isinstance(plan.spectral, ScanLines | LineComb) else 1
    return np.arange(plan.spectral_count, dtype=np.float64) * step


def _bytes(width: int, height: int, block: int, count: int) -> int:
    return 3 * 4 * count * (width // block) * (height // block)
