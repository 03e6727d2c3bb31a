"""Where a diffraction order is in the signals of scan lines, found without knowing the film.

In each cell of the image the signals, lined up by their distance from the zero order, are added up; the order
is the brightest peak. Its distance changes smoothly over the image, as a quadratic of the pixel's place that
is fitted to the cells and refined with signals lined up by the fit itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import LineTable

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Half window (px) in which the light of the zero order is summed.
ZERO_HALF_PX = 9.0
#: Cells of the image, down and across, and pixels that one needs.
CELLS = (4, 6)
MIN_PIXELS = 12
#: Half windows (px) around first and second orders, of a projector and film as `dispersion` states them.
ORDER_HALF_PX, SECOND_HALF_PX = 20.0, 27.0
#: Distance of second from first orders, as multiples of the first's.
SECOND_PLACE = (1.9, 2.35)
#: Bins of the lined-up signals, px, and smoothing (bins) before the peak is searched.
BIN_PX, SMOOTH_BINS = 2.0, 9
#: How many deviations a peak must stand above nothing, and its least share of the light of the zero order.
MIN_SIGMAS, MIN_SHARE = 8.0, 2e-4
#: Cells whose peak is farther from the others' than this are not used, px; terms of the quadratic.
OUTLIER_PX, TERMS = 12.0, 6
REFINEMENTS = 3
#: Least deviation of a cell's peak, px; what the quadratic's terms change by in a refinement.
CELL_PX, TERM_PX = 0.3, 13.0
#: How far inside the frame a cell's light must come from to be refined with, px: at the edge a part of the
#: order is missing, which pulls its centre inwards, and where the order is, is known only roughly.
INSIDE_PX = 30.0


@dataclass(frozen=True)
class PlanePixels:
    """Pixels of a flat white target.

    Arrays (P,): zero-order column (px), shading, colour 0..2; ``place`` (2, P), rows and columns of the image
    as shares 0..1. ``whole`` (P,) says, by order, where the order's light comes from rows inside the frame.
    """

    column_px: Floats
    shading: Floats
    colour: Ints
    place: Floats
    whole: dict[int, NDArray[np.bool_]]

    @property
    def cell(self) -> Ints:
        """Number of each pixel's cell of the image."""
        down, across = (
            np.clip((share * count).astype(int), 0, count - 1)
            for share, count in zip(self.place, CELLS, strict=True)
        )
        return np.asarray(down * CELLS[1] + across)

    @property
    def cells(self) -> int:
        """How many cells the image has."""
        return CELLS[0] * CELLS[1]

    def at(self, which: NDArray[np.bool_]) -> PlanePixels:
        """The pixels that are chosen."""
        whole = {order: inside[which] for order, inside in self.whole.items()}
        return PlanePixels(
            self.column_px[which], self.shading[which], self.colour[which], self.place[:, which], whole
        )


@dataclass(frozen=True)
class LineGraph:
    """What some pixels see of the lines, arrays (frames, P), and their zero-order amplitude (P,).

    Signal is without dark signal, zero order and halo; distance is that of the line from the zero order.
    ``widening`` is how many times more columns orders take than windows are stated for.
    """

    signal: Floats
    variance: Floats
    distance: Floats
    amplitude: Floats
    pixels: PlanePixels
    frame_px: int
    widening: float = 1.0

    def holds(self, centre: Floats, half_px: float) -> NDArray[np.bool_]:
        """Pixels (P,) whose light at ``centre`` (P,) px from the zero order comes from inside the frame."""
        column = self.pixels.column_px + centre
        return np.asarray((column > half_px) & (column < self.frame_px - 1 - half_px))


def line_graph(
    lines: ScanLines,
    pixels: PlanePixels,
    radiance: Floats,
    std: Floats,
    distance: Floats,
    response: ProjectorResponse,
    unlit_px: tuple[float, float],
    frame_px: int,
    widening: float = 1.0,
) -> tuple[LineGraph, tuple[float, float]]:
    """Take dark signal, zero order and halo out; and how far the zero order moved, with deviation (px).

    The dark signal is that of lines between the distances ``unlit_px``; zero where there are none.
    """
    from dsl_core.calibration.orders.line_sums import take_out, zero_sums

    # The profile is symmetric: the slope is that against a zero order that moves on.
    reach_px = float(np.abs(distance).max(initial=1.0)) + 1
    table = LineTable(lines.width_px, response, reach_px, torch.zeros(1, dtype=torch.float64))
    expected, slope = (each.numpy() for each in table.at(torch.as_tensor(-distance)))
    # Amplitude and dark signal of each pixel from its sums over lit and unlit lines, which hold whatever the
    # blur: lines that tile the frame share a pixel's light out among them.
    lit, lit_light, near, dark, dark_light, unlit = zero_sums(
        radiance, expected, distance, ZERO_HALF_PX, unlit_px
    )
    count = np.maximum(unlit, 1)
    scale = near / count
    amplitude = (lit - scale * dark) / (lit_light - scale * dark_light)
    offset = (dark - amplitude * dark_light) / count
    signal, variance, sums = take_out(
        radiance, std, expected, slope, distance, amplitude, offset, ZERO_HALF_PX
    )
    total = max(float(sums[0]), 1e-30)
    moved = float(sums[1]) / total, float(np.sqrt(sums[2])) / total
    return LineGraph(signal, variance, distance, amplitude, pixels, frame_px, widening), moved


def by_cell(pixels: PlanePixels, which: NDArray[np.bool_]) -> list[NDArray[np.bool_]]:
    """Masks of the chosen pixels of each cell, empty ones included."""
    cells = pixels.cell
    return [which & (cells == cell) for cell in range(CELLS[0] * CELLS[1])]


def of_colours(
    pixels: PlanePixels, values: Floats, use: NDArray[np.bool_], middle: Callable[[Floats], np.floating[Any]]
) -> tuple[Floats, Floats]:
    """Mean of cells for each colour, (3,), and its deviation by their scatter; NaN, infinite for too few.

    ``middle`` is what stands for the values (P,) of a cell.
    """
    mean, std = np.full(3, np.nan), np.full(3, np.inf)
    for colour in range(3):
        masks = by_cell(pixels, use & (pixels.colour == colour))
        cells = [float(middle(values[mask])) for mask in masks if mask.sum() >= MIN_PIXELS]
        if len(cells) > 1:
            mean[colour], std[colour] = np.mean(cells), np.std(cells) / np.sqrt(len(cells) - 1)
    return mean, std


def cell_means(pixels: PlanePixels, values: Floats) -> tuple[Floats, Floats]:
    """Mean of values (P,) by colour and cell with its deviation, (3, cells); NaN, infinite for too few."""
    key = pixels.colour * pixels.cells + pixels.cell
    count, total, square = (
        np.bincount(key, each, 3 * pixels.cells).reshape(3, -1)
        for each in (np.ones(len(values)), values, values**2)
    )
    enough = count >= MIN_PIXELS
    count = np.maximum(count, 2)
    mean = total / count
    std = np.sqrt(np.maximum(square / count - mean**2, 0.0) / (count - 1))
    return np.where(enough, mean, np.nan), np.where(enough, std, np.inf)


@dataclass(frozen=True)
class OrderPlace:
    """Signed distance of an order from the zero order as a quadratic over the image.

    ``std_px`` is its deviation in the middle of the image, noise included; ``share`` the part of the light in
    the peak with what noise makes of it; ``width_px`` the rms width of the peak.
    """

    coefficients: Floats
    std_px: float
    share: float
    share_std: float
    width_px: float

    def at(self, place: Floats) -> Floats:
        """Distance (px) at places (2, P) of the image, rows and columns 0..1."""
        return np.asarray(_terms(place) @ self.coefficients)


def find_order(graph: LineGraph, sign: int, reach_px: tuple[float, float]) -> OrderPlace | None:
    """The first order on one side of the zero order, or None where no peak stands out."""
    rough, half_px = (
        _fit(graph, sign, np.zeros(len(graph.amplitude)), reach_px),
        ORDER_HALF_PX * graph.widening,
    )
    for _ in range(REFINEMENTS):
        if rough is None:
            return None
        rough = _fit(graph, sign, rough.at(graph.pixels.place), (-half_px, half_px), rough)
    return rough


def find_second(graph: LineGraph, sign: int, first: OrderPlace | None) -> OrderPlace | None:
    """The second order, a multiple of the first's distance; where none stands out, where it would be."""
    if first is None:
        return None
    lined = first.at(graph.pixels.place)
    middle = float(np.median(np.abs(lined)))
    scale = middle / np.maximum(np.abs(lined), 1e-6)
    reach = (SECOND_PLACE[0] * middle, SECOND_PLACE[1] * middle)
    whole = np.zeros(len(lined), np.int64)
    half_px = SECOND_HALF_PX * graph.widening
    (peak,) = _peaks(graph, whole, 1, sign * graph.distance * scale, reach, half_px)
    times = float(np.mean(SECOND_PLACE)) if peak is None else peak.centre_px / middle
    coefficients, std_px = first.coefficients * times, first.std_px * times
    if peak is None:
        return OrderPlace(coefficients, std_px, 0.0, 0.0, np.nan)
    return OrderPlace(coefficients, std_px, peak.share, peak.share_std, peak.width_px)


def _terms(place: Floats) -> Floats:
    y, x = place[0] - 0.5, place[1] - 0.5
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1)


def _fit(
    graph: LineGraph,
    sign: int,
    centre: Floats,
    reach_px: tuple[float, float],
    before: OrderPlace | None = None,
) -> OrderPlace | None:
    """Peaks of all cells around a centre (P,), and the quadratic through them."""
    distance = sign * (graph.distance - centre)
    use = np.ones(len(centre), bool) if before is None else graph.holds(centre, INSIDE_PX * graph.widening)
    peaks, offsets, values, places = [], [], [], []
    cells = np.where(use, graph.pixels.cell, -1)
    found = _peaks(graph, cells, CELLS[0] * CELLS[1], distance, reach_px, ORDER_HALF_PX * graph.widening)
    for cell, peak in enumerate(found):
        if peak is not None:
            which = cells == cell
            peaks.append(peak)
            offsets.append(sign * peak.centre_px)
            values.append(offsets[-1] + float(centre[which].mean()))
            places.append(graph.pixels.place[:, which].mean(1))
    if not peaks:
        return None
    value, offset, place = np.array(values), np.array(offsets), np.array(places).T
    farthest_px = OUTLIER_PX * graph.widening * (3 if before is None else 1)
    near = np.abs(offset - np.median(offset)) < farthest_px
    terms = _terms(place[:, near])
    # Few cells carry a constant only; a little damping keeps a quadratic from bending where no cell is. Each
    # round fits the whole of it: a change to the rough one would keep what cells at the edge had bent.
    damping = np.diag([1e-9] + [(CELL_PX / TERM_PX) ** 2 if near.sum() > TERMS else 1e3] * (TERMS - 1))
    coefficients = np.linalg.solve(terms.T @ terms + damping, terms.T @ value[near])
    left = value[near] - terms @ coefficients
    share = float(np.median([peak.share for peak in peaks])) if before is None else before.share
    share_std = float(np.median([peak.share_std for peak in peaks])) / np.sqrt(len(peaks))
    share_std = share_std if before is None else before.share_std
    # Where few cells see the order, the middle of the image is far from them.
    middle = _terms(np.array([[0.5], [0.5]]))[0]
    lever = float(middle @ np.linalg.solve(terms.T @ terms + damping, middle))
    noise_px = float(np.median([peak.centre_std_px for peak in peaks]))
    std_px = float(np.sqrt((left**2).mean() + CELL_PX**2 + noise_px**2) * np.sqrt(lever))
    return OrderPlace(coefficients, std_px, share, share_std, float(np.median([p.width_px for p in peaks])))


@dataclass(frozen=True)
class _Peak:
    """The brightest peak of lined-up signals: centre and rms width (px), its share of the light."""

    centre_px: float
    centre_std_px: float
    share: float
    share_std: float
    width_px: float


def _peaks(
    graph: LineGraph,
    cell: Ints,
    cells: int,
    distance: Floats,
    reach_px: tuple[float, float],
    half_px: float,
) -> list[_Peak | None]:
    """The brightest peak of the pixels of each cell, by the number of it that each pixel (P,) has."""
    from dsl_core.calibration.orders.line_sums import histograms

    ends_px = reach_px[0] - half_px, reach_px[1] + half_px
    sums = histograms(graph.signal, graph.variance, graph.amplitude, distance, cell, cells, ends_px, BIN_PX)
    enough = np.bincount(cell[cell >= 0], minlength=cells) >= MIN_PIXELS
    return [_peak(mine, reach_px, half_px) if some else None for mine, some in zip(sums, enough, strict=True)]


def _peak(sums: Floats, reach_px: tuple[float, float], half_px: float) -> _Peak | None:
    """The brightest peak of light, noise and amplitude (3, bins) by distance; None for none."""
    light, noise, reference = sums
    low, bins = reach_px[0] - half_px, len(light)
    box = np.ones(SMOOTH_BINS)
    sums, spread, below = (np.convolve(values, box, "same") for values in (light, noise, reference))
    enough = below > 0.2 * below.max(initial=0)
    ratio = np.where(enough, sums / np.where(enough, below, 1), -np.inf)
    best = int(ratio.argmax())
    if not sums[best] > MIN_SIGMAS * np.sqrt(spread[best]) or ratio[best] < MIN_SHARE:
        return None
    known, below = enough & (reference > 0), np.where(reference > 0, reference, 1)
    density, spread = np.where(known, light / below, 0.0), np.where(known, noise / below**2, 0.0)
    at = low + (np.arange(bins) + 0.5) * BIN_PX
    centre = float(at[best])
    for _ in range(5):
        window = np.abs(at - centre) < half_px
        total = float(density[window].sum())
        if not total > 0:
            return None
        centre = float((density * at)[window].sum()) / total
    window = np.abs(at - centre) < half_px
    total = float(density[window].sum())
    if not (total > 0 and reach_px[0] <= centre <= reach_px[1]):
        return None
    width = float(np.sqrt(max((density * (at - centre) ** 2)[window].sum() / total, 0.0)))
    every = float(density.sum())
    return _Peak(
        centre,
        float(np.sqrt((spread * (at - centre) ** 2)[window].sum())) / total,
        total / every,
        abs(total / every**2) * float(np.sqrt(spread[~window].sum())),
        width,
    )
