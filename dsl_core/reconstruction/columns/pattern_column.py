"""The projector column of a pixel from any set of column patterns, by its zero order.

A pixel sees ``y_k = sum_l a_l g_lk(q)``: the patterns of the three LEDs, blurred, with halo, at its column.
First orders, a few percent of that, are those of a grey surface; what a coloured one changes is allowed for.
For each candidate column around the decoded one the amplitudes follow by non-negative weighted least squares
with one unknown a LED, or one for all where patterns are grey; the best candidate and its neighbours give the
column by a parabola.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence, like, triangulate
from dsl_core.optics.image_formation import BlurredProfiles, one_if_grey
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import ORDERS, Bands
from dsl_core.patterns.images import drive_levels, spectral_profiles
from dsl_core.reconstruction.columns.column import MAX_CHI_SQUARE, Column
from dsl_core.reconstruction.hdr import setting_gains_ms

#: Candidates reach this far from the decoded column, in steps of, px.
REACH_PX, STEP_PX = 1.0, 0.125
#: Relative error of the zero-order model: first orders of other columns are under it.
DIRECT_ERROR = 0.02
#: Light of a pattern, relative to full drive, that may saturate a setting.
BRIGHT_SHARE = 0.05
#: Keeps the amplitudes of LEDs apart that a set cannot tell apart, relative to its strongest.
RIDGE = 1e-4
#: Bands that the first orders' light of a grey surface is summed over.
GRID = WavelengthGrid(step_nm=10.0)


def radiance_profiles(rig: Rig, plan: CapturePlan) -> NDArray[np.float64]:
    """Spectral patterns as radiances above black relative to full drive, (frames, width, LEDs).

    Each setting rounds the drive levels of grey in its own way; what counts is the light of all together, as
    in a merge of settings whose noise is that of their light.
    """
    gains_ms = setting_gains_ms(plan.settings, rig.projector_response)
    light = sum(
        setting.exposure_ms * shown for setting, shown in zip(plan.settings, _shown(rig, plan), strict=True)
    )
    return np.asarray(light / gains_ms.sum())


def rounding_error(rig: Rig, plan: CapturePlan) -> float:
    """Largest relative error of `radiance_profiles` for the light of a single setting; 0 for lines and combs.

    It counts where the other settings are saturated, so only where patterns are not dark.
    """
    merged = radiance_profiles(rig, plan)
    bright = merged > BRIGHT_SHARE
    gains_ms = setting_gains_ms(plan.settings, rig.projector_response)
    errors = [
        np.abs(setting.exposure_ms * shown[bright] / (gain_ms * merged[bright]) - 1).max(initial=0.0)
        for setting, shown, gain_ms in zip(plan.settings, _shown(rig, plan), gains_ms, strict=True)
        if gain_ms > 0
    ]
    return max((float(error) for error in errors), default=0.0)


def _shown(rig: Rig, plan: CapturePlan) -> Iterator[NDArray[np.float64]]:
    """Radiance above black that each setting shows, relative to full drive, (frames, width, LEDs)."""
    profiles, response = spectral_profiles(plan), rig.projector_response
    for setting in plan.settings:
        yield response.radiance(drive_levels(profiles, setting.level) / 255.0) - response.radiance(0.0)


def refine_by_profiles(
    coarse_px: Tensor,
    radiance: Tensor,
    std: Tensor,
    profiles: NDArray[np.float64],
    response: ProjectorResponse,
    first_orders: Tensor | None = None,
) -> Column:
    """Refine decoded columns (pixels,) from ``radiance`` and ``std`` (frames, pixels), DN per ms.

    ``profiles`` (frames, width, LEDs) are radiances relative to full drive. Where the fit fails, the decoded
    column stays with the deviation of a whole pixel, as for lines. The amplitude is that of white.
    ``first_orders`` (pixels, LEDs, frames) are their light for an amplitude of one, see `first_order_share`;
    neighbouring columns share it.
    """
    profiles = one_if_grey(profiles)
    light = BlurredProfiles(response, profiles, 0.0, radiance)
    y, s = radiance.T, std.T.to(radiance)
    usable = torch.isfinite(s) & torch.isfinite(y)
    y = torch.where(usable, y, 0.0)
    # The brightest usable frame stands for the scale that a share of is granted as error.
    scale = y.amax(1, keepdim=True).clip(min=0)
    weight = torch.where(usable, 1 / (s**2 + (DIRECT_ERROR * scale) ** 2), 0.0)
    others = 0.0 if first_orders is None else first_orders
    shifts = torch.arange(-REACH_PX, REACH_PX + STEP_PX / 2, STEP_PX).to(coarse_px)
    fits = [_fit(light.at(coarse_px + shift) + others, y, weight) for shift in shifts]
    cost = torch.stack([fit[0] for fit in fits])
    best = cost.argmin(0).clip(1, len(shifts) - 2)
    left, middle, right = (cost.gather(0, (best + i)[None])[0] for i in (-1, 0, 1))
    curvature = ((left - 2 * middle + right) / STEP_PX**2).clip(min=1e-12)
    move = (0.5 * (left - right) / (STEP_PX * curvature)).clip(-STEP_PX, STEP_PX)
    amplitudes = torch.stack([fit[1] for fit in fits])
    amplitude = amplitudes.gather(0, best[None])[0]
    freedom = (weight > 0).sum(1) - (profiles.shape[2] + 1)
    chi_square = middle / freedom.clip(min=1)
    std_px = (2 / curvature * chi_square.clip(min=1)).sqrt()
    good = (freedom > 1) & (amplitude > 0) & (chi_square < MAX_CHI_SQUARE) & (std_px < 1 / math.sqrt(12))
    inner = (cost.argmin(0) > 0) & (cost.argmin(0) < len(shifts) - 1)
    good &= inner
    return Column(
        torch.where(good, coarse_px + shifts[best] + move, coarse_px),
        torch.where(good, std_px, torch.full_like(coarse_px, 1 / math.sqrt(12))),
        amplitude,
        torch.where(good, amplitude.abs() * DIRECT_ERROR, torch.inf),
        good,
        torch.zeros_like(good),
        torch.isinf(s).any(1),
    )


def _fit(light: Tensor, y: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Weighted squares left by the best amplitudes, and their sum, each (pixels,).

    ``light`` is (pixels, LEDs, frames).
    """
    weighted = light * weight[:, None]
    normal = weighted @ light.mT
    leds = normal.shape[1]
    ridge = RIDGE * torch.diagonal(normal, dim1=1, dim2=2).amax(1).clip(min=1e-12)
    normal = normal + ridge[:, None, None] * torch.eye(leds).to(normal)
    right = (weighted @ y[..., None])[..., 0]
    amplitude = torch.linalg.solve(normal, right)
    residual = y - torch.einsum("pl,plf->pf", amplitude, light)
    return (weight * residual**2).sum(1), amplitude.sum(1)


def first_order_share(rig: Rig, profiles: NDArray[np.float64], pixels: Tensor, column_px: Tensor) -> Tensor:
    """First orders of a grey surface over its zero order under one LED, (pixels, LEDs, frames).

    ``pixels`` are flat indices of the mosaic, each seen in its own colour, lit directly from ``column_px``;
    ``profiles`` (frames, width, LEDs) are radiances relative to full drive, of one LED where all are alike.
    Zero where the column meets no ray.
    """
    depth, _ = triangulate(rig, pixels, column_px.double())
    met = torch.isfinite(depth)
    depth = torch.where(met, depth, sum(rig.depth_range_mm) / 2)
    y, x = pixels // rig.camera.width_px, pixels % rig.camera.width_px
    own = torch.as_tensor(bayer_channels(rig.sensor.bayer, 2, 2)).to(pixels.device)[y % 2, x % 2].long()
    model = PixelModel(rig, Bands.of(rig, GRID), profiles, correspondence(rig))
    traced = model.trace(pixels, depth, column_px, ORDERS)
    operator = model.operator(traced, met.to(column_px), orders=ORDERS)
    zero = like(model.bands.moments[0].sum(2), column_px)
    if profiles.shape[2] == 1:
        zero = zero.sum(1, keepdim=True)
    found = torch.zeros((len(pixels), profiles.shape[2], len(profiles))).to(column_px)
    for _, light, moments in operator.terms():
        found += light * (moments[..., 0] / zero)[own][..., None]
    return found
