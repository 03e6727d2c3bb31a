"""The width of the line spread over the projector's frame, found from lines at many places.

Each pixel says how much wider than the common one the spread is at its own place; amplitude and column are
eliminated. A polynomial of low order in column and row brings thousands of these noisy answers together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.projector.spread_field import POWERS, SpreadField
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.correspondence import of_colours, triangulate, zero_order
from dsl_core.optics.lines.profile import LineTable
from dsl_core.optics.spread.equations import MAX_SHIFT_PX, MIN_PIXELS, MODEL_ERROR, View, settle, unit

Floats = NDArray[np.float64]
#: Places on the part of the frame that was measured, x and y from -1 to 1.
Places = tuple[tuple[int, int], ...]
#: Steps of the fit, the longest of a pixel's logarithm of the width, and that of its derivative.
STEPS, LONGEST, STEP = 5, 0.3, 0.05
#: The widest and the narrowest spread, relative to the usual one.
RANGE = (0.4, 2.5)
#: Deviation of the logarithm of the width before any line is seen.
PRIOR_STD = 0.3
#: Scatter of the logarithm of the width that matters, and how many of its deviations it must have.
MATTERS, SIGMAS = 0.01, 4.0
#: Share of the pixels beyond each end of the places that count as measured.
ENDS = (0.002, 0.998)
#: Powers up to the second.
TERMS = 6
#: Squares of a pixel count by its noise up to so many times the usual chi-square, and ever less above.
USUAL = 2.0


def relative_width(field: SpreadField, column_px: Tensor, row_px: Tensor) -> Tensor:
    """How much wider than the usual one the spread is at places (px), same shape; 1 where they are NaN."""
    x, y = (
        ((place - centre) / half).clip(-1, 1)
        for place, centre, half in zip((column_px, row_px), field.centre_px, field.half_px, strict=True)
    )
    known = zip(field.coefficients, POWERS, strict=False)
    total = torch.zeros_like(column_px)
    for coefficient, (i, j) in known:
        total = total + coefficient * x**i * y**j
    return total.nan_to_num(0.0).exp().clip(*RANGE)


def places_of(rig: Rig, pixels: Tensor, column_px: Tensor) -> Tensor:
    """Column and row (px) on the projector of pixels (flat indices) by their columns, (2, pixels)."""
    depth_mm, _ = triangulate(rig, pixels, column_px.double())
    return torch.stack([column_px.double(), zero_order(rig, pixels, depth_mm)[1]])


def widths_at(rig: Rig, pixels: Tensor, column_px: Tensor) -> Tensor | None:
    """Relative widths of the spread at pixels by their columns; None where one width holds for all."""
    field, colours = rig.projector_response.field, rig.projector_response.colour_widths
    by_colour = None if colours is None else of_colours(colours, rig, pixels, column_px)
    if field is None:
        return by_colour
    by_place = relative_width(field, *places_of(rig, pixels, column_px)).to(column_px)
    return by_place if by_colour is None else by_place * by_colour


@dataclass(frozen=True)
class FieldFit:
    """A field, the covariance of its coefficients, and the relative ``width`` (P,) at the fitted pixels.

    ``std`` is what chance alone makes of the scatter of the logarithm of the width.
    """

    field: SpreadField
    covariance: Floats
    width: Tensor
    std: float

    def matters(self, known: Tensor | None = None) -> bool:
        """Whether widths differ from known ones, or among each other, by more than chance and enough."""
        change = self.width.log() if known is None else (self.width / known).log()
        scatter = float((change - change.mean()).square().mean().sqrt())
        return scatter > max(MATTERS, SIGMAS * self.std)

    def contrast(self, here: Places, there: Places) -> tuple[float, float]:
        """Mean logarithm of the width here less that there, and its deviation; places from -1 to 1."""
        powers = POWERS[: len(self.field.coefficients)]
        a, b = (np.mean([[x**i * y**j for i, j in powers] for x, y in places], 0) for places in (here, there))
        return float((a - b) @ self.field.coefficients), math.sqrt(float((a - b) @ self.covariance @ (a - b)))


class FieldFamily:
    """All fields over the places (column and row, px) of some pixels, (2, P)."""

    def __init__(self, place_px: Tensor) -> None:
        known = torch.isfinite(place_px).all(0)
        low, high = (place_px[:, known].nan_to_num().quantile(q, 1) for q in ENDS)
        self._place, self._known = place_px, known
        self._centre = (low + high) / 2
        self._half = ((high - low) / 2).clip(min=1.0)
        at = ((place_px - self._centre[:, None]) / self._half[:, None]).clip(-1, 1).nan_to_num()
        self._shapes = torch.stack([at[0] ** i * at[1] ** j for i, j in POWERS[:TERMS]], -1)

    def widths(self, field: SpreadField) -> Tensor:
        """Relative widths at the places, (P,)."""
        return relative_width(field, self._place[0], self._place[1])

    def fit(self, view: View, response: ProjectorResponse) -> FieldFit | None:
        """The field that the lines ask for, with a usual width of one; None where too few pixels tell."""
        peaks, run = view.peaks, view.peaks.run
        shapes = self._shapes
        prior = torch.eye(shapes.shape[1]).to(shapes) / PRIOR_STD**2
        width = torch.ones_like(view.column) if view.width is None else view.width
        found = torch.linalg.lstsq(shapes, width.log()[:, None]).solution[:, 0]
        column, amplitude = view.column, view.amplitude
        for _ in range(STEPS):
            width = (shapes @ found).clip(*(math.log(w) for w in RANGE)).exp()
            column, amplitude, chi_square = settle(peaks, column, amplitude, response, width)
            score, information = _single(view, column, amplitude, response, width)
            used = self._known & (amplitude > 0) & torch.isfinite(column) & torch.isfinite(chi_square)
            used &= ((column - view.start_px).abs() < MAX_SHIFT_PX) & torch.isfinite(score * information)
            if int(used.sum()) < MIN_PIXELS:
                return None
            usual = USUAL * max(float(chi_square[used].median()), 1.0)
            weight = torch.where(used, 1 / (chi_square / usual).clip(min=1), 0.0)
            information, score = (torch.where(used, v, 0.0) * weight for v in (information, score))
            heavy = (shapes * information[:, None]).T
            inverse = torch.linalg.inv(heavy @ shapes + prior)
            change = inverse @ (shapes.T @ score)
            longest = float((shapes @ change).abs().max())
            found = found + change * min(1.0, LONGEST / max(longest, 1e-12))
            if longest < 0.003:
                break
        left = (score - information * (shapes @ change))[:, None] * shapes
        common = left.reshape(-1, run, shapes.shape[1]).sum(1)
        # Scatter alone is blind where each pixel sees no more lines than it has unknowns, and fits them
        # exactly: there only the errors that are stated say how little is known of the width.
        covariance = inverse @ (common.T @ common) @ inverse + inverse
        # A width that all share belongs to the curve.
        found[0] -= float((shapes @ found)[used].mean())
        apart = shapes[used] - shapes[used].mean(0)
        std = math.sqrt(float((apart @ covariance * apart).sum(1).mean()))
        centre, half = ((float(a), float(b)) for a, b in (self._centre, self._half))
        field = SpreadField(centre_px=centre, half_px=half, coefficients=tuple(found.tolist()))
        return FieldFit(field, covariance.numpy(), self.widths(field), std)


def _single(
    view: View, column: Tensor, amplitude: Tensor, response: ProjectorResponse, width: Tensor
) -> tuple[Tensor, Tensor]:
    """What each pixel asks of the logarithm of its own width: score and information, each (P,)."""
    peaks = view.peaks
    distance = column - peaks.centres
    reach = float(distance.abs().max()) + 1
    (g, slope), (wider, _), (narrower, _) = (
        LineTable(peaks.width_px, response, reach, column, width * math.exp(by)).at(distance)
        for by in (0.0, STEP, -STEP)
    )
    root = (peaks.variance + (MODEL_ERROR * amplitude) ** 2).rsqrt()
    residual = (peaks.y - amplitude * g) * root
    change = amplitude * (wider - narrower) * root / (2 * STEP)
    for own in (g * root, slope * root - unit(g * root) * (unit(g * root) * slope * root).sum(0)):
        taken = unit(own)
        change = change - taken * (taken * change).sum(0)
        residual = residual - taken * (taken * residual).sum(0)
    return (change * residual).sum(0), (change * change).sum(0)
