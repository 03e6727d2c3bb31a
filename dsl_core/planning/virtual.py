"""Virtual pixels: the reconstruction's own equations at a few places, without a picture.

At each sample of a view the linear model of `reconstruction.spectral_system` gives what every frame of a plan
would read for each reference spectrum; the bracket's noise, the black frames' noise and the error of the
refined column are drawn once (always the same), and the reconstruction's own estimators answer with the
equations of the column they believe in: beside the edge of a line the zero order, many times the first, is
then far from what they expect. What is left out: edges, shadows, and whatever the linear model gets wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import Footprint, correspondence, like, zero_order
from dsl_core.optics.image_formation import BlurredProfiles, ImageFormation, OrderPath
from dsl_core.optics.unlit import unlit_px
from dsl_core.planning.noise import Bracket, demosaic_factors, own_channel, sideways_shares
from dsl_core.planning.views import View
from dsl_core.reconstruction.columns.column import Column, refine
from dsl_core.reconstruction.columns.first_orders import first_order_share
from dsl_core.reconstruction.columns.pattern_column import (
    one_if_grey,
    radiance_profiles,
    refine_by_profiles,
    rounding_error,
)
from dsl_core.reconstruction.depth import triangulate
from dsl_core.reconstruction.line_set import LineSet
from dsl_core.reconstruction.spectral.dense_solver import solve_dense
from dsl_core.reconstruction.spectral.solver import Prior, Spectra
from dsl_core.reconstruction.spectral.spectra import (
    COLOUR_ERROR,
    DEMOSAIC_SPREAD,
    DIRECT_ERROR,
    EDGE_PX,
    MODEL_ERROR,
)
from dsl_core.reconstruction.spectral.system import (
    ORDERS,
    Bands,
    band_halfwidth_px,
    direct_light,
    without_offset,
)
from dsl_core.reconstruction.surface import default_window_px

#: Column shift of the finite difference, px.
STEP_PX = 0.2
#: Virtual pixels lie up to this far from their sample's column where columns are refined, px.
OFFSET_PX = 4.0
#: Share of the error granted to the linear model that differs from pixel to pixel, of what noise-free scans
#: of the twin's chart left (combs 9x2x64, 5x2x80 and 6x4x64); the rest is common to a patch.
SCATTER = 0.25
#: Frames whose light at a sample is below this share of the strongest take no part.
DARK = 1e-4


@dataclass(frozen=True)
class Outcome:
    """What the reconstruction would find, each for (samples, spectra) virtual pixels.

    Spectra and ``data_share`` have bands first; ``unbiased`` is without noise, the mean of a patch.
    """

    truth: NDArray[np.float64]
    mean: NDArray[np.float64]
    unbiased: NDArray[np.float64]
    std: NDArray[np.float64]
    data_share: NDArray[np.float64]
    column_error_px: NDArray[np.float64]
    depth_error_mm: NDArray[np.float64]
    lit: NDArray[np.bool_]


@dataclass(frozen=True)
class Matrices:
    """Operators of unit shading, (samples, 3, frames, bands): first orders, zero order, change per px."""

    first: Tensor
    zero: Tensor
    change: Tensor


class VirtualPixels:
    """The samples of a view under a plan."""

    def __init__(
        self,
        rig: Rig,
        plan: CapturePlan,
        grid: WavelengthGrid,
        view: View,
        *,
        prior: Prior | None = None,
        surface_window_px: int | None = None,
        scatter: float = SCATTER,
        seed: int = 0,
    ) -> None:
        """``scatter`` is the share of the granted model error that differs from pixel to pixel."""
        self.scatter = scatter
        self.rig, self.plan, self.grid, self.view = rig, plan, grid, view
        self.prior, self.seed = prior or Prior().at_step(grid.step_nm), seed
        self.shading = torch.as_tensor(view.shading, dtype=torch.float32)
        self.window_px = surface_window_px or default_window_px(rig)
        self.bands, self.bracket, self.lines = Bands.of(rig, grid), Bracket.of(rig, plan), LineSet.of(plan)
        self.single = self.lines is not None and self.lines.lines == self.lines.frames
        near_px, far_px = unlit_px(rig, self.lines.width_px) if self.lines is not None else (0.0, 0.0)
        self.has_unlit = far_px > near_px
        self.profiles = radiance_profiles(rig, plan)
        self.direct_error = DIRECT_ERROR if self.single else max(DIRECT_ERROR, rounding_error(rig, plan))
        self.pixels = torch.as_tensor(view.pixels)
        self.depth = torch.as_tensor(view.depth_mm, dtype=torch.float64)
        self.column, _ = zero_order(rig, self.pixels, self.depth)
        _, self.slope_mm = triangulate(rig, self.pixels, self.column)
        self.model = correspondence(rig)
        self.pitch_px = self._pitch_px()
        light = one_if_grey(self.profiles)
        one = torch.zeros(1)
        #: Zero order as one sample of the mosaic sees it, and as the reconstruction models it.
        self.direct = BlurredProfiles(rig.projector_response, light, 0.0, one)
        self.modelled = BlurredProfiles(self._blurred_response(), light, 0.0, one)
        self.inside: dict[int, Tensor] = {}
        self.matrices = self._matrices()

    def _matrices(self) -> Matrices:
        beyond = self.depth + self.slope_mm * STEP_PX
        ahead, _ = zero_order(self.rig, self.pixels, beyond)
        here = self._first(self.bands, self.depth, keep=True)
        step = (ahead - self.column)[:, None, None, None].to(here)
        zero = self.zero_at(self.column.float())
        return Matrices(here, zero, (self._first(self.bands, beyond) - here) / step)

    def _pitch_px(self) -> Tensor:
        """Columns of the projector from a pixel to the next, (samples,)."""
        neighbour, _ = zero_order(self.rig, (self.pixels + 1).clip(max=self._count - 1), self.depth)
        return neighbour - self.column

    def _blurred_response(self) -> ProjectorResponse:
        """The projector blurred as the reconstruction has it, by the columns that demosaicing averages."""
        spread = DEMOSAIC_SPREAD**0.5 * float(self.pitch_px.abs().median())
        response = self.rig.projector_response
        return response.model_copy(update={"blur_px": float(np.hypot(response.blur_px, spread))})

    @property
    def _count(self) -> int:
        return self.rig.camera.width_px * self.rig.camera.height_px

    def _first(self, bands: Bands, depth: Tensor, keep: bool = False) -> Tensor:
        width, height = self.plan.projector_size_px
        paths = []
        for order in bands.orders if not self.single else ORDERS:
            traced = self.model.trace(self.pixels, depth.double(), order, bands.centroids_nm[order])
            footprint = Footprint(traced.columns.float(), traced.rows.float())
            inside = footprint.inside(width, height, margin_px=EDGE_PX)
            if keep and order in ORDERS:
                self.inside[order] = footprint.inside(width, height)[bands.reported]
            half = band_halfwidth_px(footprint.columns, bands.step_nm, bands.centres_nm)
            paths.append(OrderPath(footprint.columns, inside, bands.moments[order], half))
        response = self._blurred_response()
        return ImageFormation(response, self.profiles, paths, torch.ones(len(self.pixels))).matrix()

    def zero_moments(self, bands: Bands) -> Tensor:
        """Response to the zero order, (3, LEDs, bands); grey patterns light all LEDs as one."""
        moments = like(bands.moments[0], self.shading)
        return moments if self.direct.table.shape[1] == 3 else moments.sum(1, keepdim=True)

    def zero_at(self, columns_px: Tensor) -> Tensor:
        """The reconstruction's zero-order operator of unit shading at columns, (n, 3, frames, bands)."""
        return torch.einsum("nlf,clj->ncfj", self.modelled.at(columns_px), self.zero_moments(self.bands))

    def _zero_signal(self, bands: Bands, spectra: Tensor) -> Tensor:
        """Zero order as demosaicing gives it, each colour from its own neighbours, of unit shading."""
        column, pitch = self.column.float(), self.pitch_px.float()
        beside = 0.5 * (self.direct.at(column - pitch) + self.direct.at(column + pitch))
        share = torch.as_tensor(sideways_shares(self.rig, self.view.pixels), dtype=torch.float32)
        here = self.direct.at(column)
        light = here[:, None] + share[..., None, None] * (beside - here)[:, None]
        colour = torch.einsum("clj,srj->srcl", self.zero_moments(bands), spectra)
        return torch.einsum("sclf,srcl->srcf", light, colour)

    def signals(self, spectra: Tensor, bands: Bands | None = None) -> tuple[Tensor, Tensor]:
        """First-order and zero-order radiance, each (samples, spectra, 3, frames), DN per ms.

        ``spectra`` (samples, spectra, bands) are node values of ``bands``, by default the internal ones.
        """
        shading = self.shading[:, None, None, None]
        operator = self.matrices.first if bands is None else self._first(bands, self.depth)
        first = torch.einsum("scfj,srj->srcf", operator, spectra)
        return first * shading, self._zero_signal(bands or self.bands, spectra) * shading

    def run(self, spectra: NDArray[np.float64], first: Tensor, zero: Tensor) -> Outcome:
        """Reconstruct virtual pixels of truth ``spectra`` (samples, spectra, bands inside) from signals."""
        return _Run(self, spectra, first, zero).outcome()


class _Run:
    """One draw of the noise, and what the estimators make of it."""

    def __init__(self, owner: VirtualPixels, spectra: NDArray[np.float64], first: Tensor, zero: Tensor):
        self.owner, self.spectra, self.first, self.zero = owner, spectra, first, zero
        self.nodes = torch.tensor(spectra, dtype=torch.float32)
        self.random = torch.Generator().manual_seed(owner.seed)
        rig, view = owner.rig, owner.view
        factors = torch.as_tensor(demosaic_factors(rig, view.pixels), dtype=torch.float32)
        self.factors = factors[:, None, :, None]
        self.shading = owner.shading[:, None]
        clean = first + zero
        #: Light of the projector's black, (samples, spectra, 3, 1).
        self.black = rig.projector_response.black_fraction * self._white((0, *ORDERS))[..., None]
        spread = owner.bracket.variance(clean, self.black) * self.factors
        self.saturated = ~torch.isfinite(spread)
        noise = self._normal(clean.shape) * torch.where(self.saturated, 0.0, spread).sqrt()
        self.noisy = clean + noise + self._black(clean)
        self.variance = owner.bracket.variance(self.noisy, self.black)
        dark = owner.bracket.variance(torch.zeros_like(self.black), self.black) * self.factors
        #: Variance of what the black frames shift all frames by, (samples, spectra, 3).
        self.offset_variance = dark[..., 0]

    def _normal(self, shape: torch.Size | tuple[int, ...]) -> Tensor:
        return torch.randn(shape, generator=self.random)

    def _black(self, clean: Tensor) -> Tensor:
        """Noise of the black frames: common to all frames of a pixel."""
        bracket = self.owner.bracket
        weights, floors = bracket.black_weights(clean, self.black), bracket.floors(self.black)
        return -(weights * self._normal(floors.shape) * (floors * self.factors).sqrt()).sum(0)

    def _columns(self) -> tuple[Column, Tensor]:
        """Refined columns of all virtual pixels from their own samples of the mosaic, and their errors.

        Each spectrum takes another place between the lines, which matters more than where in the picture.
        """
        owner = self.owner
        samples, count, _, frames = self.noisy.shape
        own = torch.as_tensor(own_channel(owner.rig, owner.view.pixels))
        offsets = torch.linspace(-OFFSET_PX, OFFSET_PX, count) if count > 1 else torch.zeros(1)
        true = (owner.column.float()[:, None] + offsets).reshape(-1)
        response = owner.rig.projector_response
        light = owner.direct.at(true)
        moments = owner.zero_moments(owner.bands)[own]
        leds = torch.einsum("slj,srj->srl", moments, self.nodes) * self.shading[..., None]
        zero = torch.einsum("nlf,nl->nf", light, leds.flatten(0, 1)).reshape(samples, count, frames)
        index = own[:, None, None, None].expand(-1, count, 1, frames)
        clean = self.first.gather(2, index)[:, :, 0] + zero
        black = self.black.gather(2, index[..., :1])[:, :, 0]
        spread = owner.bracket.variance(clean, black)
        sigma = torch.where(torch.isfinite(spread), spread, 0.0).sqrt()
        y = clean + self._normal(clean.shape) * sigma
        std = owner.bracket.variance(y, black).sqrt()
        radiance, std = (v.reshape(-1, frames).T.contiguous() for v in (y, std))
        if owner.lines is not None:
            column = refine(true.round(), radiance, std, owner.lines, response)
        else:
            profiles = one_if_grey(owner.profiles)
            share = first_order_share(owner.rig, profiles, owner.pixels, owner.column.float().round())
            share = share.repeat_interleave(count, 0)
            column = refine_by_profiles(true.round(), radiance, std, profiles, response, share)
        return column, (column.column_px - true).reshape(samples, count)

    def outcome(self) -> Outcome:
        owner = self.owner
        column, error_px = self._columns()
        depth_error = error_px.double() * owner.slope_mm[:, None]
        # Of what the reconstruction grants its linear model as error, what scatters is drawn as well.
        base = self.noisy + owner.scatter * MODEL_ERROR * self.noisy * self._normal(self.noisy.shape)
        clean = self.first + self.zero
        if owner.single:
            # Zero order and halo are subtracted; the unlit frames between the orders give the dark offset.
            offset = self._black_again() if owner.has_unlit else 0.0
            base, clean = base - self.zero - offset, clean - self.zero
        amplitude = column.amplitude_std.reshape(error_px.shape)
        found, calm = self._solve(self._weights(error_px), base, clean, error_px, amplitude)
        scale = 1 / (1 + self._shading_error(column, depth_error))
        true = column.column_px.reshape(error_px.shape) - error_px
        lit = self._lit(true, column.refined.reshape(error_px.shape))
        shape = (-1, *error_px.shape)

        def of(values: Tensor) -> NDArray[np.float64]:
            return np.asarray(values[owner.bands.reported].reshape(shape).double().numpy())

        truth = np.moveaxis(self.spectra[..., owner.bands.reported], 2, 0)
        return Outcome(
            truth, of(found.mean) * scale.numpy(), of(calm.mean), of(found.std), of(found.data_share),
            error_px.double().numpy(), depth_error.numpy(), lit.numpy(),
        )  # fmt: skip

    def _black_again(self) -> Tensor:
        """The black frames' noise once more: what the dark offset takes out."""
        state = torch.Generator().manual_seed(self.owner.seed)
        torch.randn(self.noisy.shape, generator=state)
        saved, self.random = self.random, state
        try:
            return self._black(self.first + self.zero)
        finally:
            self.random = saved

    def _weights(self, error_px: Tensor) -> Tensor:
        """The reconstruction's weights, (samples, spectra, 3, frames)."""
        owner = self.owner
        spread = self.variance * self.factors + (MODEL_ERROR * self.noisy) ** 2
        if not owner.single:
            found = (owner.column.float()[:, None] + error_px).flatten()
            colour = self._white((0,)).flatten(0, 1).T
            direct = direct_light(owner.modelled, owner.bands, found, colour)
            spread = spread + (owner.direct_error * direct.permute(2, 0, 1).reshape(spread.shape)) ** 2
        return torch.where(self.saturated, 0.0, 1 / spread)

    def _solve(
        self, weight: Tensor, noisy: Tensor, clean: Tensor, error_px: Tensor, spread: Tensor
    ) -> tuple[Spectra, Spectra]:
        """Spectra of all virtual pixels with noise, and without noise and error of the column."""
        owner = self.owner
        matrices: list[Tensor] = []
        rights: list[Tensor] = []
        calm: list[Tensor] = []
        for s, first in enumerate(owner.matrices.first):
            # The estimate traces all light from the column it believes in; next to the edge of a line of a
            # comb that moves the zero order by many times the first.
            true = first if owner.single else first + owner.matrices.zero[s]
            moved = owner.matrices.change[s] * error_px[s, :, None, None, None]
            if not owner.single:
                found = owner.column[s].float() + error_px[s]
                moved = moved + owner.zero_at(found) - owner.matrices.zero[s]
            strength = true.flatten(0, 1).abs().amax(1)
            # Frames without light still say what the black frames were off by.
            used = (strength > DARK * strength.max()) | (not owner.single)
            change = moved.flatten(1, 2)[:, used] * self.shading[s]
            operator = true.flatten(0, 1)[used] * self.shading[s] + change
            w = weight[s].flatten(1)[:, used, None]
            operator = self._without_offset(s, operator, w)
            rows = operator * w
            matrices.append(rows.mT @ operator)
            shift = (change @ self.nodes[s, :, :, None])[..., 0]
            for out, data in ((rights, noisy[s]), (calm, clean[s])):
                y = data.flatten(1)[:, used] + (0 if out is rights else shift)
                out.append((rows.mT @ self._without_offset(s, y[..., None], w))[..., 0])
        matrix, right, quiet = (torch.cat(parts) for parts in (matrices, rights, calm))
        if owner.single:
            matrix, right, quiet = self._with_colour(matrix, right, quiet, spread)
        return solve_dense(matrix, right, owner.prior), solve_dense(matrix, quiet, owner.prior)

    def _without_offset(self, sample: int, values: Tensor, weight: Tensor) -> Tensor:
        """Values (spectra, channels x frames, n) as far as the black frames' noise leaves them known."""
        if self.owner.single:
            return values
        apart = (len(values), 3, self.noisy.shape[3], -1)
        variance = self.offset_variance[sample]
        return without_offset(values.reshape(apart), weight.reshape(apart), variance).flatten(1, 2)

    def _with_colour(
        self, matrix: Tensor, right: Tensor, quiet: Tensor, spread: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Add the zero-order colour where a sample misses a band in both orders."""
        owner = self.owner
        reached = torch.stack(list(owner.inside.values())).any(0).all(0)
        if bool(reached.all()):
            return matrix, right, quiet
        colour = self._white((0,))
        variance = spread[..., None] ** 2 * self.factors[..., 0]
        root = (~reached).float()[:, None, None] / (variance + (COLOUR_ERROR * colour) ** 2).sqrt()
        moments = like(owner.bands.moments[0].sum(1), matrix)
        rows = (moments * (root * self.shading[..., None])[..., None]).flatten(0, 1)
        # Where the amplitude is unknown its equation weighs nothing, and neither does its noise.
        share = torch.where(torch.isfinite(variance), variance.sqrt() * root, 0.0)
        clean, noise = colour * root, self._normal(colour.shape) * share
        add = [torch.einsum("ncj,nc->nj", rows, v.flatten(0, 1)) for v in (clean + noise, clean)]
        return matrix + rows.mT @ rows, right + add[0], quiet + add[1]

    def _shading_error(self, column: Column, depth_error: Tensor) -> Tensor:
        """Relative errors of shading from noise in depth, (samples, spectra): plane fits and distance.

        Fits weigh pixels by their stated deviation, as `surface` does.
        """
        view, lens, w = self.owner.view, self.owner.rig.camera, self.owner.window_px
        stated = torch.hypot(column.std_px, torch.tensor(self.owner.rig.column_std_px))
        weight = stated.reshape(depth_error.shape).double() ** -2
        square = ((weight * depth_error) ** 2).mean(1) / weight.mean(1) ** 2
        relative = square.sqrt() / self.owner.depth
        tilt = relative * lens.fx_px * (12 / (w * w - 1)) ** 0.5 / w
        spread = torch.as_tensor(view.incidence_tan) * tilt
        tilted: Tensor = self._normal(depth_error.shape) * spread[:, None]
        return tilted + 2 * depth_error / self.owner.depth[:, None]

    def _lit(self, column_px: Tensor, refined: Tensor) -> Tensor:
        """Whether a virtual pixel gets a depth, (samples, spectra).

        White stands clear of the noise; and where the edge of a stripe lies so near that both a pattern of
        the code and its inverse saturate every setting, the refinement must find the column.
        """
        from dsl_core.reconstruction.geometry import LIT_SIGMAS

        owner = self.owner
        own = torch.as_tensor(own_channel(owner.rig, owner.view.pixels))[:, None, None]
        direct, first, black = (
            white.gather(2, own.expand(-1, white.shape[1], 1))[..., 0]
            for white in (self._white((0,)), self._white(ORDERS), self.black[..., 0])
        )
        noise = owner.bracket.variance(direct, black).sqrt()
        to_edge = 0.5 - (column_px - column_px.round()).abs()
        darker = torch.special.ndtr(-to_edge / owner.rig.projector_response.blur_px)
        unsure = ~torch.isfinite(owner.bracket.variance(direct * darker + first / 2, black))
        lit: Tensor = ((direct > LIT_SIGMAS * noise) | ~torch.isfinite(noise)) & (refined | ~unsure)
        return lit

    def _white(self, orders: tuple[int, ...]) -> Tensor:
        """Signal under white through some orders, (samples, spectra, 3), DN per ms."""
        moments = sum(self.owner.bands.moments[order].sum(1) for order in orders)
        white = torch.einsum("cj,srj->src", like(np.asarray(moments), self.nodes), self.nodes)
        return white * self.shading[..., None]
