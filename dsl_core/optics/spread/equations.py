"""What lines say of the shares of a line spread: each pixel's amplitude and column are its own.

A pixel at column q sees ``y_k = a (g(q - x_k) + halo)`` of the line at x_k. The profile g is the line's box
times the spread, and the spread is a sum of narrow Gaussians, so that y is linear in their shares. Where the
spread is wider, all its distances are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import ndtr
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import LineTable, halo_integral
from dsl_core.optics.spread.curves import SAMPLES, EvenTable
from dsl_core.optics.spread.wave import column_wave

Floats = NDArray[np.float64]
#: Distance between the Gaussians of a curve, px.
STEP_PX = 0.125
#: Steps of each pixel's amplitude and column between those of the curve, and the longest, px.
SETTLING, LONGEST_PX = 3, 0.5
#: Relative error of a modelled profile, added to each variance.
MODEL_ERROR = 0.0015
#: A pixel whose chi-square is so many times the others' sees something else.
MAX_CHI_SQUARE = 5.0
MAX_SHIFT_PX = 2.0
#: Deviation of a column of which nothing is known.
FREE_PX = 1e3
MIN_PIXELS = 200


@dataclass(frozen=True)
class Peaks:
    """Lines around the zero order of pixels, (window, P): values, variances (infinite: unused), centres (px).

    Each ``run`` pixels are neighbours of a row. ``width_px`` and ``step_px`` are those of the lines.
    """

    y: Tensor
    variance: Tensor
    centres: Tensor
    width_px: int
    step_px: int
    run: int

    def of(self, pixels: Tensor) -> Peaks:
        """Some of the pixels."""
        return replace(
            self,
            y=self.y[:, pixels],
            variance=self.variance[:, pixels],
            centres=self.centres[:, pixels],
        )


@dataclass(frozen=True)
class Fixed:
    """Light farther out than lines tell: Gaussians ``STEP_PX`` wide at ``centres_px``, with ``shares``."""

    centres_px: Floats
    shares: Floats

    def light(self, width_px: int, distance_px: Tensor, width: Tensor | None) -> Tensor:
        """What it adds to a line of ``width_px`` at distances (window, P); ``width`` as in `View`."""
        near = np.abs(self.centres_px) < float(distance_px.abs().max()) + width_px / 2 + 1
        if not near.any():
            return torch.zeros_like(distance_px)
        shares = torch.as_tensor(self.shares[near]).to(distance_px)
        return _shapes(width_px, distance_px, self.centres_px[near], width) @ shares


@dataclass(frozen=True)
class Normal:
    """Weighted squares of some pixels as a function of the shares: ``w N w - 2 b w + c``."""

    matrix: Floats
    right: Floats
    square: float
    count: int
    pixels: int

    def cost(self, shares: Floats) -> float:
        """The squares that shares leave."""
        return float(shares @ self.matrix @ shares - 2 * self.right @ shares + self.square)

    def __add__(self, other: Normal) -> Normal:
        return Normal(
            self.matrix + other.matrix,
            self.right + other.right,
            self.square + other.square,
            self.count + other.count,
            self.pixels + other.pixels,
        )


@dataclass
class View:
    """What pixels see, and the columns and amplitudes found so far.

    ``width`` (P,) is how much wider than the common one the spread is at each pixel; None where it is not.
    ``fixed`` is light of the spread that is known and not asked for.
    """

    peaks: Peaks
    start_px: Tensor
    column: Tensor
    amplitude: Tensor
    width: Tensor | None = None
    fixed: Fixed | None = None

    def equations(
        self, response: ProjectorResponse, centres_px: Floats, *, waves: bool
    ) -> list[Normal] | None:
        """Normal equations of two halves of the pixels; None when too few of them see a line.

        With ``waves`` the columns are held to what is smooth over runs of neighbours.
        """
        peaks, run = self.peaks, self.peaks.run
        self.column, self.amplitude, chi_square = settle(
            peaks, self.column, self.amplitude, response, self.width
        )
        used = (self.amplitude > 0) & torch.isfinite(self.column) & torch.isfinite(chi_square)
        used &= (self.column - self.start_px).abs() < MAX_SHIFT_PX
        if used.any():
            used &= chi_square < MAX_CHI_SQUARE * max(float(chi_square[used].median()), 1.0)
        column, std_px = self.column, FREE_PX
        if waves:
            wave = column_wave(column.reshape(-1, run), used.reshape(-1, run), peaks.step_px)
            used &= wave.smooth.repeat_interleave(run)
            column, std_px = column - wave.px.ravel(), wave.std_px
        if int(used.sum()) < MIN_PIXELS:
            return None
        which = torch.nonzero(used).ravel()
        parts = (which[which // run % 2 == half] for half in (0, 1))
        return [
            _normal(
                peaks.of(part),
                column[part],
                self.amplitude[part],
                response,
                centres_px,
                std_px,
                None if self.width is None else self.width[part],
                self.fixed,
            )
            for part in parts
        ]


def settle(
    peaks: Peaks, column: Tensor, amplitude: Tensor, response: ProjectorResponse, width: Tensor | None
) -> tuple[Tensor, Tensor, Tensor]:
    """Columns and amplitudes for a response, and the chi-square of each pixel, each (P,).

    ``width`` (P,) is that of the spread relative to the response's, None where it is that.
    """
    reach = float((column - peaks.centres).abs().max()) + (SETTLING + 1) * LONGEST_PX
    table = LineTable(peaks.width_px, response, reach, column, width)
    for _ in range(SETTLING):
        g, slope = table.at(column - peaks.centres)
        weight = 1 / (peaks.variance + (MODEL_ERROR * amplitude) ** 2)
        wg = weight * g
        gg = (wg * g).sum(0).clip(min=1e-30)
        amplitude = (wg * peaks.y).sum(0) / gg
        residual = peaks.y - amplitude * g
        along = slope - g * ((wg * slope).sum(0) / gg)
        information = (amplitude * (weight * along * along).sum(0)).clip(min=1e-12)
        column = column + ((weight * along * residual).sum(0) / information).clip(-LONGEST_PX, LONGEST_PX)
    chi_square = (weight * residual**2).sum(0) / ((weight > 0).sum(0) - 2).clip(min=1)
    return column, amplitude, chi_square


def _normal(
    peaks: Peaks,
    column: Tensor,
    amplitude: Tensor,
    response: ProjectorResponse,
    centres_px: Floats,
    column_std_px: float,
    width: Tensor | None,
    fixed: Fixed | None = None,
) -> Normal:
    """Normal equations of the shares: each pixel has an amplitude, and a column known to a deviation.

    Both are eliminated: what they would change is taken from rows and target, all of it for the amplitude,
    and for the column as much as its deviation leaves open.
    """
    distance = column - peaks.centres
    half = peaks.width_px / 2
    table = LineTable(peaks.width_px, response, float(distance.abs().max()) + 1, column, width)
    g, slope = table.at(distance)
    halo = halo_integral(distance + half, response) - halo_integral(distance - half, response)
    if fixed is not None:
        halo = halo + fixed.light(peaks.width_px, distance, width)
    root = (peaks.variance + (MODEL_ERROR * amplitude) ** 2).rsqrt()
    shapes = _shapes(peaks.width_px, distance, centres_px, width)
    rows = shapes * (root * amplitude)[..., None]
    target = root * (peaks.y - amplitude * halo)
    # What a change of the amplitude does is each pixel's own, and so, in part, what one of the column does.
    first = unit(g * root)
    second = slope * root
    second = second - first * (first * second).sum(0)
    moved = (amplitude * column_std_px * second.norm(dim=0)) ** 2
    for own, share in ((first, torch.ones_like(moved)), (unit(second), 1 - (1 + moved).rsqrt())):
        taken = own * share
        rows = rows - taken[..., None] * (own[..., None] * rows).sum(0)
        target = target - taken * (own * target).sum(0)
    flat, values = rows.flatten(0, 1), target.flatten()
    count = int(torch.isfinite(peaks.variance).sum()) - 2 * len(column)
    return Normal(
        (flat.T @ flat).numpy(), (flat.T @ values).numpy(), float(values @ values), count, len(column)
    )


def _shapes(width_px: int, distance_px: Tensor, centres_px: Floats, width: Tensor | None) -> Tensor:
    """Light of a line through a Gaussian at each centre, (window, P, Gaussians)."""
    half, centres = width_px / 2, torch.as_tensor(centres_px).to(distance_px)
    narrowest = 1.0 if width is None else float(width.min())
    reach = (float(distance_px.abs().max()) + half) / narrowest + float(np.abs(centres_px).max()) + 1
    at = np.arange(-math.ceil(reach * SAMPLES), math.ceil(reach * SAMPLES) + 1) / SAMPLES
    if width is None:
        one = ndtr((at + half) / STEP_PX) - ndtr((at - half) / STEP_PX)
        table = EvenTable(float(at[0]), 1 / SAMPLES, [one], distance_px)
        return table.at(distance_px[..., None] - centres)[0]
    step = EvenTable(float(at[0]), 1 / SAMPLES, [ndtr(at / STEP_PX)], distance_px)
    near, far = (((distance_px + edge) / width)[..., None] - centres for edge in (half, -half))
    return step.at(near)[0] - step.at(far)[0]


def unit(values: Tensor) -> Tensor:
    """Values (rows, columns) with each column scaled to length one; one of zeros stays."""
    scaled: Tensor = values / values.norm(dim=0).clip(min=1e-30)
    return scaled
