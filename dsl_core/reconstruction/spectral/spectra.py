"""Reflectance of every pixel from the line frames, tile by tile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import Reach
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import Correspondence, Footprint, like
from dsl_core.optics.demosaic import demosaic, demosaic_variance
from dsl_core.optics.image_formation import BlurredProfiles
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction.columns.column import halo_of_line
from dsl_core.reconstruction.columns.pattern_column import one_if_grey, radiance_profiles, rounding_error
from dsl_core.reconstruction.line_set import LineSet
from dsl_core.reconstruction.spectral.solver import Prior, Spectra, solve_spectra
from dsl_core.reconstruction.spectral.system import (
    ORDERS,
    BandedAccumulator,
    Bands,
    dense_equations,
    direct_light,
)
from dsl_core.solve.banded import multiply
from dsl_core.solve.many import Check, work_through

#: Pixels of a tile of up to `TILE_BANDS` bands, and of the smallest; even numbers keep the Bayer phase.
TILE, TILE_BANDS, LEAST_TILE = (64, 96), 60, (16, 24)
#: Pixels whose full matrices are solved at a time.
DENSE_PIXELS = 512
#: Relative error of the linear model (correspondence, profile, interpolation), added to each variance.
MODEL_ERROR = 0.01
#: Relative error granted to the zero-order colour as a constraint on the spectrum.
COLOUR_ERROR = 0.02
#: Degrees of freedom that a spectrum takes from its data, roughly, in the reduced chi-square.
PARAMETERS = 25
#: Bands whose centre lies this far outside the projector's frame still belong to the model, px.
EDGE_PX = 8.0
#: Relative error of the zero order in frames that light a pixel by several orders at once.
DIRECT_ERROR = 0.05
#: Mean squared offset (camera px) of the samples that bilinear demosaicing averages.
DEMOSAIC_SPREAD = 0.4


@dataclass(frozen=True)
class Pixels:
    """What is known of every pixel before its spectrum: arrays of shape (rows, columns).

    ``amplitude`` and ``amplitude_std`` (DN per ms) are those of the zero order in the pixel's own colour,
    ``offset`` the residual dark signal and ``offset_std`` how far all frames may be off it; ``valid`` pixels
    get a spectrum.
    """

    column_px: NDArray[np.float32]
    depth_mm: NDArray[np.float32]
    shading: NDArray[np.float32]
    shading_rel_std: NDArray[np.float32]
    amplitude: NDArray[np.float32]
    amplitude_std: NDArray[np.float32]
    offset: NDArray[np.float32]
    offset_std: NDArray[np.float32]
    valid: NDArray[np.bool_]


@dataclass(frozen=True)
class SpectralMaps:
    """Cubes (bands, rows, columns) of the reported bands, and maps (rows, columns); NaN where invalid."""

    reflectance: NDArray[np.float32]
    std: NDArray[np.float32]
    data_share: NDArray[np.float32]
    reach: NDArray[np.uint8]
    at_bound: NDArray[np.bool_]
    chi_square: NDArray[np.float32]

    @classmethod
    def empty(cls, bands: int, shape: tuple[int, int]) -> SpectralMaps:
        """Maps full of NaN, to be filled by tiles."""
        cube = (bands, *shape)
        return cls(
            reflectance=np.full(cube, np.nan, np.float32),
            std=np.full(cube, np.nan, np.float32),
            data_share=np.full(cube, np.nan, np.float32),
            reach=np.zeros(cube, np.uint8),
            at_bound=np.zeros(shape, bool),
            chi_square=np.zeros(shape, np.float32),
        )


class SpectralReconstruction:
    """One scan's spectra, from stacks of radiance and deviation (frames, rows, columns) and known pixels."""

    def __init__(
        self,
        rig: Rig,
        plan: CapturePlan,
        grid: WavelengthGrid,
        model: Correspondence,
        radiance: NDArray[np.float32],
        std: NDArray[np.floating],
        pixels: Pixels,
        *,
        prior: Prior | None = None,
        device: str = "cpu",
        dtype: torch.dtype = torch.float32,
    ) -> None:
        self.rig, self.plan, self.model, self.pixels = rig, plan, model, pixels
        self.bands = Bands.of(rig, grid)
        self.radiance, self.std = radiance, std
        self.lines = LineSet.of(plan)
        self.prior = prior or Prior().at_step(grid.step_nm)
        self.device, self.dtype = torch.device(device), dtype
        self.colour_weight = self._colour_weight()

    def run(self, progress: Progress | None = None, threads: int = 2) -> SpectralMaps:
        """Solve all tiles; single-threaded kernels in a few threads keep every core and its cache busy."""
        progress = progress or NoProgress()
        out = SpectralMaps.empty(
            self.bands.reported.stop - self.bands.reported.start, self.pixels.valid.shape
        )
        tiles = list(self._tiles())
        before = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            work_through(
                lambda tile, check: self._tile(*tile, out, check), tiles, threads, "spectra", progress
            )
        finally:
            torch.set_num_threads(before)
        return out

    def _tiles(self) -> Iterator[tuple[slice, slice]]:
        height, width = self.pixels.valid.shape
        rows, columns = tile_shape(self.bands.count)
        for y in range(0, height, rows):
            for x in range(0, width, columns):
                yield slice(y, min(y + rows, height)), slice(x, min(x + columns, width))

    def _colour_weight(self) -> NDArray[np.float32]:
        """Weight of the zero-order colour: one minus the blurred mask of complete pixels (seed 7.1)."""
        import cv2

        valid = np.flatnonzero(self.pixels.valid)
        complete = np.ones(self.pixels.valid.shape, np.float32)
        if valid.size:
            nm = self.bands.centres_nm[self.bands.reported][[0, -1]]
            reached = torch.zeros((2, valid.size), dtype=torch.bool)
            for order in ORDERS:
                reached |= self._footprint(order, valid, nm).inside(*self.plan.projector_size_px).cpu()
            complete.ravel()[valid] = reached.all(0).numpy()
        sigma = max(self.rig.camera.width_px / 90, 1.0)
        return np.asarray(1 - cv2.GaussianBlur(complete, (0, 0), sigma), np.float32).clip(0, 1)

    def _footprint(self, order: int, flat: NDArray[np.intp], nm: NDArray[np.float64]) -> Footprint:
        """Where the light of an order that reaches pixels comes from."""
        index = torch.as_tensor(flat, device=self.device)
        depth = torch.as_tensor(self.pixels.depth_mm.ravel()[flat], device=self.device, dtype=self.dtype)
        return self.model.trace(index, depth, order, nm)

    @torch.inference_mode()
    def _tile(self, rows: slice, columns: slice, out: SpectralMaps, check: Check) -> None:
        valid = self.pixels.valid[rows, columns]
        if not valid.any():
            return
        inside_tile = np.flatnonzero(valid)
        y, x = np.divmod(inside_tile, valid.shape[1])
        flat = (y + rows.start) * self.pixels.valid.shape[1] + x + columns.start
        orders = ORDERS if self._is_banded else self.bands.orders
        traced = {order: self._footprint(order, flat, self.bands.centroids_nm[order]) for order in orders}
        window = _Window(self, rows, columns, inside_tile)
        check()
        spectra, misfit = (self._banded if self._is_banded else self._dense)(flat, traced, window, check)
        self._store(spectra, misfit, flat, traced, out)

    @property
    def _is_banded(self) -> bool:
        return self.lines is not None and self.lines.frames == self.lines.lines

    def _banded(
        self, flat: NDArray[np.intp], traced: dict[int, Footprint], window: _Window, check: Check
    ) -> tuple[Spectra, Tensor]:
        assert self.lines is not None
        shading = self._map(self.pixels.shading, flat)
        offset_variance = window.offset_variance()
        unsure = bool(offset_variance.any())
        system = BandedAccumulator(self.rig, self.bands, self.lines, len(flat), shading, unsure)
        blur = window.blur_px()
        for order, footprint in traced.items():
            # A band just outside the frame still catches the outermost lines.
            inside = footprint.inside(*self.plan.projector_size_px, margin_px=EDGE_PX)
            frames = system.frames(footprint, inside)
            if frames:
                check()
                radiance, weight = window.colours(frames, self.lines)
                system.add(order, footprint.columns, inside, radiance, weight, frames.start, blur)
        right = system.right * shading
        rows = self._colour_rows(flat, shading, window, right)
        check()
        matrix = system.positive_matrix() * shading**2
        spectra = solve_spectra(matrix, right, rows, self.prior, check)
        if system.offset is not None:
            spectra = with_offset(spectra, matrix, system.offset * shading, offset_variance, self.prior)
        radiance = spectra.nodes * shading
        explained = (radiance * (2 * system.right - multiply(system.matrix, radiance))).sum(0)
        return spectra, (system.square - explained) / (system.samples - PARAMETERS).clip(min=1)

    def _colour_rows(
        self, flat: NDArray[np.intp], shading: Tensor, window: _Window, right: Tensor
    ) -> Tensor | None:
        """Weighted zero-order equations (bands, 3, pixels), added to ``right``; None if unneeded."""
        kappa = self._map(self.colour_weight, flat)
        if float(kappa.max()) < 1e-3:
            return None
        colour, variance = window.zero_order_colour()
        root = (kappa / (variance + (COLOUR_ERROR * colour) ** 2)).sqrt()
        moments = like(self.bands.moments[0].sum(1).T, right)
        rows = moments[:, :, None] * (root * shading)
        right += torch.einsum("jcp,cp->jp", rows, colour * root)
        return rows

    def _dense(
        self, flat: NDArray[np.intp], traced: dict[int, Footprint], window: _Window, check: Check
    ) -> tuple[Spectra, Tensor]:
        response = self.rig.projector_response
        profiles = radiance_profiles(self.rig, self.plan)
        shading = self._map(self.pixels.shading, flat)
        column = self._map(self.pixels.column_px, flat)
        radiance, weight = window.colours(range(len(self.radiance)), None)
        colour, _ = window.zero_order_colour()
        # Demosaicing averages neighbours, which widens every line a little more.
        blur = float(np.hypot(response.blur_px, window.blur_px()))
        response = response.model_copy(update={"blur_px": blur})
        light = BlurredProfiles(response, one_if_grey(profiles), 0.0, column)
        direct = direct_light(light, self.bands, column, colour)
        error = max(DIRECT_ERROR, rounding_error(self.rig, self.plan))
        weight = 1 / (1 / weight + (error * direct) ** 2)
        width, height = self.plan.projector_size_px
        inside = {order: f.inside(width, height, margin_px=EDGE_PX) for order, f in traced.items()}
        samples = (weight > 0).sum((0, 1))
        offset_variance = window.offset_variance()
        found, misfit = [], []
        # Full matrices take long: a part of the pixels at a time, so that a cancel need not wait.
        for start in range(0, len(flat), DENSE_PIXELS):
            part = slice(start, start + DENSE_PIXELS)
            check()
            spectra, left = self._dense_part(
                response,
                profiles,
                shading[part],
                column[part],
                {order: Footprint(f.columns[:, part], f.rows[:, part]) for order, f in traced.items()},
                {order: mask[:, part] for order, mask in inside.items()},
                (radiance[..., part], weight[..., part], offset_variance[:, part]),
            )
            found.append(spectra)
            misfit.append(left / (samples[part] - PARAMETERS).clip(min=1))
        return _joined(found), torch.cat(misfit)

    def _dense_part(
        self,
        response: ProjectorResponse,
        profiles: NDArray[np.float64],
        shading: Tensor,
        column: Tensor,
        traced: dict[int, Footprint],
        inside: dict[int, Tensor],
        seen: tuple[Tensor, Tensor, Tensor],
    ) -> tuple[Spectra, Tensor]:
        """Spectra of some pixels, and the weighted squares they leave.

        ``seen`` is radiance, weight, and the variance of an offset that all frames share.
        """
        from dsl_core.reconstruction.spectral.dense_solver import solve_dense

        matrix, right, square = dense_equations(response, self.bands, profiles, column, traced, inside, *seen)
        spectra = solve_dense(matrix * (shading**2)[:, None, None], right * shading[:, None], self.prior)
        radiance = (spectra.nodes * shading).T
        explained = (radiance * (2 * right - (matrix @ radiance[..., None])[..., 0])).sum(1)
        return spectra, square - explained

    def _map(self, values: NDArray[np.float32], flat: NDArray[np.intp]) -> Tensor:
        return torch.as_tensor(values.ravel()[flat], device=self.device, dtype=self.dtype)

    def _store(
        self,
        spectra: Spectra,
        misfit: Tensor,
        flat: NDArray[np.intp],
        traced: dict[int, Footprint],
        out: SpectralMaps,
    ) -> None:
        reported = self.bands.reported
        mean = spectra.mean[reported]
        relative = self._map(self.pixels.shading_rel_std, flat).nan_to_num(nan=0.0)
        # What the model cannot explain makes the answer that much less certain (Birge ratio).
        std = torch.hypot(spectra.std[reported] * misfit.clip(min=1).sqrt(), mean * relative)
        for cube, values in (
            (out.reflectance, mean),
            (out.std, std),
            (out.data_share, spectra.data_share[reported]),
        ):
            cube.reshape(len(cube), -1)[:, flat] = values.float().cpu().numpy()
        bits = {1: Reach.PLUS_ONE, -1: Reach.MINUS_ONE}
        reach = torch.zeros_like(mean, dtype=torch.uint8)
        for order, bit in bits.items():
            inside = traced[order].inside(*self.plan.projector_size_px)
            reach |= inside[reported].to(torch.uint8) * int(bit)
        reach[reach == 0] = int(Reach.ZERO_ONLY)
        out.reach.reshape(len(out.reach), -1)[:, flat] = reach.cpu().numpy()
        out.chi_square.reshape(-1)[flat] = misfit.float().cpu().numpy()
        out.at_bound.reshape(-1)[flat] = spectra.at_bound[reported].any(0).cpu().numpy()


def with_offset(spectra: Spectra, matrix: Tensor, offset: Tensor, variance: Tensor, prior: Prior) -> Spectra:
    """Spectra less sure by an offset of all frames with a variance (3, pixels).

    An offset with the right side ``offset`` (3, bands, pixels) looks like a grey that gives the same.
    """
    grey = multiply(matrix, torch.ones_like(spectra.std)) + prior.level_std**-2
    change = (variance[:, None] * (offset / grey) ** 2).sum(0).sqrt()
    return replace(spectra, std=torch.hypot(spectra.std, change))


def tile_shape(bands: int) -> tuple[int, int]:
    """Rows and columns of a tile: the equations of a pixel grow as the square of the bands."""
    share = min(TILE_BANDS / bands, 1.0)
    rows, columns = (
        max(2 * int(side * share / 2), least) for side, least in zip(TILE, LEAST_TILE, strict=True)
    )
    return min(rows, TILE[0]), min(columns, TILE[1])


def _joined(parts: list[Spectra]) -> Spectra:
    """Spectra of some pixels after the other."""
    maps = ([getattr(part, field.name) for part in parts] for field in fields(Spectra))
    return Spectra(*(torch.cat(each, -1) for each in maps))


class _Window:
    """The frames of one tile with the neighbours that demosaicing needs."""

    def __init__(
        self, owner: SpectralReconstruction, rows: slice, columns: slice, inside: NDArray[np.intp]
    ) -> None:
        self.owner = owner
        height, width = owner.pixels.valid.shape
        self.rows = slice(max(rows.start - 2, 0), min(rows.stop + 2, height))
        self.columns = slice(max(columns.start - 2, 0), min(columns.stop + 2, width))
        y, x = np.divmod(inside, columns.stop - columns.start)
        w = self.columns.stop - self.columns.start
        at = (y + rows.start - self.rows.start) * w + x + columns.start - self.columns.start
        self.at = torch.as_tensor(at, device=owner.device)

    def _part(self, values: NDArray[np.floating]) -> Tensor:
        block = np.ascontiguousarray(values[..., self.rows, self.columns])
        return torch.as_tensor(block, device=self.owner.device).to(self.owner.dtype)

    def _colours(self, mosaic: Tensor) -> Tensor:
        return demosaic(mosaic, self.owner.rig.sensor.bayer)

    def blur_px(self) -> float:
        """Spread of the projector columns that demosaicing averages, px."""
        column = self.owner.pixels.column_px[self.rows, self.columns]
        change = np.abs(np.diff(column, axis=1))
        finite = change[np.isfinite(change)]
        return float(np.sqrt(DEMOSAIC_SPREAD) * np.median(finite)) if finite.size else 0.0

    def colours(self, frames: range, lines: LineSet | None) -> tuple[Tensor, Tensor]:
        """Radiance without halo and offset, and weight, of a range of frames, each (3, frames, pixels)."""
        part = slice(frames.start, frames.stop)
        y = self._part(self.owner.radiance[part])
        variance = self._part(self.owner.std[part]) ** 2
        pixels = self.owner.pixels
        y = y - self._part(pixels.offset)
        if lines is not None:
            index = torch.arange(frames.start, frames.stop, device=y.device)[:, None, None]
            distance = self._part(pixels.column_px) - lines.centre_px(index).to(y.dtype)
            y = y - self._part(pixels.amplitude) * halo_of_line(
                distance, lines, self.owner.rig.projector_response
            )
        bayer = self.owner.rig.sensor.bayer
        rgb = self._pick(demosaic(y, bayer))
        spread = self._pick(demosaic_variance(variance, bayer))
        weight = spread.addcmul_(rgb, rgb, value=MODEL_ERROR**2).reciprocal_()
        # An infinite variance has weight zero by itself; what is no number must not survive the product.
        return torch.nan_to_num_(rgb, 0.0, 0.0, 0.0), torch.nan_to_num_(weight, 0.0, 0.0, 0.0)

    def _pick(self, images: Tensor) -> Tensor:
        """The tile's pixels of colour images (frames, 3, rows, columns), as (3, frames, pixels)."""
        count = len(images)
        flat = images.reshape(count * 3, -1).index_select(1, self.at)
        return flat.reshape(count, 3, -1).permute(1, 0, 2).contiguous()

    def offset_variance(self) -> Tensor:
        """Variance of what all frames may be off in three colours, (3, pixels)."""
        bayer = self.owner.rig.sensor.bayer
        variance = demosaic_variance(self._part(self.owner.pixels.offset_std) ** 2, bayer)
        return variance.reshape(3, -1)[:, self.at]

    def zero_order_colour(self) -> tuple[Tensor, Tensor]:
        """Zero-order amplitude in three colours and its variance, each (3, pixels)."""
        pixels, bayer = self.owner.pixels, self.owner.rig.sensor.bayer
        colour = demosaic(self._part(pixels.amplitude), bayer).reshape(3, -1)[:, self.at]
        variance = demosaic_variance(self._part(pixels.amplitude_std) ** 2, bayer).reshape(3, -1)[:, self.at]
        return colour, variance
