"""What the twin's camera sees of a scene for any pattern: expected signal, without noise.

A pattern that consists of a few white lines is rendered from cumulative spectra: a line lights, through
each order, the wavelengths between its two edges, so each edge is one look-up. Any other pattern is
summed over spectral slices. Both use the same correspondence and response as the solver.
"""

from __future__ import annotations

import copy
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import (
    GratingModel,
    chebyshev_nodes,
    interpolation_matrix,
    like,
    zero_order,
)
from dsl_core.optics.light_path import zero_order_profile
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.pattern_table import PatternTable
from dsl_core.simulation.surface_light import surface_shading
from dsl_core.simulation.truth import Parts, SceneTruth

ORDERS = (1, -1, 2, -2)
THREADS = 2
NM = np.arange(400.0, 701.0)
#: Bands of white columns: start and stop (px), level 0..1.
Runs = list[tuple[float, float, float]]


class Slicing(NamedTuple):
    """Width of the spectral slices of patterns that are not lines, nm; wider where they also vary along rows.

    Slices whose signal is below the share ``floor`` of the strongest are left out.
    """

    nm: int
    rows_nm: int
    floor: float


#: A bandpass filter passes so few slices that they can be narrow.
BROAD, NARROW = Slicing(10, 25, 1e-3), Slicing(2, 5, 1e-5)
#: Patterns with more runs of lit columns than this are summed over slices; behind a filter, slices would blur
#: the narrow images of the lines.
MAX_RUNS, MAX_RUNS_FILTERED = 8, 64
#: Degree of the polynomial from column to wavelength; error below 0.01 nm over the film's range.
DEGREE = 6


@dataclass(frozen=True)
class OrderTables:
    """One order's geometry at every pixel that it can reach."""

    order: int
    active: Tensor  # (A,) indices into the renderer's pixels
    node_columns: Tensor  # (nodes, A)
    node_rows: Tensor  # (nodes, A)
    middle_px: Tensor  # (A,) column of the middle wavelength
    spread_px: Tensor  # (A,) scale of the columns in the inverse polynomial
    inverse: Tensor  # (DEGREE + 1, A): wavelength minus middle, as polynomial of scaled column
    limits_nm: tuple[Tensor, Tensor]  # wavelengths whose row lies inside the frame
    reach_px: tuple[Tensor, Tensor]  # smallest and largest column
    sigma_nm: float  # projector blur in wavelength
    cumulative: Tensor  # (materials * 3 * len(NM), 2): value and forward difference, all LEDs
    slices: dict[int, Tensor]  # slice width -> (slices, LEDs, materials * 3): response between slice edges


class Renderer:
    """Expected signal of one scene on one rig, in DN per ms above black.

    ``parts`` are what light comes from as `SceneTruth.parts` lists it, which is what they are if not given;
    ``orders`` those of the film beside the zero order.
    """

    def __init__(
        self,
        rig: Rig,
        truth: SceneTruth,
        *,
        film: bool = True,
        device: str = "cpu",
        orders: tuple[int, ...] = ORDERS,
        shaded: bool = True,
        parts: Parts | None = None,
    ) -> None:
        self.rig = self._bare = rig
        self.device = torch.device(device)
        self.shape = truth.depth_mm.shape
        pixel, material, share = truth.parts() if parts is None else parts
        self.pixels = self._tensor(pixel, torch.int64)
        depth = self._tensor(truth.depth_mm.ravel()[pixel])
        channel = bayer_channels(rig.sensor.bayer, *self.shape).ravel()[pixel]
        self.material_channel = self._tensor(material.astype(np.int64) * 3 + channel, torch.int64)
        self.shading = self._tensor(surface_shading(rig, truth, shaded).ravel()[pixel] * share)
        self.column, self.row = zero_order(rig, self.pixels, depth)
        w, h = rig.projector.width_px, rig.projector.height_px
        inside = (self.row > -0.5) & (self.row < h - 0.5) & (self.column > -1.5) & (self.column < w + 0.5)
        self.shading = self.shading * inside
        self._reflectance = truth.materials.at(NM)
        self.slicing = BROAD
        self.zero_table = self._zero_table()
        self.orders = [self._order(m, depth) for m in orders] if film else []
        halo = (
            rig.projector_response
            if film
            else rig.projector_response.model_copy(update={"halo_peak_per_px": 0.0})
        )
        self.response = halo
        self._white: Tensor | None = None
        self._colours: tuple[Renderer, ...] = ()

    def through(self, transmission: SpectralCurve | None) -> Renderer:
        """The same view through a filter before the camera (None: without); the geometry is shared."""
        other = copy.copy(self)
        other.rig, other.slicing, other._white, other._colours = self._bare, BROAD, None, ()
        if transmission is not None:
            passed = np.interp(NM, transmission.wavelengths_nm, transmission.values, 0.0, 0.0)
            # On the renderer's own grid, as the rig's may be too coarse for a narrow band.
            response = tuple(SpectralCurve.of(NM, curve.at(NM) * passed) for curve in self._bare.response)
            other.rig, other.slicing = self._bare.model_copy(update={"response": response}), NARROW
        other.zero_table = other._zero_table()
        other.orders = [replace(t, **other._spectra(t.order, t.sigma_nm)) for t in self.orders]
        return other

    def _zero_table(self) -> Tensor:
        """Zero-order signal of each LED, (LEDs, materials * 3)."""
        zero = (chain_response(self.rig, 0, NM)[None] * self._reflectance[:, None, None]).sum(-1)
        return self._tensor(np.moveaxis(zero, 2, 0).reshape(3, -1))

    def _spectra(self, order: int, sigma_nm: float) -> dict[str, Any]:
        """The parts of an order's tables that depend on spectra."""
        return {
            "cumulative": self._cumulative(order, sigma_nm),
            "slices": {step: self._slices(order, step) for step in self.slicing[:2]},
        }

    def _tensor(self, array: NDArray[Any], dtype: torch.dtype = torch.float32) -> Tensor:
        return torch.as_tensor(np.ascontiguousarray(array), device=self.device, dtype=dtype)

    def _order(self, order: int, depth: Tensor) -> OrderTables:
        nodes = chebyshev_nodes(NM[0], NM[-1])
        columns, rows = GratingModel(self.rig).exact(self.pixels, depth, order, nodes)
        w, h = self.rig.projector.width_px, self.rig.projector.height_px
        ends = like(interpolation_matrix(nodes, np.array([NM[0], NM.mean(), NM[-1]])), columns)
        at_ends, rows_at_ends = ends @ columns, ends @ rows
        low, high = at_ends[[0, 2]].amin(0), at_ends[[0, 2]].amax(0)
        active = torch.nonzero((high > -2) & (low < w + 1) & (self.shading > 0)).ravel()
        middle = at_ends[1, active]
        spread = 1.02 * torch.maximum(high[active] - middle, middle - low[active])
        limits = _row_limits(rows_at_ends[:, active], h)
        dispersion = float((high - low)[active].median()) / (NM[-1] - NM[0]) if len(active) else 1.0
        sigma_nm = self.rig.projector_response.blur_px / dispersion
        return OrderTables(
            order,
            active,
            columns[:, active],
            rows[:, active],
            middle,
            spread,
            self._inverse(nodes, columns[:, active], middle, spread),
            limits,
            (low[active], high[active]),
            sigma_nm,
            **self._spectra(order, sigma_nm),
        )

    def _inverse(self, nodes: NDArray[np.float64], columns: Tensor, middle: Tensor, spread: Tensor) -> Tensor:
        """Polynomial coefficients of wavelength over scaled column, by Newton's method at fixed columns."""
        offsets = chebyshev_nodes(-1.0, 1.0, DEGREE + 1)
        to_power = np.linalg.inv(np.vander((nodes - NM.mean()) / 150, len(nodes), increasing=True))
        forward = like(to_power, columns) @ columns
        target = middle + like(offsets, columns)[:, None] * spread
        t = (target - middle) / forward[1]
        for _ in range(4):
            value, derivative = _horner(forward, t)
            t = (t - (value - target) / derivative).clip(-1.3, 1.3)
        return like(np.linalg.inv(np.vander(offsets, DEGREE + 1, increasing=True)), columns) @ (150 * t)

    def _cumulative(self, order: int, sigma_nm: float) -> Tensor:
        """Blurred cumulative signal over wavelength and its difference, (materials * 3 * nm, 2)."""
        from scipy.ndimage import gaussian_filter1d

        density = chain_response(self.rig, order, NM).sum(1)[None] * self._reflectance[:, None]
        blurred = gaussian_filter1d(density, sigma_nm, axis=-1, mode="nearest")
        total = np.concatenate(
            [np.zeros((*blurred.shape[:2], 1)), np.cumsum((blurred[..., 1:] + blurred[..., :-1]) / 2, -1)], -1
        )
        difference = np.diff(total, axis=-1, append=total[..., -1:])
        return self._tensor(np.stack([total, difference], -1).reshape(-1, 2))

    def _slices(self, order: int, step: int) -> Tensor:
        """Signal between slice edges for each LED, (slices, LEDs, materials * 3)."""
        density = chain_response(self.rig, order, NM)[None] * self._reflectance[:, None, None]
        weight = np.ones(step + 1)
        weight[[0, -1]] = 0.5
        windows = (
            np.lib.stride_tricks.sliding_window_view(density, step + 1, axis=-1)[..., ::step, :] @ weight
        )
        return self._tensor(np.moveaxis(windows, [3, 2], [0, 1]).reshape(windows.shape[3], 3, -1))

    def expected(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Signal (rows, columns), DN per ms, of drive levels (height, width, 3) or (height, width)."""
        return self._picture(self._light(as_colour(image)))

    def planes(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Signal as a camera without a mosaic would see it, DN per ms, shape (3, rows, columns)."""
        if not self._colours:
            self._colours = tuple(self._of_colour(channel) for channel in range(3))
        light = self._light(as_colour(image))
        return np.stack([colour._picture(light) for colour in self._colours])

    def of_parts(self, image: NDArray[np.uint8]) -> Tensor:
        """Signal of every part, (parts,), DN per ms, of the same drive levels as `expected`."""
        return self._signal(self._light(as_colour(image)))

    def _of_colour(self, channel: int) -> Renderer:
        """The same view, every pixel of which sees one colour; the geometry is shared."""
        other = copy.copy(self)
        other.material_channel = self.material_channel.div(3, rounding_mode="floor") * 3 + channel
        other._white, other._colours = None, ()
        return other

    def _light(self, colour: NDArray[np.uint8]) -> Runs | PatternTable:
        """A few bands of white, or any other pattern as a table."""
        runs = _white_runs(colour)
        most = MAX_RUNS if self.slicing is BROAD else MAX_RUNS_FILTERED
        return self._table(colour) if runs is None or len(runs) > most else runs

    def _signal(self, light: Runs | PatternTable) -> Tensor:
        if isinstance(light, PatternTable):
            return (self._sliced(light) + self._black()) * self.shading
        return self._lines(light) * self.shading

    def _picture(self, light: Runs | PatternTable) -> NDArray[np.float32]:
        out = torch.zeros(self.shape[0] * self.shape[1], device=self.device)
        out.index_add_(0, self.pixels, self._signal(light))
        return out.reshape(self.shape).cpu().numpy()

    def _black(self) -> Tensor | float:
        """Light of a dark projector: its black level times the signal of white."""
        black = self.rig.projector_response.black_fraction
        if black == 0:
            return 0.0
        if self._white is None:
            h, w = self.rig.projector.height_px, self.rig.projector.width_px
            if self.slicing is BROAD:
                self._white = self._sliced(PatternTable.of(np.ones((h, w, 1)), self.response, self.device))
            else:
                self._white = torch.zeros_like(self.column)
                self._add_band(self._white, -0.5, w - 0.5, 1.0)
        return black * self._white

    def _lines(self, runs: Runs) -> Tensor:
        signal = torch.zeros_like(self.column) + self._black()
        response = self.rig.projector_response
        for start, stop, level in runs:
            self._add_band(signal, start, stop, float(response.radiance(level)) - response.black_fraction)
        return signal

    def _add_band(self, signal: Tensor, start: float, stop: float, radiance: float) -> None:
        """Add the light of white columns between two edges (px)."""
        zero = self.zero_table.sum(0)[self.material_channel]
        signal += radiance * zero * zero_order_profile(self.column, start, stop, self.response)
        for tables in self.orders:
            self._add_order(signal, tables, start, stop, radiance)

    def _add_order(
        self, signal: Tensor, tables: OrderTables, start: float, stop: float, radiance: float
    ) -> None:
        near = torch.nonzero((tables.reach_px[0] < stop + 2) & (tables.reach_px[1] > start - 2)).ravel()
        if len(near) == 0:
            return
        pixels = tables.active[near]
        table_row = self.material_channel[pixels] * len(NM)
        coefficients, middle = tables.inverse[:, near], tables.middle_px[near]
        low, high = tables.limits_nm[0][near], tables.limits_nm[1][near]
        scale = 1 / tables.spread_px[near]
        at_edge = []
        for edge in (start, stop):
            x = ((edge - middle) * scale).clip(-1, 1)
            value = coefficients[-1]
            for c in coefficients[:-1].flip(0):
                value = torch.addcmul(c, value, x)
            nm = torch.minimum(torch.maximum(value + float(NM.mean()), low), high) - float(NM[0])
            whole = nm.long()
            entry = tables.cumulative[table_row + whole]
            at_edge.append(entry[:, 0] + (nm - whole) * entry[:, 1])
        signal.index_add_(0, pixels, (at_edge[1] - at_edge[0]).abs() * radiance)

    def _table(self, colour: NDArray[np.uint8]) -> PatternTable:
        response = self.rig.projector_response
        radiance = response.radiance(np.arange(256) / 255)[colour] - response.black_fraction
        grey = np.array_equal(colour[..., 0], colour[..., 1]) and np.array_equal(
            colour[..., 0], colour[..., 2]
        )
        return PatternTable.of(radiance[..., :1] if grey else radiance, self.response, self.device)

    def _sliced(self, table: PatternTable) -> Tensor:
        leds = [slice(0, 3)] if table.leds == 1 else [slice(i, i + 1) for i in range(3)]
        signal = torch.zeros_like(self.column)
        tasks = []
        for led, of_led in enumerate(leds):
            zero = self.zero_table[of_led].sum(0)[self.material_channel]
            signal += zero * table.at(led, self.column, self.row)
            tasks += [(tables, table, led, of_led) for tables in self.orders if len(tables.active)]
        # Orders are independent, so each core takes its share of them.
        with ThreadPoolExecutor(THREADS) as pool:
            for (tables, *_), part in zip(
                tasks, pool.map(lambda t: self._sliced_order(*t), tasks), strict=True
            ):
                signal[tables.active] += part
        return signal

    def _sliced_order(self, tables: OrderTables, table: PatternTable, led: int, of_led: slice) -> Tensor:
        step = self.slicing.rows_nm if table.has_rows else self.slicing.nm
        weights = tables.slices[step][:, of_led].sum(1)
        nodes = chebyshev_nodes(NM[0], NM[-1])
        edges = np.arange(NM[0], NM[-1] + 1, step)
        centres = 0.5 * (edges[1:] + edges[:-1])
        to_edges = like(interpolation_matrix(nodes, edges), self.column)
        to_centres = like(interpolation_matrix(nodes, centres), self.column)
        material = self.material_channel[tables.active]
        total = torch.zeros(len(tables.active), device=self.device)
        strongest = weights.amax(1)
        used = torch.nonzero(strongest >= self.slicing.floor * strongest.max()).ravel().tolist()
        low, high = float(tables.limits_nm[0].max()), float(tables.limits_nm[1].min())
        stop, last = None, -2
        for i in used:
            start = stop if stop is not None and last == i - 1 else to_edges[i] @ tables.node_columns
            stop, last = to_edges[i + 1] @ tables.node_columns, i
            row = to_centres[i] @ tables.node_rows if table.has_rows else None
            mean = table.mean_between(led, start, stop, row)
            nm = float(centres[i])
            if not low <= nm <= high:
                mean *= (tables.limits_nm[0] <= nm) & (tables.limits_nm[1] >= nm)
            total.addcmul_(mean, weights[i][material])
        return total


def as_colour(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Drive levels (height, width, 3) of an image that may be grey."""
    return image if image.ndim == 3 else np.repeat(image[..., None], 3, 2)


def _horner(coefficients: Tensor, t: Tensor) -> tuple[Tensor, Tensor]:
    """Value and derivative of a polynomial with rising coefficients."""
    value, derivative = coefficients[-1].expand_as(t), torch.zeros_like(t)
    for c in coefficients[:-1].flip(0):
        derivative = derivative * t + value
        value = value * t + c
    return value, derivative


def _row_limits(rows: Tensor, height: int) -> tuple[Tensor, Tensor]:
    """Wavelengths whose row lies inside the frame, from rows at the first, middle and last wavelength."""
    first, last = rows[0], rows[2]
    slope = (last - first) / float(NM[-1] - NM[0])
    slope = torch.where(slope.abs() < 1e-6, torch.full_like(slope, 1e-6), slope)
    top = (-0.5 - first) / slope + float(NM[0])
    bottom = (height - 0.5 - first) / slope + float(NM[0])
    low = torch.minimum(top, bottom).clip(float(NM[0]), float(NM[-1]))
    high = torch.maximum(top, bottom).clip(float(NM[0]), float(NM[-1]))
    return low, high


def _white_runs(colour: NDArray[np.uint8]) -> Runs | None:
    """Lit bands of a grey, column-only image as (start px, stop px, level 0..1); None for other images."""
    line = colour[0]
    if not ((line == line[:, :1]).all() and (colour == line).all()):
        return None
    levels = line[:, 0].astype(int)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], levels, [0]])))
    return [(a - 0.5, b - 0.5, levels[a] / 255) for a, b in pairwise(edges) if levels[a]]
