"""Reflectance of every pixel from the line frames, tile by tile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import Reach
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import Correspondence, Footprint, like
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.pixel_model import COLOUR_ERROR, DIRECT_ERROR, PixelModel, Traced
from dsl_core.optics.spectra import ORDERS, Bands
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction.calibration_age import doubt_of_changed
from dsl_core.reconstruction.columns.pattern_column import radiance_profiles, rounding_error
from dsl_core.reconstruction.spectral.causes import common_error, fit_causes
from dsl_core.reconstruction.spectral.model_error import ModelError, model_error, neighbour_contrast
from dsl_core.reconstruction.spectral.probing.picked_cube import PickedCube
from dsl_core.reconstruction.spectral.probing.probed_light import ProbedScan
from dsl_core.reconstruction.spectral.self_correction import Followed, follow
from dsl_core.reconstruction.spectral.solving.compiled_tiles import CompiledTiles
from dsl_core.reconstruction.spectral.solving.dense_tiles import DenseTiles
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solution import Spectra
from dsl_core.reconstruction.spectral.solving.tensor_tiles import TensorTiles
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels, TileFrames
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps, put_pixels
from dsl_core.solve.many import Check, work_through
from dsl_core.solve.threads import one_kernel_thread

#: Pixels of a tile of up to `TILE_BANDS` bands, and of the smallest; even numbers keep the Bayer phase.
TILE, TILE_BANDS, LEAST_TILE = (64, 96), 60, (16, 24)
#: Relative error of the light of bands in combs, whose frames do not tell a change of a LED's light, or of
#: the film's place, that is too small to be named.
COMB_LIGHT = 0.03
#: Rows of a tile whose full matrices are in memory at once, as tensors.
DENSE_ROWS = 16
#: Pixels whose light is traced at a time, where all are.
CHUNK = 1 << 18
#: Chi-square that noise alone does not reach: what exceeds it is misfit that neighbouring lines share.
SURE_MISFIT = 1.3
#: Chi-square from which a pixel may see several surfaces, and the most that it is then unsure by.
MIXED_MISFIT, MIXED_STD = 3.0, 0.5
#: Relative error of a level that ends at the upper bound.
BOUND_SHARE = 0.5


def model_of_plan(
    rig: Rig, plan: CapturePlan, grid: WavelengthGrid, correspondence: Correspondence
) -> PixelModel:
    """What pixels receive from the frames of a plan's spectral patterns."""
    profiles = radiance_profiles(rig, plan)
    return PixelModel(rig, Bands.of(rig, grid), profiles, correspondence, LineSet.of(plan))


def zero_order_error(rig: Rig, plan: CapturePlan) -> float:
    """Relative error granted to the zero order in frames that light a pixel by several orders at once."""
    # Lines are either dark or fully lit, which no rounding of drive levels changes.
    return DIRECT_ERROR if LineSet.of(plan) is not None else max(DIRECT_ERROR, rounding_error(rig, plan))


class SpectralReconstruction:
    """One scan's spectra, from stacks of radiance and deviation (frames, rows, columns) and known pixels."""

    def __init__(
        self,
        rig: Rig,
        plan: CapturePlan,
        grid: WavelengthGrid,
        model: Correspondence,
        radiance: NDArray[np.float32] | PickedCube,
        std: NDArray[np.floating] | PickedCube,
        pixels: Pixels,
        *,
        prior: Prior | None = None,
        device: str = "cpu",
        dtype: torch.dtype = torch.float32,
        as_calibrated: bool = False,
        rows_px: float | None = None,
        colour_changed: float = 0.0,
    ) -> None:
        """With ``as_calibrated`` the model stays as it is, whatever the scan itself says.

        ``rows_px`` is by how much (rms) the rows of a code disagree with depth, None where it has none.
        ``colour_changed`` is how far (log) a colour of the light has come from all light since the beginning.
        Where frames come by rows, ``radiance`` and ``std`` are those of the pixels that `learn` asks.
        """
        self.rig, self.pixels = rig, pixels
        self.model = model_of_plan(rig, plan, grid, model)
        self.bands = self.model.bands
        self.radiance, self.std = radiance, std
        self.prior = prior or Prior().at_step(grid.step_nm)
        self.device, self.dtype = torch.device(device), dtype
        self.colour_weight = self._colour_weight()
        self.contrast = neighbour_contrast(pixels.amplitude)
        self.followed: Followed | None = None
        self.error: ModelError | None = None
        #: Relative deviation of the light's level where the scan shows that the rig has changed.
        self._unsure_level = 0.0
        usual = self.device.type == "cpu" and dtype == torch.float32
        #: Tensors are for a GPU, and for other precisions.
        self._lines = CompiledTiles(self.prior) if usual and self.model.single else None
        direct_error = zero_order_error(rig, plan)
        self._dense = DenseTiles(self.prior, direct_error) if usual and not self.model.single else None
        self._tensors = TensorTiles(self.prior, direct_error)
        self._as_calibrated, self._rows_px, self._colour_changed = as_calibrated, rows_px, colour_changed
        #: The row of the picture that the stacks begin with.
        self._first_row = 0

    def run(
        self,
        progress: Progress | None = None,
        threads: int = 2,
        part: tuple[slice, slice] = (slice(None), slice(None)),
    ) -> SpectralMaps:
        """Learn, and solve all rows.

        Where only a ``part`` (rows, columns) of the picture is wanted, tiles outside it stay NaN.
        """
        self.learn()
        found = self.solve(slice(0, self.pixels.valid.shape[0]), progress, threads, part)
        return replace(found, followed=self.followed, error=self.error)

    def learn(self) -> None:
        """Have the model follow what the scan says of it, and know how wrong it still is."""
        with one_kernel_thread():
            self.followed = found = follow(
                self.probed, self._as_calibrated, self._rows_px, self._colour_changed
            )
            if found is not None:
                self.model, self.bands = found.model, found.model.bands
                common = common_error(found.left, fit_causes(found.left))
                combs = self.model.lines is not None and not self.model.single
                self.error = model_error(found.left, float(np.hypot(common, COMB_LIGHT if combs else 0.0)))
                by_pose = 0.0 if found.turn is None else found.turn.level_rel_std
                by_light = doubt_of_changed(self.rig) if found.has_changed else 0.0
                self._unsure_level = float(np.hypot(by_light, by_pose))

    def take(
        self,
        radiance: NDArray[np.float32] | PickedCube,
        std: NDArray[np.floating] | PickedCube,
        first_row: int,
    ) -> None:
        """From now on work on stacks that begin with a row of the picture."""
        self.radiance, self.std, self._first_row = radiance, std, first_row

    def solve(
        self,
        rows: slice,
        progress: Progress | None = None,
        threads: int = 2,
        part: tuple[slice, slice] = (slice(None), slice(None)),
    ) -> SpectralMaps:
        """Maps of some rows, tile by tile; their stacks must hold them and those next to them.

        Single-threaded kernels in a few threads keep every core and its cache busy.
        """
        shape = rows.stop - rows.start, self.pixels.valid.shape[1]
        out = SpectralMaps.empty(self.bands.reported.stop - self.bands.reported.start, shape)
        with one_kernel_thread():
            work_through(
                lambda tile, check: self._tile(*tile, out, rows.start, check),
                [tile for tile in self._tiles(rows) if _wanted(tile, part, self.pixels.valid.shape)],
                threads,
                "spectra",
                progress or NoProgress(),
            )
        return out

    @property
    def probed(self) -> ProbedScan:
        """What a probe needs of the scan, with the model as it is now."""
        return ProbedScan(
            self.model, self.pixels, self.radiance, self.std, self.prior, self._tensors.direct_error
        )

    def _tiles(self, of: slice) -> Iterator[tuple[slice, slice]]:
        width = self.pixels.valid.shape[1]
        rows, columns = tile_shape(self.bands.count)
        rows = rows if self.model.single or self._dense is not None else min(rows, DENSE_ROWS)
        for y in range(of.start, of.stop, rows):
            for x in range(0, width, columns):
                yield slice(y, min(y + rows, of.stop)), slice(x, min(x + columns, width))

    def _colour_weight(self) -> NDArray[np.float32]:
        """Weight of the zero-order colour: one minus the blurred mask of complete pixels (method, 7.1)."""
        valid = np.flatnonzero(self.pixels.valid)
        complete = np.ones(self.pixels.valid.shape, np.float32)
        nm = self.bands.centres_nm[self.bands.reported][[0, -1]]
        for some in np.array_split(valid, -(-valid.size // CHUNK)) if valid.size else ():
            reached = torch.zeros((2, some.size), dtype=torch.bool)
            for order in ORDERS:
                reached |= self.model.reached(order, *self._pixels_and_depth(some), nm).cpu()
            complete.ravel()[some] = reached.all(0).numpy()
        return (1 - blurred_mask(complete)).clip(0, 1)

    def _pixels_and_depth(self, flat: NDArray[np.intp]) -> tuple[Tensor, Tensor]:
        return torch.as_tensor(flat, device=self.device), self._map(self.pixels.depth_mm, flat)

    def frames(self, rows: slice, columns: slice) -> TileFrames:
        """What is measured of the valid pixels of a part of the picture."""
        like = torch.empty(0, device=self.device, dtype=self.dtype)
        radiance, std, first_row = self._stacks()
        return TileFrames(self.rig, radiance, std, self.pixels, rows, columns, like, first_row)

    def _stacks(self) -> tuple[NDArray[np.float32], NDArray[np.floating], int]:
        """Radiance and deviation (frames, rows, columns), and the row of the picture they begin with."""
        assert isinstance(self.radiance, np.ndarray)
        assert isinstance(self.std, np.ndarray)
        return self.radiance, self.std, self._first_row

    def trace(self, frames: TileFrames) -> Traced:
        """Where the light of pixels comes from."""
        return self.model.trace(*self._pixels_and_depth(frames.flat), frames.known("column_px"))

    @torch.inference_mode()
    def _tile(self, rows: slice, columns: slice, out: SpectralMaps, first_row: int, check: Check) -> None:
        if not self.pixels.valid[rows, columns].any():
            return
        frames = self.frames(rows, columns)
        # The samples of pixels just outside the tile belong to pixels inside it.
        height, width = self.pixels.valid.shape
        near = (
            frames
            if self.rig.sensor.bayer == "MONO"
            else self.frames(
                *(
                    slice(max(part.start - 1, 0), min(part.stop + 1, size))
                    for part, size in ((rows, height), (columns, width))
                )
            )
        )
        traced = self.trace(near)
        check()
        colour = self._colour_roots(frames) if self.model.single else None
        if self._lines is not None:
            found = self._lines.solve(self.model, self._stacks(), frames, near, traced, colour, check)
        elif self._dense is not None:
            found = self._dense.solve(self.model, frames, near, traced, check)
        else:
            found = self._tensors.solve(self.model, frames, near, traced, colour, check)
        own = torch.as_tensor(np.searchsorted(near.flat, frames.flat), device=self.device)
        self._store(*found, frames, (traced, own), out, first_row)

    def _colour_roots(self, frames: TileFrames) -> tuple[Tensor, Tensor] | None:
        """Zero-order colour of a tile and the roots of its weights, (3, pixels); None if they are zero."""
        kappa = self._map(self.colour_weight, frames.flat)
        if float(kappa.max()) < 1e-3:
            return None
        colour, variance = frames.zero_order_colour()
        return colour, (kappa / (variance + (COLOUR_ERROR * colour) ** 2)).sqrt()

    def _map(self, values: NDArray[np.float32], flat: NDArray[np.intp]) -> Tensor:
        return torch.as_tensor(values.ravel()[flat], device=self.device, dtype=self.dtype)

    def _store(
        self,
        spectra: Spectra,
        misfit: Tensor,
        frames: TileFrames,
        traced: tuple[Traced, Tensor],
        out: SpectralMaps,
        first_row: int,
    ) -> None:
        """Put spectra into maps that begin with a row of the picture.

        With the light that was ``traced`` comes which of its pixels they are of.
        """
        reported = self.bands.reported
        flat, mean = frames.flat, spectra.mean[reported]
        relative = frames.known("shading_rel_std").nan_to_num(nan=0.0)
        # What the model cannot explain makes the answer that much less certain (Birge ratio).
        excess, error = misfit.clip(min=1), relative
        if self.error is not None:
            excess = excess + (misfit - SURE_MISFIT).clip(min=0) * (self.error.correlation - 1)
            share = self.error.at(*frames.place(), self.pixels.valid.shape)
            error = torch.hypot(relative, like(np.hypot(share, self._unsure_level), mean))
        # A pixel that no spectrum explains may have that of a neighbour, one at the upper bound any level.
        high = (spectra.at_bound & (spectra.nodes > self.prior.bounds[1] / 2)).any(0)
        error = torch.hypot(error, torch.where(high, BOUND_SHARE, 0.0))
        std = torch.hypot(spectra.std[reported] * excess.sqrt(), mean * error)
        mixed = torch.where(misfit > MIXED_MISFIT, self._map(self.contrast, flat), 0.0)
        if bool(mixed.any()):
            std = torch.hypot(std, (mean * mixed).clip(max=MIXED_STD))
        reach = _reach(self.model, traced[0], reported).index_select(1, traced[1])
        flat = flat - first_row * self.pixels.valid.shape[1]
        for maps, values in (
            (out.reflectance, mean.float()),
            (out.std, std.float()),
            (out.data_share, spectra.data_share[reported].float()),
            (out.reach, reach),
            (out.chi_square[None], misfit.float()[None]),
            (out.at_bound[None], spectra.at_bound[reported].any(0)[None]),
        ):
            put_pixels(maps, flat, values.cpu().numpy())


def _reach(model: PixelModel, traced: Traced, reported: slice) -> Tensor:
    """Which orders reach pixels whose light was traced, (bands, pixels), as bits of `Reach`."""
    reach: Tensor | None = None
    for order, bit in ((1, Reach.PLUS_ONE), (-1, Reach.MINUS_ONE)):
        footprint = Footprint(*(each[reported] for each in traced.orders[order]))
        nm = model.bands.centres_nm[reported]
        here = model.reaches(order, footprint, nm).to(torch.uint8).mul_(int(bit))
        reach = here if reach is None else reach.add_(here)
    assert reach is not None
    return reach.masked_fill_(reach == 0, int(Reach.ZERO_ONLY))


def _wanted(tile: tuple[slice, slice], part: tuple[slice, slice], shape: tuple[int, ...]) -> bool:
    """Whether a tile has pixels of a part of a picture."""
    for own, wanted, size in zip(tile, part, shape, strict=True):
        start, stop, _ = wanted.indices(size)
        if own.start >= stop or own.stop <= start:
            return False
    return True


def blurred_mask(mask: NDArray[np.float32]) -> NDArray[np.float32]:
    """A mask (rows, columns) whose edges are as soft as a ninetieth of the picture's width (method, 7.1)."""
    import cv2

    return np.asarray(cv2.GaussianBlur(mask, (0, 0), max(mask.shape[1] / 90, 1.0)), np.float32)


def tile_shape(bands: int) -> tuple[int, int]:
    """Rows and columns of a tile: the equations of a pixel grow as the square of the bands."""
    share = min(TILE_BANDS / bands, 1.0)
    rows, columns = (
        max(2 * int(side * share / 2), least) for side, least in zip(TILE, LEAST_TILE, strict=True)
    )
    return min(rows, TILE[0]), min(columns, TILE[1])
