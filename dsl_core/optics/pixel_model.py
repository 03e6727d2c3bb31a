"""The forward model: what a pixel receives from every order, band and frame of a pattern set.

For reflectance H at internal bands, frame k and colour c of a pixel::

    y_ck = shading * sum_m sum_j response_mcj G_k(q_m(j)) H_j

with G_k the light of frame k, averaged over a band, at the column q_m(j) that lights the pixel through order
m; for one line at x_k, its profile at q_m(j) - x_k. That is Eq. (6) of the supplement of "Dispersed
Structured Light" (Shin et al., CVPR 2024) with shading and blur.

The solver, the prediction, the intensity graph and the check for drift all read this one model: which columns
light a pixel through each order, which of them are inside the projector's frame, and how far blur,
demosaicing and the width of a band spread their light. Both first orders add where both reach. Internal bands
extend beyond the reported ones, because lines at the ends also collect light from outside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.correspondence import Correspondence, Footprint, like, zero_order
from dsl_core.optics.image_formation import BlurredProfiles, ImageFormation, OrderPath, one_if_grey
from dsl_core.optics.lines.equations import LineEquations
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.reach import sends_light
from dsl_core.optics.spectra import ORDERS, Bands
from dsl_core.optics.spread.field import relative_width

#: How far the light of a band or a line is spread, px: bands whose centre is this far outside the projector's
#: frame still belong to the model, and lines this far beyond a band still light it.
EDGE_PX = 8.0
#: Mean squared offset (camera px) of the samples that bilinear demosaicing averages.
DEMOSAIC_SPREAD = 0.4
#: Step of the logarithm of the width of lines that vary over the field: pixels of a tile share one.
WIDTH_STEP = 0.02
#: Relative error of the linear model (correspondence, profile, interpolation), added to each variance.
MODEL_ERROR = 0.01
#: Relative error granted to the zero-order colour as a constraint on the spectrum.
COLOUR_ERROR = 0.02
#: Relative error of the zero order in frames that light a pixel by several orders at once.
DIRECT_ERROR = 0.05


def demosaic_blur_px(columns_px: NDArray[np.floating]) -> float:
    """Spread of the projector columns that demosaicing averages, px.

    ``columns_px`` (..., pixels) are those of neighbouring pixels along the last axis, NaN where unknown.
    """
    pitch = np.abs(np.diff(columns_px, axis=-1))
    finite = pitch[np.isfinite(pitch)]
    return float(np.sqrt(DEMOSAIC_SPREAD) * np.median(finite)) if finite.size else 0.0


@dataclass(frozen=True)
class Traced:
    """Where the light of some pixels comes from.

    ``column_px`` (pixels,) is that of the zero order and ``direct`` whether it lights them; ``orders`` holds
    the footprint (bands, pixels) of each other order.
    """

    column_px: Tensor
    direct: Tensor
    orders: dict[int, Footprint]

    def part(self, which: slice | Tensor) -> Traced:
        """Some of the pixels, by a slice or their indices."""
        orders = {m: Footprint(f.columns[:, which], f.rows[:, which]) for m, f in self.orders.items()}
        return Traced(self.column_px[which], self.direct[which], orders)

    def displaced(self, shift_px: float) -> Traced:
        """All but the zero order displaced by some columns, as a film that has moved does it."""
        orders = {m: Footprint(f.columns + shift_px, f.rows) for m, f in self.orders.items()}
        return replace(self, orders=orders)


class PixelModel:
    """What a pixel receives, as a linear function of its reflectance, for one rig and pattern set."""

    def __init__(
        self,
        rig: Rig,
        bands: Bands,
        profiles: NDArray[np.float64],
        correspondence: Correspondence,
        lines: LineSet | None = None,
    ) -> None:
        """``profiles`` (frames, width, LEDs) are radiances relative to full drive.

        ``lines`` are given where the set consists of equally spaced ones.
        """
        self.rig, self.bands, self.correspondence, self.lines = rig, bands, correspondence, lines
        self.profiles = one_if_grey(profiles)
        #: Whether every frame shows one line, so that it lights a pixel by one order only.
        self.single = lines is not None and lines.single
        self._lights: dict[tuple[float, float, float, torch.dtype, torch.device], BlurredProfiles] = {}

    @property
    def orders(self) -> tuple[int, ...]:
        """The first orders; the second ones, too, where frames mix them with others."""
        return ORDERS if self.single else self.bands.orders

    def trace(
        self,
        pixels: Tensor,
        depth_mm: Tensor,
        column_px: Tensor | None = None,
        orders: Sequence[int] | None = None,
    ) -> Traced:
        """Where the light of pixels (flat indices) at a depth comes from.

        ``column_px`` (pixels,) is the zero order's where it was measured, and sets the precision; otherwise
        it follows from depth. ``orders`` are by default all but the zero order.
        """
        if column_px is None:
            zero = Footprint(*zero_order(self.rig, pixels, depth_mm))
            column_px, direct = zero.columns, self.inside(zero)
        else:
            direct = torch.ones_like(column_px, dtype=torch.bool)
        found = {}
        for order in self.orders if orders is None else orders:
            seen = self.correspondence.trace(pixels, depth_mm, order, self.bands.centroids_nm[order])
            found[order] = Footprint(seen.columns.to(column_px), seen.rows.to(column_px))
        return Traced(column_px, direct, found)

    def inside(self, footprint: Footprint, margin_px: float = EDGE_PX) -> Tensor:
        """Whether bands belong to the model: those just outside the frame still catch the outermost columns.

        Without a margin, whether their own column is inside.
        """
        lens = self.rig.projector
        return footprint.inside(lens.width_px, lens.height_px, margin_px)

    def reached(self, order: int, pixels: Tensor, depth_mm: Tensor, nm: NDArray[np.float64]) -> Tensor:
        """Whether wavelengths reach pixels through an order from inside the frame, (wavelengths, pixels)."""
        return self.reaches(order, self.correspondence.trace(pixels, depth_mm, order, nm), nm)

    def reaches(self, order: int, footprint: Footprint, nm: NDArray[np.float64]) -> Tensor:
        """The same of a footprint (wavelengths, pixels) that is known: the film must send them that way."""
        inside = self.inside(footprint, margin_px=0.0)
        return inside & torch.as_tensor(sends_light(self.rig, order, nm), device=inside.device)[:, None]

    def response(self, blur_px: float) -> ProjectorResponse:
        """The projector's response, blurred further: demosaicing averages neighbours, which widens lines."""
        return self.rig.projector_response.blurred(blur_px)

    def operator(
        self, traced: Traced, shading: Tensor, blur_px: float = 0.0, orders: Sequence[int] | None = None
    ) -> ImageFormation:
        """From reflectance (bands, pixels) to DN per ms (3, frames, pixels): forward and matrix.

        ``blur_px`` is that of demosaicing; ``orders`` are by default the zero order and all that were traced.
        """
        paths = []
        for order in (0, *traced.orders) if orders is None else orders:
            moments = self.bands.moments[order]
            if order == 0:
                paths.append(OrderPath(traced.column_px[None], traced.direct[None], moments, 0.0))
            else:
                footprint = traced.orders[order]
                half = self.bands.half_width_px(footprint.columns)
                paths.append(OrderPath(footprint.columns, self.inside(footprint), moments, half))
        response, profiles = self.response(blur_px), self.profiles
        return ImageFormation(response, profiles, paths, shading, lambda px: self.light(px, shading, blur_px))

    def equations(
        self, traced: Traced, colour: Tensor, radiance: Tensor, weight: Tensor, offset_variance: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Normal equations of unit shading for any pattern set, all orders together, of one colour each.

        Full matrix (bands, bands, pixels), right side (bands, pixels) and weighted sum of squares (pixels,).
        ``colour`` (pixels,) is that of their filters, 0 to 2; ``radiance`` and ``weight`` are (frames,
        pixels), ``offset_variance`` (pixels,) that of an offset which all frames share.
        """
        model = self.operator(traced, torch.ones_like(traced.column_px)).matrix_of(colour)
        w, y = (values.T[..., None] for values in (weight, radiance))
        model, y = (without_offset(values, w, offset_variance) for values in (model, y))
        weighted = model * w
        matrix, right = weighted.mT @ model, (weighted.mT @ y)[..., 0]
        return matrix.permute(1, 2, 0), right.T, (w * y * y).sum((1, 2))

    def line_equations(self, colour: Tensor, other: Tensor, offsets: bool = False) -> LineEquations:
        """Banded normal equations of unit shading, to which the orders of single lines are added.

        Each pixel has the one ``colour`` (pixels,) of its filter; ``other`` and ``offsets`` as for
        `LineEquations`.
        """
        assert self.lines is not None
        spread = self.rig.projector_response.line_spread
        return LineEquations(self.bands, self.lines, spread, colour, other, offsets)

    def width(self, footprint: Footprint, inside: Tensor) -> float:
        """How much wider than the usual one lines are where the bands (bands, pixels) that are inside lie."""
        field = self.rig.projector_response.field
        if field is None or not bool(inside.any()):
            return 1.0
        typical = relative_width(field, footprint.columns[inside], footprint.rows[inside]).log().mean()
        return math.exp(round(float(typical) / WIDTH_STEP) * WIDTH_STEP)

    def widths(self, footprint: Footprint, inside: Tensor) -> Tensor:
        """How much wider than the usual one lines are where the inside bands of each pixel lie, (pixels,)."""
        field = self.rig.projector_response.field
        if field is None:
            return torch.ones_like(footprint.columns[0])
        each = relative_width(field, footprint.columns, footprint.rows).log()
        typical = torch.where(inside, each, 0.0).sum(0) / inside.sum(0).clip(min=1)
        return ((typical / WIDTH_STEP).round() * WIDTH_STEP).exp()

    def frames(self, columns_px: Tensor, inside: Tensor) -> range:
        """Frames of single lines that light any band (bands, pixels) that is inside; empty when none does."""
        assert self.lines is not None
        if not bool(inside.any()):
            return range(0)
        low = float(torch.where(inside, columns_px, torch.inf).amin())
        high = float(torch.where(inside, columns_px, -torch.inf).amax())
        margin = self.lines.width_px / 2 + EDGE_PX
        return self.lines.near(low - margin, high + margin)

    def light(
        self, band_px: float, other: Tensor, blur_px: float = 0.0, width: float = 1.0
    ) -> BlurredProfiles:
        """The light of all frames, blurred by a band's half width, in the precision of another tensor.

        Lines are spread ``width`` times as wide as usual. Half widths are few, and each takes long to blur
        by, so that the light is kept.
        """
        key = blur_px, band_px, width, other.dtype, other.device
        if key not in self._lights:
            response = self.response(blur_px)
            response = response if width == 1.0 else response.of_width(width * response.blur_px)
            self._lights[key] = BlurredProfiles(response, self.profiles, band_px, other)
        return self._lights[key]

    def zero_light(self, other: Tensor, blur_px: float = 0.0) -> BlurredProfiles:
        """The zero order's light of all frames, in the precision of another tensor."""
        return self.light(0.0, other, blur_px)

    def zero_moments(self, other: Tensor) -> Tensor:
        """Response to the zero order, (3, LEDs, bands); grey patterns light all LEDs as one."""
        moments = like(self.bands.moments[0], other)
        return moments.sum(1, keepdim=True) if self.profiles.shape[2] == 1 else moments

    def direct_light(self, light: BlurredProfiles, column_px: Tensor, colour: Tensor) -> Tensor:
        """Largest zero-order light within a column of each pixel's, (3, frames, pixels), DN per ms.

        The edges of lines are where a small error of the column or the blur matters most. ``colour``
        (3, pixels) is the zero order under white.
        """
        lit = torch.stack([light.at(column_px + shift) for shift in (-1.0, 0.0, 1.0)]).amax(0)
        return torch.einsum("clp,plf->cfp", self._by_led(colour), lit)

    def _by_led(self, colour: Tensor) -> Tensor:
        """Zero-order colour (3, pixels) as what each LED adds, (3, LEDs, pixels).

        An LED that is dark at a pixel's column spoils none of its frames. Reflectance counts as constant over
        the light of one LED.
        """
        if self.profiles.shape[2] == 1:
            return colour[:, None]
        white = like(self.bands.moments[0].sum(2), colour)
        reflectance = (torch.linalg.pinv(white) @ colour).clip(min=0)
        parts: Tensor = white[:, :, None] * reflectance
        return parts


def without_offset(values: Tensor, weight: Tensor, variance: Tensor) -> Tensor:
    """Values (..., frames, n) less as much of their mean as an unknown offset of all frames takes of it.

    ``weight`` (..., frames, 1) is theirs, ``variance`` (...) the offset's. The normal equations of such a
    model and such data are those with the offset as one more unknown, eliminated, and stay positive in any
    precision.
    """
    total = weight.sum(-2, keepdim=True)
    mean = (weight * values).sum(-2, keepdim=True) / total.clip(min=1e-30)
    share = 1 - (1 + variance[..., None, None] * total).rsqrt()
    return values - share * mean
