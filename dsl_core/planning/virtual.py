"""Virtual pixels: the reconstruction's own equations at a few places, without a picture.

At each sample pixel the forward model of `optics.pixel_model` gives what every frame of a plan would read
for each reference spectrum; the bracket's noise, the black frames' noise and the error of the refined column
are drawn once (always the same), and the reconstruction's own estimators answer with the equations of the
column they believe in: next to the edge of a line the zero order, many times the first, is then far from what
they expect. What is left out: edges, shadows, and whatever the linear model gets wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence, like, triangulate, zero_order
from dsl_core.optics.pixel_model import (
    COLOUR_ERROR,
    MODEL_ERROR,
    PixelModel,
    demosaic_blur_px,
    without_offset,
)
from dsl_core.optics.spectra import ORDERS, Bands
from dsl_core.optics.unlit import unlit_px
from dsl_core.planning.noise import (
    Bracket,
    demosaic_factors,
    measured_colours,
    own_channel,
    sideways_shares,
)
from dsl_core.planning.samples import SamplePixels
from dsl_core.planning.tilt import tilt_std
from dsl_core.reconstruction.columns.column import Column, refine
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.reconstruction.columns.pattern_column import first_order_share, refine_by_profiles
from dsl_core.reconstruction.columns.peak_error import peak_error
from dsl_core.reconstruction.geometry import LIT_SIGMAS
from dsl_core.reconstruction.spectral.solving.dense_solver import solve_dense
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solution import Spectra
from dsl_core.reconstruction.spectral.spectra import model_of_plan, zero_order_error
from dsl_core.reconstruction.surface import default_window_px

#: Column shift of the finite difference, px.
STEP_PX = 0.2
#: Virtual pixels are up to this far from their sample's column where columns are refined, px.
OFFSET_PX = 4.0
#: Share of the error granted to the linear model that differs from pixel to pixel, of what noise-free scans
#: of the twin's chart left (combs 9x2x64, 5x2x80 and 6x4x64); the rest is common to a patch.
SCATTER = 0.25
#: Frames whose light at a sample is below this share of the strongest take no part.
DARK = 1e-4


@dataclass(frozen=True)
class Outcome:
    """What the reconstruction would find, each for (samples, spectra) virtual pixels.

    Spectra and ``data_share`` have bands first.
    """

    truth: NDArray[np.float64]
    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    data_share: NDArray[np.float64]
    depth_error_mm: NDArray[np.float64]
    lit: NDArray[np.bool_]


@dataclass(frozen=True)
class Matrices:
    """Operators of unit shading, (samples, 3, frames, bands): first orders, zero order, change per px."""

    first: Tensor
    zero: Tensor
    change: Tensor


@dataclass(frozen=True)
class Draw:
    """One draw of the noise of virtual pixels, as (samples, spectra, 3 colours, frames).

    ``nodes`` (samples, spectra, bands) are the true spectra, ``first`` and ``zero`` the signals without
    noise, ``black`` (one frame) the light of black frames; ``noisy`` is what is read, with the stated
    ``variance`` of its mosaic; ``black_noise`` is what the black frames' noise adds to it, whose variance,
    common to all frames, is ``offset_variance`` (samples, spectra, 3); ``rounding`` is what a coarse sensor
    adds to all pixels of equal light; more is drawn from ``random``. A ``sign`` of -1 mirrors all of it.
    """

    nodes: Tensor
    first: Tensor
    zero: Tensor
    black: Tensor
    noisy: Tensor
    variance: Tensor
    saturated: Tensor
    black_noise: Tensor
    offset_variance: Tensor
    rounding: Tensor
    random: torch.Generator
    sign: int = 1

    def normal(self, shape: torch.Size | tuple[int, ...]) -> Tensor:
        """The next numbers of a standard normal distribution."""
        return self.sign * torch.randn(shape, generator=self.random)


class VirtualPixels:
    """Sample pixels under a plan."""

    def __init__(
        self,
        rig: Rig,
        plan: CapturePlan,
        grid: WavelengthGrid,
        view: SamplePixels,
        *,
        surface_window_px: int | None = None,
        scatter: float = SCATTER,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """``scatter`` is the share of the granted model error that differs from pixel to pixel.

        ``dtype`` is the precision of the equations, as for `SpectralReconstruction`.
        """
        self.scatter = scatter
        self.rig, self.view = rig, view
        self.prior = Prior().at_step(grid.step_nm)
        self.shading = torch.as_tensor(view.shading, dtype=dtype)
        self.window_px = surface_window_px or default_window_px(rig)
        self.bracket, self.direct_error = Bracket.of(rig, plan.settings), zero_order_error(rig, plan)
        self.code_bracket = Bracket.of(rig, [plan.settings[i] for i in plan.code_settings])
        self.model = model_of_plan(rig, plan, grid, correspondence(rig))
        self.bands, lines = self.model.bands, self.model.lines
        near_px, far_px = unlit_px(rig, lines.width_px) if lines is not None else (0.0, 0.0)
        self.has_unlit = far_px > near_px
        self.pixels = torch.as_tensor(view.pixels)
        self.own = torch.as_tensor(own_channel(rig, view.pixels))
        factors = like(demosaic_factors(rig, view.pixels), self.shading)
        self.factors = factors[:, None, :, None]
        self.measured = torch.as_tensor(measured_colours(rig))
        self.depth = torch.as_tensor(view.depth_mm, dtype=torch.float64)
        self.column, _ = zero_order(rig, self.pixels, self.depth)
        _, self.slope_mm = triangulate(rig, self.pixels, self.column)
        # The last pixel of a row has its neighbour on the left.
        side = torch.where((self.pixels + 1) % rig.camera.width_px == 0, -1, 1)
        neighbour, _ = zero_order(rig, self.pixels + side, self.depth)
        #: Columns of the projector from a pixel to the next, (samples,).
        self.pitch_px = (side * (neighbour - self.column)).to(self.shading)
        self.blur_px = demosaic_blur_px(torch.stack([self.column, neighbour], 1).numpy())
        #: Share of each colour that demosaicing takes from the neighbouring columns, (samples, 3).
        self.sideways = like(sideways_shares(rig, view.pixels), self.shading)
        #: Zero order as one sample of the mosaic sees it.
        self.direct = self.model.zero_light(self.shading)
        self.matrices = self._matrices()

    def _matrices(self) -> Matrices:
        beyond = self.depth + self.slope_mm * STEP_PX
        ahead, _ = zero_order(self.rig, self.pixels, beyond)
        here = self._first(self.model, self.depth)
        step = (ahead - self.column)[:, None, None, None].to(here)
        zero = self.zero_at(self.column.to(self.shading))
        return Matrices(here, zero, (self._first(self.model, beyond) - here) / step)

    def _first(self, model: PixelModel, depth: Tensor) -> Tensor:
        """Operator of unit shading through all but the zero order, (samples, 3, frames, bands)."""
        traced = model.trace(self.pixels, depth, self.column.to(self.shading))
        one = torch.ones_like(self.shading)
        return model.operator(traced, one, self.blur_px, model.orders).matrix()

    def demosaiced(
        self, light: Callable[[Tensor], Tensor], columns_px: Tensor, sample: int | slice | Tensor
    ) -> Tensor:
        """Light (n, 3 or 1, LEDs, frames) at columns (n,) of samples as colours show it, (n, 3, ...).

        The reconstruction models every sample of the mosaic at its own column, and so does this.
        """
        pitch_px, share = self.pitch_px[sample], self.sideways[sample][..., None, None]
        here = light(columns_px)
        sideways = 0.5 * (light(columns_px - pitch_px) + light(columns_px + pitch_px))
        return here + share * (sideways - here)

    def zero_at(
        self, columns_px: Tensor, sample: int | slice = slice(None), model: PixelModel | None = None
    ) -> Tensor:
        """Zero-order operator of unit shading at columns (n,) of samples, (n, 3, frames, bands)."""
        moments = (model or self.model).zero_moments(self.shading)
        light = self.demosaiced(lambda at_px: self.direct.at(at_px)[:, None], columns_px, sample)
        return torch.einsum("nclf,clj->ncfj", light, moments)

    def signals(self, spectra: Tensor, bands: Bands | None = None) -> tuple[Tensor, Tensor]:
        """First-order and zero-order radiance, each (samples, spectra, 3, frames), DN per ms.

        ``spectra`` (samples, spectra, bands) are node values of ``bands``, by default the internal ones.
        """
        shading = self.shading[:, None, None, None]
        model, operator = self.model, self.matrices.first
        if bands is not None:
            model = PixelModel(self.rig, bands, model.profiles, model.correspondence, model.lines)
            operator = self._first(model, self.depth)
        first = torch.einsum("scfj,srj->srcf", operator, spectra)
        zero = self.zero_at(self.column.to(self.shading), model=model)
        return first * shading, torch.einsum("scfj,srj->srcf", zero, spectra) * shading

    def run(self, spectra: NDArray[np.float64], first: Tensor, zero: Tensor, sign: int = 1) -> Outcome:
        """Reconstruct virtual pixels of truth ``spectra`` (samples, spectra, bands inside) from signals.

        With a ``sign`` of -1 all errors that are drawn are those of 1 the other way round. The mean of both
        has none of them, and all that noise does to the mean of a patch.
        """
        draw = self._draw(spectra, first, zero, sign)
        column, error_px = self._columns(draw)
        depth_error = error_px.double() * self.slope_mm[:, None]
        # Of what the reconstruction grants its linear model as error, what scatters is drawn as well.
        base = draw.noisy + self.scatter * MODEL_ERROR * draw.noisy * draw.normal(draw.noisy.shape)
        if self.model.single:
            # Zero order and halo are subtracted; the unlit frames between the orders give the dark offset.
            base = base - draw.zero - (draw.black_noise if self.has_unlit else 0.0)
        amplitude = column.amplitude_std.reshape(error_px.shape)
        found = self._solve(draw, base, error_px, amplitude)
        scale = 1 / (1 + self._shading_error(draw, column, depth_error))
        true = column.column_px.reshape(error_px.shape) - error_px
        lit = self._lit(draw, true, column.refined.reshape(error_px.shape))
        shape = (-1, *error_px.shape)

        def of(values: Tensor) -> NDArray[np.float64]:
            return np.asarray(values[self.bands.reported].reshape(shape).double().numpy())

        truth = np.moveaxis(spectra[..., self.bands.reported], 2, 0)
        return Outcome(
            truth, (of(found.mean) * scale.numpy()).clip(*self.prior.bounds), of(found.std),
            of(found.data_share), depth_error.numpy(), lit.numpy(),
        )  # fmt: skip

    def _draw(self, spectra: NDArray[np.float64], first: Tensor, zero: Tensor, sign: int) -> Draw:
        random = torch.Generator().manual_seed(0)
        nodes, clean = like(spectra, self.shading), first + zero
        black = self._black(nodes)[..., None]
        rounding = torch.zeros(())
        spread = self.bracket.variance(clean, black) * self.factors
        if self.rig.sensor.rounds_light:
            # Neighbours of a pixel see other parts of a line, and are rounded otherwise.
            rounding = self.bracket.rounding(clean, black) * self.factors.sqrt()
            spread = self.bracket.unrounded.variance(clean, black) * self.factors
        saturated = ~torch.isfinite(spread)
        noise = torch.randn(clean.shape, generator=random) * torch.where(saturated, 0.0, spread).sqrt()
        weights, floors = self.bracket.black_weights(clean, black), self.bracket.floors(black)
        # The noise of the black frames is common to all frames of a pixel.
        common = torch.randn(floors.shape, generator=random) * (floors * self.factors).sqrt()
        black_noise = -sign * (weights * common).sum(0)
        noisy = clean + rounding + sign * noise + black_noise
        dark = self.bracket.variance(torch.zeros_like(black), black) * self.factors
        variance = self.bracket.variance(noisy, black, clean)
        # Where black saturates in every setting, no frame tells anything, and no offset matters.
        offset = torch.where(torch.isfinite(dark), dark, 0.0)[..., 0]
        return Draw(
            nodes, first, zero, black, noisy, variance, saturated, black_noise, offset, rounding, random, sign
        )  # fmt: skip

    def _columns(self, draw: Draw) -> tuple[Column, Tensor]:
        """Refined columns of all virtual pixels from their own samples of the mosaic, and their errors.

        Each spectrum takes another place between the lines, which matters more than where in the picture.
        """
        samples, count, _, frames = draw.noisy.shape
        offsets = torch.linspace(-OFFSET_PX, OFFSET_PX, count) if count > 1 else torch.zeros(1)
        true = (self.column.to(self.shading)[:, None] + offsets).reshape(-1)
        # A whole column is off by as much the other way on the other side of its middle.
        true = true.round() + draw.sign * (true - true.round())
        moments = self.model.zero_moments(self.shading)[self.own]
        leds = torch.einsum("slj,srj->srl", moments, draw.nodes) * self.shading[:, None, None]
        zero = torch.einsum("nlf,nl->nf", self.direct.at(true), leds.flatten(0, 1))
        index = self.own[:, None, None, None].expand(-1, count, 1, frames)
        clean = draw.first.gather(2, index)[:, :, 0] + zero.reshape(samples, count, frames)
        black = draw.black.gather(2, index[..., :1])[:, :, 0]
        spread = self.bracket.variance(clean, black)
        sigma = torch.where(torch.isfinite(spread), spread, 0.0).sqrt()
        y = clean + draw.normal(clean.shape) * sigma
        std = self.bracket.variance(y, black, clean).sqrt()
        radiance, std = (v.reshape(-1, frames).T.contiguous() for v in (y, std))
        response, profiles = self.rig.projector_response, self.model.profiles
        if self.model.lines is not None:
            peaks = LinePeaks(true.round(), radiance, std, self.model.lines, response)
            # What first orders of other lines add under a comb's peaks is in these data, and not in its fit.
            column = refine(peaks, 0.0 if peaks.lines.single else peak_error(peaks))
        else:
            share = first_order_share(self.rig, profiles, self.pixels, self.column.to(self.shading).round())
            share = share.repeat_interleave(count, 0)
            column = refine_by_profiles(true.round(), radiance, std, profiles, response, share)
        return column, (column.column_px - true).reshape(samples, count)

    def _weights(self, draw: Draw, error_px: Tensor) -> Tensor:
        """The reconstruction's weights, (samples, spectra, 3, frames)."""
        spread = draw.variance * self.factors + (MODEL_ERROR * draw.noisy) ** 2
        if not self.model.single:
            found = (self.column.to(self.shading)[:, None] + error_px).flatten()
            colour = self._white(draw.nodes, (0,)).flatten(0, 1).T
            own = torch.arange(len(error_px)).repeat_interleave(error_px.shape[1])

            def most(at_px: Tensor) -> Tensor:
                return self.model.direct_light(self.direct, at_px, colour).permute(2, 0, 1)[:, :, None]

            direct = self.demosaiced(most, found, own).reshape(spread.shape)
            spread = spread + (self.direct_error * direct) ** 2
        return torch.where(draw.saturated | ~self.measured[:, None], 0.0, 1 / spread)

    def _solve(self, draw: Draw, noisy: Tensor, error_px: Tensor, spread: Tensor) -> Spectra:
        """Spectra of all virtual pixels."""
        single, weight = self.model.single, self._weights(draw, error_px)
        matrices: list[Tensor] = []
        rights: list[Tensor] = []
        for s, first in enumerate(self.matrices.first):
            # The estimate traces all light from the column it believes in; next to the edge of a line of a
            # comb that moves the zero order by many times the first.
            true = first if single else first + self.matrices.zero[s]
            moved = self.matrices.change[s] * error_px[s, :, None, None, None]
            if not single:
                found = self.column[s].to(self.shading) + error_px[s]
                moved = moved + self.zero_at(found, s) - self.matrices.zero[s]
            strength = true.flatten(0, 1).abs().amax(1)
            # Frames without light still say what the black frames were off by.
            used = (strength > DARK * strength.max()) | (not single)
            operator = (true.flatten(0, 1)[used] + moved.flatten(1, 2)[:, used]) * self.shading[s]
            w = weight[s].flatten(1)[:, used, None]
            operator = self._without_offset(draw, s, operator, w)
            rows = operator * w
            matrices.append(rows.mT @ operator)
            y = self._without_offset(draw, s, noisy[s].flatten(1)[:, used, None], w)
            rights.append((rows.mT @ y)[..., 0])
        matrix, right = torch.cat(matrices), torch.cat(rights)
        if single:
            matrix, right = self._with_colour(draw, matrix, right, spread)
        return solve_dense(matrix, right, self.prior)

    def _without_offset(self, draw: Draw, sample: int, values: Tensor, weight: Tensor) -> Tensor:
        """Values (spectra, channels x frames, n) as far as the black frames' noise leaves them known."""
        if self.model.single:
            return values
        apart = (len(values), 3, draw.noisy.shape[3], -1)
        variance = draw.offset_variance[sample]
        return without_offset(values.reshape(apart), weight.reshape(apart), variance).flatten(1, 2)

    def _with_colour(
        self, draw: Draw, matrix: Tensor, right: Tensor, spread: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Add the zero-order colour where a sample misses a band in both orders."""
        nm = self.bands.centroids_nm
        some = [self.model.reached(m, self.pixels, self.depth, nm[m][self.bands.reported]) for m in ORDERS]
        reached = torch.stack(some).any(0).all(0)
        if bool(reached.all()):
            return matrix, right
        colour = self._white(draw.nodes, (0,))
        variance = spread[..., None] ** 2 * self.factors[..., 0]
        root = ((~reached)[:, None, None] & self.measured).float() / (
            variance + (COLOUR_ERROR * colour) ** 2
        ).sqrt()
        moments = like(self.bands.moments[0].sum(1), matrix)
        rows = (moments * (root * self.shading[:, None, None])[..., None]).flatten(0, 1)
        # Where the amplitude is unknown its equation weighs nothing, and neither does its noise.
        share = torch.where(torch.isfinite(variance), variance.sqrt() * root, 0.0)
        y = colour * root + draw.normal(colour.shape) * share
        right = right + torch.einsum("ncj,nc->nj", rows, y.flatten(0, 1))
        return matrix + rows.mT @ rows, right

    def _shading_error(self, draw: Draw, column: Column, depth_error: Tensor) -> Tensor:
        """Relative errors of shading from noise in depth, (samples, spectra)."""
        stated = torch.hypot(column.std_px, torch.tensor(self.rig.column_std_px)).reshape(depth_error.shape)
        tilt = draw.normal(depth_error.shape) * torch.as_tensor(self.view.incidence_tan)[:, None]
        depth, fx_px = self.depth[:, None], self.rig.camera.fx_px
        return tilt * tilt_std(depth_error / depth, stated, fx_px, self.window_px) + 2 * depth_error / depth

    def _lit(self, draw: Draw, column_px: Tensor, refined: Tensor) -> Tensor:
        """Whether a virtual pixel gets a depth, (samples, spectra).

        White stands clear of the noise; and where the edge of a stripe is so near that both a pattern of
        the code and its inverse saturate every setting of the code, the refinement must find the column.
        """
        own = self.own[:, None, None]
        whites = self._white(draw.nodes, (0,)), self._white(draw.nodes, ORDERS), draw.black[..., 0]
        direct, first, black = (
            white.gather(2, own.expand(-1, white.shape[1], 1))[..., 0] for white in whites
        )
        noise = self.code_bracket.variance(direct + first, black).sqrt()
        to_edge = 0.5 - (column_px - column_px.round()).abs()
        darker = torch.special.ndtr(-to_edge / self.rig.projector_response.blur_px)
        unsure = ~torch.isfinite(self.code_bracket.variance(direct * darker + first / 2, black))
        bright = (direct + first > LIT_SIGMAS * noise) | ~torch.isfinite(noise)
        lit: Tensor = bright & (refined | ~unsure)
        return lit

    def _black(self, nodes: Tensor) -> Tensor:
        """Signal of black frames: the projector's and what a look saw of the room, (samples, spectra, 3)."""
        own = self.rig.projector_response.black_fraction * self._white(nodes, (0, *ORDERS))
        if self.view.black_dn_per_ms is None:
            return own
        return own + (like(np.array(self.view.black_dn_per_ms), own) - own.mean((0, 1))).clip(min=0)

    def _white(self, nodes: Tensor, orders: tuple[int, ...]) -> Tensor:
        """Signal under white through some orders, (samples, spectra, 3), DN per ms."""
        moments = sum(self.bands.moments[order].sum(1) for order in orders)
        white = torch.einsum("cj,srj->src", like(np.asarray(moments), nodes), nodes)
        return white * self.shading[:, None, None]
