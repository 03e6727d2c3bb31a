"""How much light each diffraction order takes from scan lines seen through a bandpass filter.

The lines tile the projector's frame, so that what a pixel sees of an order, summed over the lines, is that
order's light whatever the spectrum, the blur or the place. Where an order is, is found without knowing the
film: in each cell of the image, signals are lined up by their distance from the zero order's column and added
up, and the first orders stand out as peaks on either side.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.orders.order_place import (
    CELLS,
    MIN_PIXELS,
    ORDER_HALF_PX,
    SECOND_HALF_PX,
    ZERO_HALF_PX,
    LineGraph,
    OrderPlace,
    PlanePixels,
    by_cell,
    cell_means,
    find_order,
    find_second,
    line_graph,
    of_colours,
)
from dsl_core.calibration.orders.steady_light import LightJump, light_jump
from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import ProjectorResponse

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class OrderLight:
    """Light of one order relative to the zero order.

    ``ratio`` and ``std`` are those of the three colours (NaN, infinite: not seen). ``offset_px`` is the
    distance of the peak from the zero order in the middle of the image, with its deviation (NaN: not found);
    ``share`` how much of all light where first orders may be is in the peak, with its deviation; ``width_px``
    its rms width. ``cells`` is how much each cell of the image contributes.
    """

    order: int
    ratio: Floats
    std: Floats
    offset_px: float
    offset_std_px: float
    share: float
    width_px: float
    pixels: int
    share_std: float = 0.0
    cells: Floats = field(default_factory=lambda: np.zeros(CELLS[0] * CELLS[1]))


def _unseen() -> Floats:
    return np.full((3, CELLS[0] * CELLS[1]), np.nan)


@dataclass(frozen=True)
class FilterLight:
    """What one filter passes: ``zero`` (3,) zero-order signal at unit shading, DN per ms, and its deviation.

    ``shift_px`` is how far the zero order moved against the capture without filter, and its deviation;
    ``saturated`` the share of pixels whose zero order is saturated. ``cells`` (3, cells) is the zero order in
    each cell of the image, NaN where it was not seen, with its deviation. ``jump`` is a change of the light
    while lines passed over the target, None for none.
    """

    zero: Floats
    zero_std: Floats
    orders: dict[int, OrderLight]
    shift_px: tuple[float, float]
    saturated: float
    cells: Floats = field(default_factory=_unseen)
    cells_std: Floats = field(default_factory=_unseen)
    jump: LightJump | None = None


def filter_light(
    lines: ScanLines,
    pixels: PlanePixels,
    radiance: NDArray[np.floating],
    std: NDArray[np.floating],
    response: ProjectorResponse,
    reach_px: tuple[float, float],
    unlit_px: tuple[float, float],
    frame_px: int,
    widening: float = 1.0,
) -> FilterLight:
    """Measure one filter from ``radiance`` and ``std`` (frames, P), DN per ms; infinite where saturated.

    ``reach_px`` are the smallest and largest distance from the zero order at which a first order may be,
    whatever the filter, and ``unlit_px`` those between which none does; ``frame_px`` is the projector's
    width, and ``widening`` how many times more columns orders take than windows are stated for.
    """
    centres = (lines.width_px - 1) / 2 + lines.step_px * np.arange(len(radiance))
    saturated = ~np.isfinite(std).all(0)
    inside = (pixels.column_px > ZERO_HALF_PX) & (pixels.column_px < frame_px - 1 - ZERO_HALF_PX)
    use = inside & ~saturated
    chosen = pixels.at(use)
    signal, error = radiance[:, use].astype(float), std[:, use].astype(float)
    graph, shift = line_graph(
        lines,
        chosen,
        signal,
        error,
        centres[:, None] - chosen.column_px,
        response,
        unlit_px,
        frame_px,
        widening,
    )
    relative, everywhere = graph.amplitude / chosen.shading, np.ones(len(graph.amplitude), bool)
    zero, zero_std = of_colours(chosen, relative, everywhere, np.mean)
    orders: dict[int, OrderLight] = {}
    for sign in (1, -1):
        first = find_order(graph, sign, reach_px)
        orders[sign] = _light(graph, sign, first, ORDER_HALF_PX * widening)
        orders[2 * sign] = _light(graph, 2 * sign, find_second(graph, sign, first), SECOND_HALF_PX * widening)
    share = float(saturated[inside].mean()) if inside.any() else 1.0
    bright = chosen.colour == int(np.nanargmax(np.where(np.isfinite(zero), zero, -np.inf)))
    jump = light_jump(chosen.column_px[bright], relative[bright], frame_px)
    return FilterLight(zero, zero_std, orders, shift, share, *cell_means(chosen, relative), jump)


def _light(graph: LineGraph, order: int, place: OrderPlace | None, half_px: float) -> OrderLight:
    """Sum an order's light around its place, over pixels whose window is inside the frame."""
    from dsl_core.calibration.orders.line_sums import window_sums

    ratio, spread = np.full(3, np.nan), np.full(3, np.inf)
    if place is None:
        return OrderLight(order, ratio, spread, np.nan, np.inf, 0.0, np.nan, 0)
    centre = place.at(graph.pixels.place)
    use = graph.holds(centre, half_px)
    use &= graph.pixels.whole.get(order, np.ones(len(use), bool))
    light, variance = window_sums(graph.signal, graph.variance, graph.distance, centre, half_px)
    for colour in range(3):
        mine = use & (graph.pixels.colour == colour)
        total = float(graph.amplitude[mine].sum())
        if mine.sum() < MIN_PIXELS or not total > 0:
            continue
        ratio[colour] = float(light[mine].sum()) / total
        noise = float(np.sqrt(variance[mine].sum())) / total
        cells = [which for which in by_cell(graph.pixels, mine) if which.sum() >= MIN_PIXELS]
        apart = [float(light[which].sum() / graph.amplitude[which].sum()) for which in cells]
        scatter = float(np.std(apart) / np.sqrt(len(apart) - 1)) if len(apart) > 2 else 0.0
        spread[colour] = max(noise, scatter)
    middle = float(place.at(np.array([[0.5], [0.5]]))[0])
    return OrderLight(
        order,
        ratio,
        spread,
        middle,
        place.std_px,
        place.share,
        place.width_px,
        int(use.sum()),
        place.share_std,
        np.bincount(graph.pixels.cell[use], graph.amplitude[use], graph.pixels.cells).astype(float),
    )
