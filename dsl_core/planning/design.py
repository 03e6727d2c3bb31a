"""Pattern sets by design: levels of every column and LED that minimise the expected posterior error.

The model is the reconstruction's (see `virtual`), differentiable in the patterns: drive levels 0..1 become
radiance by the projector's gamma, are blurred, and reach a sample through all orders. The noise is the
bracket's, saturation included, so that the design learns to keep the bright zero order out of the way. The
loss is the trace of the posterior covariance of band means, for random smooth reflectances at random places
and depths, plus what spectra make of light that an uncertain column moves. Levels are rounded to what a
projector of 8 bit can show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, Columns, LineComb
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence, like, zero_order
from dsl_core.optics.image_formation import BlurredProfiles
from dsl_core.patterns.multiplexed import profiles
from dsl_core.planning.noise import Bracket
from dsl_core.planning.views import plane_view
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction import pattern_column
from dsl_core.reconstruction.spectra import DIRECT_ERROR, EDGE_PX, MODEL_ERROR
from dsl_core.reconstruction.spectral_solver import Prior, band_mean, roughness
from dsl_core.reconstruction.spectral_system import Bands, band_halfwidth_px
from dsl_core.solve import banded

#: Where samples lie: depths in mm, and samples across and down each plane.
DEPTHS_MM, SAMPLES = (600.0, 700.0, 800.0), (10, 3)
#: Deviation of second differences that posterior errors are taken under; of chart spectra at 5 nm.
TAU = 0.012
#: Deviation of a column that was not refined.
UNREFINED_PX = 12**-0.5
#: A bilinear mosaic's mean variance of a colour, relative to a sample's.
DEMOSAIC = 0.5
#: How softly a setting saturates in the search, as a share of full scale.
SOFT = 0.02


@dataclass(frozen=True)
class DesignOptions:
    """How to search: steps of Adam, samples and spectra a step, seed of the draws.

    Gradients below ``floor`` move a level less than the learning rate, so that dark columns stay dark. A
    ``grey`` set lights the three LEDs alike.
    """

    steps: int = 600
    samples: int = 8
    spectra: int = 2
    learning_rate: float = 0.005
    floor: float = 1e-5
    grey: bool = True
    seed: int = 1


@dataclass(frozen=True)
class Design:
    """Levels (frames, width, 3), 8 bit, and the loss along the search."""

    levels: NDArray[np.uint8]
    losses: tuple[float, ...]

    @property
    def loss_start(self) -> float:
        """Mean loss of the first twentieth of the search."""
        return float(np.mean(self.losses[: max(len(self.losses) // 20, 1)]))

    @property
    def loss(self) -> float:
        """Mean loss of the last twentieth."""
        return float(np.mean(self.losses[-max(len(self.losses) // 20, 1) :]))

    @property
    def columns(self) -> Columns:
        """The set as it stands in a plan."""
        return columns_of(self.levels)


def columns_of(levels: NDArray[np.uint8]) -> Columns:
    """Drive levels (frames, width, 3), 0 to 255, as a pattern set."""
    shares = np.round(levels / 255.0, 5)
    return Columns(levels=tuple(tuple(tuple(rgb) for rgb in frame) for frame in shares.tolist()))


def starting_comb(frames: int) -> LineComb:
    """The comb that a search of ``frames`` patterns starts from; raises `PlanError`.

    Among combs of 16, 32 and 64 frames these were predicted to be best, or nearly, on the published rig: the
    two edges of their lines fall on different columns.
    """
    if not 8 <= frames <= 160:
        raise PlanError(f"A set of {frames} patterns cannot be designed; choose 8 to 160.")
    step = 2 if frames >= 48 else 4
    return LineComb(width_px=5 if step == 2 else 6, step_px=step, period_px=step * frames)


class Samples:
    """Linear maps from columns to light at samples of several planes."""

    def __init__(self, rig: Rig, plan: CapturePlan, grid: WavelengthGrid) -> None:
        self.rig, self.bands, self.bracket = rig, Bands.of(rig, grid), Bracket.of(rig, plan)
        width = rig.projector.width_px
        eye = np.eye(width)[..., None]
        first, zero, near, slope, shading = [], [], [], [], []
        for depth_mm in DEPTHS_MM:
            view = plane_view(rig, depth_mm, SAMPLES)
            pixels, depth = torch.as_tensor(view.pixels), torch.as_tensor(view.depth_mm)
            column = zero_order(rig, pixels, depth)[0].float()
            direct = BlurredProfiles(rig.projector_response, eye, 0.0, column)
            at = [direct.at(column + shift)[:, 0] for shift in (-1.0, -0.1, 0.0, 0.1, 1.0)]
            zero.append(at[2])
            near.append(torch.stack([at[0], at[2], at[4]], 1))
            slope.append((at[3] - at[1]) / 0.2)
            shading.append(torch.as_tensor(view.shading, dtype=torch.float32))
            orders = [self._order(order, pixels, depth, eye) for order in self.bands.orders]
            first.append(torch.stack(orders, 1))
        self.first, self.zero, self.near, self.slope, self.shading = (
            torch.cat(parts) for parts in (first, zero, near, slope, shading)
        )
        self.moments = torch.stack([like(self.bands.moments[m], self.zero) for m in self.bands.orders])
        self.moments_zero = like(self.bands.moments[0], self.zero)

    def _order(self, order: int, pixels: Tensor, depth: Tensor, eye: NDArray[np.float64]) -> Tensor:
        """Light of each band through an order per column of the projector, (samples, bands, width)."""
        traced = correspondence(self.rig).trace(pixels, depth, order, self.bands.centroids_nm[order])
        columns = traced.columns.float()
        lens = self.rig.projector
        inside = traced.inside(lens.width_px, lens.height_px, margin_px=EDGE_PX)
        half = band_halfwidth_px(columns, self.bands.step_nm, self.bands.centres_nm)
        blurred = BlurredProfiles(self.rig.projector_response, eye, half, columns)
        rows = [blurred.at(c)[:, 0] * i[:, None] for c, i in zip(columns, inside, strict=True)]
        return torch.stack(rows, 1)

    def loss(self, radiance: Tensor, at: Tensor, reflectance: Tensor, prior: Tensor, means: Tensor) -> Tensor:
        """Expected squared error of band means at samples ``at`` for reflectances (samples, n, bands).

        ``radiance`` is (width, frames, LEDs), relative to full drive.
        """
        first = self._first_orders(radiance, at)
        zero = torch.einsum("sx,xfl->sfl", self.zero[at], radiance)
        direct = torch.einsum("sfl,clj->scfj", zero, self.moments_zero) * self.shading[at, None, None, None]
        whole = first + direct
        y = torch.einsum("scfj,snj->sncf", whole, reflectance)
        colour = (
            torch.einsum("clj,snj->sncl", self.moments_zero, reflectance) * self.shading[at, None, None, None]
        )
        lit = torch.einsum("snx,xfl->snfl", self.near[at], radiance).amax(1)
        dazzle = torch.einsum("sncl,sfl->sncf", colour, lit)
        variance = DEMOSAIC * self._variance(y) + (MODEL_ERROR * y) ** 2
        variance = variance + (DIRECT_ERROR * dazzle) ** 2
        root = variance.rsqrt()
        rows = (whole[:, None] * root[..., None]).flatten(2, 3)
        inverse = torch.linalg.inv(rows.mT @ rows + prior)
        spread = torch.einsum("ij,snjk,ik->sni", means, inverse, means)[..., self.bands.reported].mean(-1)
        # A wrong column moves the light of all orders, which the spectrum answers.
        slope = torch.einsum("sx,xfl->sfl", self.slope[at], radiance)
        moved = torch.einsum("sncl,sfl->sncf", colour, slope)
        drawn = self._first_orders(torch.gradient(radiance, dim=0)[0], at)
        moved = ((moved + torch.einsum("scfj,snj->sncf", drawn, reflectance)) * root).flatten(2, 3)
        answer = means @ inverse @ (rows.mT @ moved[..., None])
        per_px = answer[..., self.bands.reported, 0].square().mean(-1)
        loss: Tensor = spread + per_px * self._column_variance(slope, zero, colour, y)
        return loss

    def _first_orders(self, radiance: Tensor, at: Tensor) -> Tensor:
        """Operator of the first orders, (samples, channels, frames, bands)."""
        light = torch.einsum("smjx,xfl->smjfl", self.first[at], radiance)
        return torch.einsum("smjfl,mclj->scfj", light, self.moments) * self.shading[at, None, None, None]

    def _column_variance(self, slope: Tensor, zero: Tensor, colour: Tensor, y: Tensor) -> Tensor:
        """Variance of the refined column (px^2), mean over the colours of the mosaic, (samples, spectra).

        Amplitude and column are fitted together, as `pattern_column` does; what the amplitude explains of a
        shift tells nothing of the column. Grey patterns have one amplitude.
        """
        white = colour.sum(-1)[..., None]
        change = torch.einsum("sncl,sfl->sncf", colour, slope)
        level = torch.einsum("sncl,sfl->sncf", colour, zero)
        weight = 1 / (self._variance(y) + (pattern_column.DIRECT_ERROR * white) ** 2)
        both, square = (weight * change * level).sum(-1), (weight * level**2).sum(-1)
        known = (weight * change**2).sum(-1) - both**2 / square.clip(min=1e-9)
        return (1 / (known + UNREFINED_PX**-2)).mean(2)

    def _variance(self, radiance: Tensor) -> Tensor:
        """As `Bracket.variance`, with settings that saturate smoothly."""
        sensor = self.bracket.sensor
        limit, total = 0.98 * sensor.full_scale_dn - sensor.black_level_dn, torch.full_like(radiance, 1e-9)
        for gain in self.bracket.gains_ms:
            signal = (radiance * gain).clip(min=0)
            usable = torch.sigmoid((limit - signal) / (SOFT * sensor.full_scale_dn))
            total = total + usable * gain**2 / (self.bracket.floor + signal / sensor.electrons_per_dn)
        return 1 / total


def design(
    rig: Rig,
    plan: CapturePlan,
    frames: int,
    *,
    grid: WavelengthGrid | None = None,
    options: DesignOptions | None = None,
    progress: Progress | None = None,
) -> Design:
    """Search ``frames`` patterns for a rig and the settings of a plan; raises `PlanError`.

    The answer depends on the rig, the settings and the options alone.
    """
    options, progress = options or DesignOptions(), progress or NoProgress()
    grid = grid or WavelengthGrid()
    samples = Samples(rig, plan, grid)
    start = torch.as_tensor(profiles(starting_comb(frames), rig.projector.width_px))
    # Radiance is searched, not level: at dark columns the gradient of a level vanishes.
    radiance = start.permute(1, 0, 2).contiguous().requires_grad_()
    prior, means = _prior(samples.bands.count)
    draw = torch.Generator().manual_seed(options.seed)
    adam = torch.optim.Adam([radiance], lr=options.learning_rate, betas=(0.9, 0.99), eps=options.floor)
    decay = torch.optim.lr_scheduler.CosineAnnealingLR(adam, options.steps, options.learning_rate / 20)
    losses = []
    for step in range(options.steps):
        at = torch.randint(len(samples.zero), (options.samples,), generator=draw)
        spectra = random_reflectances((options.samples, options.spectra), samples.bands, draw)
        loss = samples.loss(radiance, at, spectra, prior, means).sqrt().mean()
        adam.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        adam.step()
        decay.step()
        with torch.no_grad():
            if options.grey:
                radiance.copy_(radiance.mean(2, keepdim=True).expand_as(radiance))
            radiance.clip_(0, 1)
        losses.append(float(loss.detach()))
        progress.report("design", step + 1, options.steps)
    shown = radiance.detach().permute(1, 0, 2).numpy() ** (1 / rig.projector_response.gamma)
    return Design(np.round(255 * shown).astype(np.uint8), tuple(losses))


def _prior(bands: int) -> tuple[Tensor, Tensor]:
    """The solver's prior at one strength as a full matrix, and the matrix of band means."""
    like_this = torch.zeros(1)
    shape = banded.to_dense(roughness(bands, like_this)[..., None])[0]
    eye = torch.eye(bands)
    return shape * TAU**-2 + eye * Prior().level_std ** -2, band_mean(eye)


def random_reflectances(count: tuple[int, int], bands: Bands, draw: torch.Generator) -> Tensor:
    """Smooth reflectances (samples, n, bands), 0.02 to 0.95: a few cosines over wavelength in a sigmoid."""
    nm = like(bands.centres_nm, torch.zeros(1))
    x = (nm - nm[0]) / (nm[-1] - nm[0])
    waves = torch.stack([torch.cos(np.pi * k * x) for k in range(8)])
    size = torch.tensor([1.6, 1.5, 1.2, 0.9, 0.6, 0.4, 0.3, 0.2])
    weights = torch.randn((*count, 8), generator=draw) * size
    return 0.02 + 0.93 * torch.sigmoid(weights @ waves - 0.4)
