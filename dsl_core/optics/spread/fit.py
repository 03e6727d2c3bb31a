"""The line spread from single scan lines at many sub-pixel places.

A pixel at column q sees ``y_k = a (g(q - x_k) + halo)`` of the line at x_k. The profile g is the line's box
times the spread, and the spread is a sum of narrow Gaussians, so that y is linear in their shares. Amplitude
and column are each pixel's own and are eliminated, the shares are common to all. Thousands of pixels see the
profile at as many sub-pixel places, which makes up for the few lines that each of them sees.

What a pixel alone cannot tell is a wave of the columns with the period of the lines: a curve that goes with
it explains all lines as well. So pixels come in runs of neighbours, over which columns change smoothly.

Three answers compete: the curve that is known already, the same curve stretched, and any curve, as near to
the stretched one as the data allow. Each is fitted to one half of the pixels and judged by the other half.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.special import ndtr
from torch import Tensor

from dsl_core.model.line_spread import LineSpread
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.line_profile import LineTable, halo_integral
from dsl_core.optics.spread.curves import SAMPLES, EvenTable, gaussian
from dsl_core.optics.spread.wave import column_wave

Floats = NDArray[np.float64]
#: Distance between the Gaussians of a curve and how far it reaches, px.
STEP_PX, REACH_PX = 0.125, 6.0
#: Steps of each pixel's amplitude and column between those of the curve, and the longest, px.
SETTLING, LONGEST_PX = 3, 0.5
#: Steps in which a curve is stretched, and in which it takes any shape.
STRETCHINGS, ROUNDS = 3, 4
#: A shape that explains the lines so much worse than it first promised has gone astray.
WORSE = 1.2
#: Relative error of a modelled profile, added to each variance.
MODEL_ERROR = 0.0015
#: A pixel whose chi-square is so many times the others' sees something else.
MAX_CHI_SQUARE = 5.0
MAX_SHIFT_PX = 2.0
#: Deviation of a column of which nothing is known.
FREE_PX = 1e3
MIN_PIXELS = 200
#: Factors by which a curve may be stretched, and how often the search among them is repeated, finer.
STRETCHES, FINER = np.geomspace(0.4, 2.5, 25), 3
#: Strengths of the pull towards the stretched curve, relative to the data's.
PULLS = 10.0 ** np.arange(-7.0, 0.0)
#: A curve is preferred to a simpler one when it lowers the other half's chi-square by so much and this share.
CLEARLY, CLEAR_SHARE = 30.0, 0.01


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
class SpreadFit:
    """The response that explains the lines best and how it was found.

    ``changed`` says whether the lines call for another one than was given. ``rms_std_px`` is the deviation of
    its width. Chi-squares are those of a degree of freedom, by pixels that did not enter the fit, for the
    response ``before`` and ``after``; ``pixels`` were used.
    """

    response: ProjectorResponse
    changed: bool
    rms_std_px: float
    before: float
    after: float
    pixels: int


@dataclass(frozen=True)
class _Normal:
    """Weighted squares of some pixels as a function of the shares: ``w N w - 2 b w + c``."""

    matrix: Floats
    right: Floats
    square: float
    count: int
    pixels: int

    def cost(self, shares: Floats) -> float:
        return float(shares @ self.matrix @ shares - 2 * self.right @ shares + self.square)

    def __add__(self, other: _Normal) -> _Normal:
        return _Normal(
            self.matrix + other.matrix,
            self.right + other.right,
            self.square + other.square,
            self.count + other.count,
            self.pixels + other.pixels,
        )


def fit_spread(peaks: Peaks, column_px: Tensor, start: ProjectorResponse) -> SpreadFit | None:
    """The response with the line spread that some pixels see; None when too few of them see a line.

    ``column_px`` (P,) are columns to about half a pixel, ``start`` the response as it was known.
    """
    family, view = _Family(start), _View(peaks, column_px, column_px.clone(), peaks.y.amax(0))
    # First as if nothing was known of the columns: what the known curve explains, stretched or not, stands.
    halves = view.equations(start, family.centres_px, waves=False)
    for _ in range(STRETCHINGS):
        if halves is None:
            return None
        found = _choose(halves, family, shapes=False)
        if not found.changed:
            break
        halves = view.equations(found.response, family.centres_px, waves=False)
    if halves is None:
        return None
    found, better = (_choose(halves, family, shapes=shapes) for shapes in (False, True))
    if better.after == found.after:
        return found
    first = better
    for _ in range(ROUNDS):
        halves = view.equations(better.response, family.centres_px, waves=True)
        if halves is None:
            return found
        better = _choose(halves, family, shapes=True)
    return better if better.after < WORSE * first.after else found


@dataclass
class _View:
    """What pixels see, and the columns and amplitudes found so far."""

    peaks: Peaks
    start_px: Tensor
    column: Tensor
    amplitude: Tensor

    def equations(
        self, response: ProjectorResponse, centres_px: Floats, *, waves: bool
    ) -> list[_Normal] | None:
        """Normal equations of two halves of the pixels; None when too few of them see a line.

        With ``waves`` the columns are held to what is smooth over runs of neighbours.
        """
        peaks, run = self.peaks, self.peaks.run
        self.column, self.amplitude, chi_square = _settle(peaks, self.column, self.amplitude, response)
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
            _normal(peaks.of(part), column[part], self.amplitude[part], response, centres_px, std_px)
            for part in parts
        ]


def _settle(
    peaks: Peaks, column: Tensor, amplitude: Tensor, response: ProjectorResponse
) -> tuple[Tensor, Tensor, Tensor]:
    """Columns and amplitudes for a response, and the chi-square of each pixel, each (P,)."""
    reach = float((column - peaks.centres).abs().max()) + (SETTLING + 1) * LONGEST_PX
    table = LineTable(peaks.width_px, response, reach, column)
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
) -> _Normal:
    """Normal equations of the shares: each pixel has an amplitude, and a column known to a deviation."""
    distance = column - peaks.centres
    half = peaks.width_px / 2
    g, slope = LineTable(peaks.width_px, response, float(distance.abs().max()) + 1, column).at(distance)
    halo = halo_integral(distance + half, response) - halo_integral(distance - half, response)
    root = (peaks.variance + (MODEL_ERROR * amplitude) ** 2).rsqrt()
    shapes = _shapes(peaks.width_px, distance, centres_px)
    rows = shapes * (root * amplitude)[..., None]
    target = root * (peaks.y - amplitude * halo)
    # What a change of the amplitude does is each pixel's own, and so, in part, what one of the column does.
    first = _unit(g * root)
    second = slope * root
    second = second - first * (first * second).sum(0)
    moved = (amplitude * column_std_px * second.norm(dim=0)) ** 2
    for own, share in ((first, torch.ones_like(moved)), (_unit(second), 1 - (1 + moved).rsqrt())):
        taken = own * share
        rows = rows - taken[..., None] * (own[..., None] * rows).sum(0)
        target = target - taken * (own * target).sum(0)
    flat, values = rows.flatten(0, 1), target.flatten()
    count = int(torch.isfinite(peaks.variance).sum()) - 2 * len(column)
    return _Normal(
        (flat.T @ flat).numpy(), (flat.T @ values).numpy(), float(values @ values), count, len(column)
    )


def _unit(values: Tensor) -> Tensor:
    """Columns of length one."""
    unit: Tensor = values / values.norm(dim=0).clip(min=1e-30)
    return unit


def _shapes(width_px: int, distance_px: Tensor, centres_px: Floats) -> Tensor:
    """Light of a line through a Gaussian at each centre, (window, P, Gaussians)."""
    reach = float(distance_px.abs().max()) + float(np.abs(centres_px).max()) + 1
    at = np.arange(-math.ceil(reach * SAMPLES), math.ceil(reach * SAMPLES) + 1) / SAMPLES
    half = width_px / 2
    one = ndtr((at + half) / STEP_PX) - ndtr((at - half) / STEP_PX)
    table = EvenTable(float(at[0]), 1 / SAMPLES, [one], distance_px)
    return table.at(distance_px[..., None] - torch.as_tensor(centres_px).to(distance_px))[0]


class _Family:
    """The known curve, as shares of Gaussians on an even grid, and the same curve stretched."""

    def __init__(self, start: ProjectorResponse) -> None:
        self.start, self._known = start, start.line_spread
        # On the grid of a measured curve that curve is exact.
        first = self._known.first_px if isinstance(self._known, LineSpread) else 0.0
        count = math.ceil(REACH_PX / STEP_PX)
        steps = round(-first / STEP_PX) + np.arange(-count, count + 1, dtype=np.float64)
        self.centres_px = first + STEP_PX * steps

    def stretched(self, factor: float) -> Floats:
        """Shares of the curve with all distances times a factor."""
        if isinstance(self._known, LineSpread):
            return self._split(self._known.centres_px * factor, np.array(self._known.shares))
        width = math.sqrt(max((factor * self._known) ** 2 - STEP_PX**2, (STEP_PX / 2) ** 2))
        shares = gaussian(self.centres_px, width)
        return np.asarray(shares / shares.sum())

    def response(self, factor: float) -> ProjectorResponse:
        """What the curve stretched is as a response."""
        if isinstance(self._known, LineSpread):
            return self.start.with_spread(LineSpread.of(self.stretched(factor), STEP_PX))
        return self.start.with_gaussian(self._known * factor)

    def _split(self, at_px: Floats, light: Floats) -> Floats:
        """Light at places between centres, shared by the two neighbours of each."""
        position = ((at_px - self.centres_px[0]) / STEP_PX).clip(0, len(self.centres_px) - 1)
        whole = np.minimum(np.floor(position + 1e-9).astype(int), len(self.centres_px) - 2)
        shares = np.zeros(len(self.centres_px))
        np.add.at(shares, whole, light * (1 - (position - whole)))
        np.add.at(shares, whole + 1, light * (position - whole))
        return shares

    def best(self, normal: _Normal) -> float:
        """The factor that explains some pixels best."""
        factors = STRETCHES
        for _ in range(FINER):
            costs = [normal.cost(self.stretched(float(factor))) for factor in factors]
            nearest = int(np.argmin(costs))
            low, high = factors[max(nearest - 1, 0)], factors[min(nearest + 1, len(factors) - 1)]
            factors = np.linspace(low, high, len(STRETCHES))
        return float(factors[len(factors) // 2])

    def std(self, normal: _Normal, factor: float, chi_square: float) -> float:
        """Relative deviation of a factor where chi-squares have this size, by how fast they grow off it."""
        low, middle, high = (normal.cost(self.stretched(factor * by)) for by in (0.98, 1.0, 1.02))
        return math.sqrt(2 * chi_square / max((low + high - 2 * middle) / 0.02**2, 1e-30))


def _choose(halves: list[_Normal], family: _Family, *, shapes: bool) -> SpreadFit:
    """The simplest response that pixels ask for which did not enter its fit; any shape where these may be."""
    whole = halves[0] + halves[1]
    near = [family.stretched(family.best(half)) for half in halves]

    def crossed(curves: list[Floats]) -> float:
        return halves[1].cost(curves[0]) + halves[0].cost(curves[1])

    known, stretched = whole.cost(family.stretched(1.0)), crossed(near)
    pulled = {
        pull: crossed([_any(half, curve, pull) for half, curve in zip(halves, near, strict=True)])
        for pull in (PULLS if shapes else ())
    }
    # Errors that the model grants itself make chi-squares smaller than one: what counts is their scale.
    scale = min(known, stretched, *pulled.values()) / whole.count
    factor = family.best(whole)
    response, after = family.start, known
    if known - stretched > scale * CLEARLY:
        response, after = family.response(factor), stretched
    if pulled and after - min(pulled.values()) > scale * (CLEARLY + CLEAR_SHARE * whole.count):
        pull = min(pulled, key=lambda each: pulled[each])
        shares = _any(whole, family.stretched(factor), pull)
        response, after = family.start.with_spread(LineSpread.of(shares, STEP_PX)), pulled[pull]
    return SpreadFit(
        response,
        response is not family.start,
        family.std(whole, factor, scale) * response.blur_px,
        known / whole.count,
        after / whole.count,
        whole.pixels,
    )


def _any(normal: _Normal, near: Floats, pull: float) -> Floats:
    """Shares of the curve that explains some pixels best, pulled towards one in its curvature."""
    second = np.diff(np.eye(len(near)), 2, axis=0)
    penalty = second.T @ second + 1e-4 * np.eye(len(near))
    penalty *= pull * np.trace(normal.matrix) / np.trace(penalty)
    root = np.linalg.cholesky(normal.matrix + penalty)
    shares, _ = nnls(root.T, np.linalg.solve(root, normal.right + penalty @ near))
    return np.asarray(shares)
