"""The line spread from single scan lines at many sub-pixel places.

A pixel at column q sees ``y_k = a (g(q - x_k) + halo)`` of the line at x_k. The profile g is the line's box
times the spread, and the spread is a sum of narrow Gaussians, so that y is linear in their shares. Amplitude
and column are each pixel's own and are eliminated, the shares are common to all. Thousands of pixels see the
profile at as many sub-pixel places, which makes up for the few lines that each of them sees.

What a pixel alone cannot tell is a wave of the columns with the period of the lines: a curve that goes with
it explains all lines as well. So pixels come in runs of neighbours, over which columns change smoothly.

Three answers compete: the curve that is known already, the same curve stretched, and any curve, as near to
the stretched one as the data allow. Each is fitted to one half of the pixels and judged by the other half.
Where lines are as far apart as they are wide, each pixel sees so few that any curve goes astray with the
columns. If none explains the lines there, the known curve with a skirt is tried: a part of the light, as
lenses scatter it, falls under the same curve stretched further.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize, nnls
from torch import Tensor

from dsl_core.model.projector.line_spread import REACH, LineSpread
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.spread.curves import gaussian
from dsl_core.optics.spread.equations import MAX_CHI_SQUARE, STEP_PX, Fixed, Normal, Peaks, View, settle
from dsl_core.optics.spread.field import FieldFamily, FieldFit

Floats = NDArray[np.float64]
#: How far a curve reaches, px.
REACH_PX = 6.0
#: Steps in which a curve is stretched, and in which it takes any shape.
STRETCHINGS, ROUNDS = 3, 4
#: How often curve and field are fitted in turn, at most.
FIELD_ROUNDS = 2
#: A shape that explains the lines so much worse than it first promised has gone astray, unless what it falls
#: short of is at most this share of what it promised to explain better than the simpler curve.
WORSE, SHORT_SHARE = 1.2, 0.05
#: One that explains fewer pixels than this share of those before has only left out what it cannot explain.
KEPT = 0.98
#: Factors by which a curve may be stretched, and how often the search among them is repeated, finer.
STRETCHES, FINER = np.geomspace(0.4, 2.5, 25), 3
#: Strengths of the pull towards the stretched curve, relative to the data's.
PULLS = 10.0 ** np.arange(-7.0, 0.0)
#: Steps that finding a curve without negative shares may take, for each of them: the weakest pulls need most.
MOST_STEPS = 30
#: A curve is preferred to a simpler one when it lowers the other half's chi-square by so much and this share.
CLEARLY, CLEAR_SHARE = 30.0, 0.01
#: In the end the known curve must leave so many times what the found one does, each with columns of its own.
SURELY = 1.2
#: Share of the chi-square of the simpler curve that one with a skirt may leave.
SKIRT_LEAVES = 0.7
#: The most light that a skirt holds and the most that it is wider, and where the search for it begins: the
#: logarithm of a stretching, the share of the light, and the logarithm of the further stretching less one.
MOST_SHARE, WIDEST, SKIRT_START = 0.5, 6.0, (0.0, 0.1, 0.7)
#: Stretchings (logarithm) and shares of the light that are looked at before a search, which takes long: where
#: none of them explains the lines better than the curve, a search finds nothing either.
LOOKS = tuple((log, share) for log in (-0.35, -0.15, 0.0) for share in (0.05, 0.12, 0.3))
#: Trials of a skirt, at most, and how finely they are told apart.
TRIALS, SKIRT_STEP = 150, 0.003
#: How often columns are settled at each: they start from whole ones.
SETTLED = 2


@dataclass(frozen=True)
class SpreadFit:
    """The response that explains the lines best and how it was found.

    ``changed`` says whether the lines call for another one than was given. ``rms_std_px`` is the deviation of
    its width. Chi-squares are those of a degree of freedom, by pixels that did not enter the fit, for the
    response ``before`` and ``after``; ``pixels`` were used. ``field`` is given where the width varies
    over the projector's frame otherwise than it was known to.
    """

    response: ProjectorResponse
    changed: bool
    rms_std_px: float
    before: float
    after: float
    pixels: int
    field: FieldFit | None = None


def fit_spread(
    peaks: Peaks, column_px: Tensor, start: ProjectorResponse, place_px: Tensor | None = None
) -> SpreadFit | None:
    """The response with the line spread that some pixels see; None when too few of them see a line.

    ``column_px`` (P,) are columns to about half a pixel, ``start`` the response as it was known. Where
    places (column and row on the projector, px, (2, P)) are given, the width may vary over them.
    """
    family = _Family(start)
    view = View(peaks, column_px, column_px.clone(), peaks.y.amax(0), fixed=family.fixed)
    if place_px is None:
        return _fit_curve(view, family)
    fields = FieldFamily(place_px)
    known = None if start.field is None else fields.widths(start.field)
    view.width = known
    found = _fit_curve(view, family)
    varies = None if found is None else fields.fit(view, found.response)
    if found is None or varies is None or not varies.matters(known):
        return found
    better = found
    for _ in range(FIELD_ROUNDS):
        view.width = varies.width
        curve = _fit_curve(view, family)
        again = None if curve is None else fields.fit(view, curve.response)
        if curve is None or again is None:
            return found
        settled = not again.matters(varies.width)
        better, varies = curve, again
        if settled:
            break
    # Held-out squares of a degree of freedom: a field has few parameters.
    if (
        better.pixels < KEPT * found.pixels
        or found.after - better.after < better.after * CLEARLY / better.pixels
    ):
        return found
    # Where lines do not overlap, a field may follow what columns have made of other light.
    every = torch.arange(len(view.start_px))
    flat = _left_by(replace(view, width=known), found.response, every)
    if _left_by(replace(view, width=varies.width), better.response, every) > (1 + CLEAR_SHARE) * flat:
        return found
    response = better.response.model_copy(update={"field": varies.field})
    return replace(better, response=response, changed=True, field=varies, before=found.before)


def _fit_curve(view: View, family: _Family) -> SpreadFit | None:
    """The curve that pixels see whose relative widths are known; the known one unless it is surely worse.

    Where lines do not overlap, columns make up for nearly any blur. The search gains little there, but more
    than chance would bring, as neighbours share what the model leaves; and against columns that have followed
    another curve, the known one looks bad.
    """
    found = _search(view, family)
    if found is None or not found.changed:
        return found
    every = torch.arange(len(view.start_px))
    known, now = (_left_by(view, each, every) for each in (family.start, found.response))
    if known > SURELY * now:
        return found
    left = found.after * known / now
    return replace(found, response=family.start, changed=False, before=left, after=left)


def _search(view: View, family: _Family) -> SpreadFit | None:
    # First as if nothing was known of the columns: what the known curve explains, stretched or not, stands.
    halves = view.equations(family.start, family.centres_px, waves=False)
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
            return _skirted(view, family, found)
        better = _choose(halves, family, shapes=True)
        # Also when a later round comes back: it does so by chance.
        if _is_astray(better, first, found):
            return _skirted(view, family, found)
    return better if better.pixels >= KEPT * found.pixels else _skirted(view, family, found)


def _skirted(view: View, family: _Family, found: SpreadFit) -> SpreadFit:
    """The curve with a skirt where it explains the lines surely better than the one ``found``, else that.

    Columns are each pixel's own at every trial: what a wrong curve leaves in them would hold it up.
    """
    half = torch.arange(len(view.start_px)) // view.peaks.run % 2

    def left(values: Floats, pixels: Tensor) -> float:
        share = float(values[1])
        if not 0 <= share <= MOST_SHARE or math.exp(values[2]) > WIDEST - 1:
            return math.inf
        return _left_by(view, family.skirted(*_skirt_of(values)), pixels)

    def best(pixels: Tensor) -> Floats:
        trials = minimize(
            left,
            np.array(SKIRT_START),
            (pixels,),
            method="Nelder-Mead",
            options={"maxfev": TRIALS, "xatol": SKIRT_STEP, "fatol": SKIRT_STEP},
        )
        return np.asarray(trials.x, np.float64)

    parts = [torch.nonzero(half == which).ravel() for which in (0, 1)]
    usual = sum(_left_by(view, found.response, part) for part in parts)
    looks = (np.array([log, share, SKIRT_START[2]]) for log, share in LOOKS)
    if not any(sum(left(look, part) for part in parts) < usual for look in looks):
        return found
    crossed = sum(left(best(own), other) for own, other in (parts, parts[::-1]))
    if crossed > SKIRT_LEAVES * usual:
        return found
    response = family.skirted(*_skirt_of(best(torch.cat(parts))))
    view.column = view.start_px.clone()
    halves = view.equations(response, family.centres_px, waves=False)
    if halves is None:
        return found
    better = _choose(halves, _Family(response), shapes=False)
    if better.pixels < KEPT * found.pixels:
        return found
    return replace(better, changed=True, before=found.before)


def _skirt_of(values: Floats) -> tuple[float, float, float]:
    """Stretching of the core, share of the light in the skirt, and its stretching, from those of a search."""
    return math.exp(values[0]), float(values[1]), math.exp(values[0]) * (1 + math.exp(values[2]))


def _left_by(view: View, response: ProjectorResponse, pixels: Tensor) -> float:
    """Mean chi-square that a response leaves of the lines of some pixels; single ones count for little."""
    peaks, column, amplitude = view.peaks.of(pixels), view.start_px[pixels], view.peaks.y.amax(0)[pixels]
    width = None if view.width is None else view.width[pixels]
    for _ in range(SETTLED):
        column, amplitude, chi_square = settle(peaks, column, amplitude, response, width)
    known = chi_square[torch.isfinite(chi_square)]
    if len(known) == 0:
        return math.inf
    return float(known.clip(max=MAX_CHI_SQUARE * max(float(known.median()), 1.0)).mean())


def _is_astray(shape: SpreadFit, first: SpreadFit, simple: SpreadFit) -> bool:
    """Whether a shape does not explain the lines as it first did, next to a simpler curve."""
    short = shape.after - first.after
    return short >= max((WORSE - 1) * first.after, SHORT_SHARE * (simple.after - first.after))


class _Family:
    """The known curve, as shares of Gaussians on an even grid, and the same curve stretched.

    What of a measured curve lies farther out than ``centres_px`` is ``fixed``: the lines next to a pixel tell
    little of it, and it is neither stretched nor reshaped.
    """

    def __init__(self, start: ProjectorResponse) -> None:
        self.start, self._known = start, start.line_spread
        first, reach = 0.0, REACH_PX
        if isinstance(self._known, LineSpread):
            first = self._known.first_px
            margin_px = REACH * max(self._known.core_px - STEP_PX, 0.0)
            reach = max(reach, float(np.abs(self._known.centres_px).max()) + margin_px + STEP_PX)
        count, middle = math.ceil(REACH_PX / STEP_PX), round(-first / STEP_PX)
        self.centres_px = first + STEP_PX * (middle + np.arange(-count, count + 1, dtype=np.float64))
        self.fixed: Fixed | None = None
        self._shares = np.zeros(0)
        if not isinstance(self._known, LineSpread):
            return
        most = max(math.ceil(reach / STEP_PX), count)
        grid = first + STEP_PX * (middle + np.arange(-most, most + 1, dtype=np.float64))
        shares = _on_grid(self._known, grid)
        self._near = slice(most - count, most + count + 1)
        self._shares = shares[self._near].copy()
        shares[self._near] = 0.0
        if shares.any():
            self.fixed = Fixed(grid, shares)

    def stretched(self, factor: float) -> Floats:
        """Shares of the curve with all distances times a factor; all light but the fixed."""
        if isinstance(self._known, LineSpread):
            return _split(self.centres_px * factor, self._shares, self.centres_px)
        width = math.sqrt(max((factor * self._known) ** 2 - STEP_PX**2, (STEP_PX / 2) ** 2))
        shares = gaussian(self.centres_px, width)
        return np.asarray(shares / shares.sum())

    def spread(self, shares: Floats) -> LineSpread:
        """The curve of some shares, with the fixed light."""
        if self.fixed is not None:
            whole = self.fixed.shares.copy()
            whole[self._near] = shares
            shares = whole
        return LineSpread.of(shares, STEP_PX)

    def response(self, factor: float) -> ProjectorResponse:
        """What the curve stretched is as a response."""
        if isinstance(self._known, LineSpread):
            return self.start.with_spread(self.spread(self.stretched(factor)))
        return self.start.with_gaussian(self._known * factor)

    def skirted(self, factor: float, share: float, skirt: float) -> ProjectorResponse:
        """The curve stretched by a factor, with a share of its light under the curve stretched by another."""
        shares = (1 - share) * self.stretched(factor) + share * self.stretched(skirt)
        return self.start.with_spread(self.spread(shares))

    def best(self, normal: Normal) -> float:
        """The factor that explains some pixels best."""
        factors = STRETCHES
        for _ in range(FINER):
            costs = [normal.cost(self.stretched(float(factor))) for factor in factors]
            nearest = int(np.argmin(costs))
            low, high = factors[max(nearest - 1, 0)], factors[min(nearest + 1, len(factors) - 1)]
            factors = np.linspace(low, high, len(STRETCHES))
        return float(factors[len(factors) // 2])

    def std(self, normal: Normal, factor: float, chi_square: float) -> float:
        """Relative deviation of a factor where chi-squares have this size, by how fast they grow off it.

        At most one: of a factor at whose sides they do not grow nothing is known.
        """
        low, middle, high = (normal.cost(self.stretched(factor * by)) for by in (0.98, 1.0, 1.02))
        return min(math.sqrt(2 * chi_square / max((low + high - 2 * middle) / 0.02**2, 1e-30)), 1.0)

    @staticmethod
    def is_at_end(factor: float) -> bool:
        """Whether a factor is the smallest or largest that is tried.

        Then something else asks for it, such as a camera whose values are not proportional to the light.
        """
        low, high = STRETCHES[0] * STRETCHES[1], STRETCHES[-1] * STRETCHES[-2]
        return not low < factor**2 < high


def _on_grid(known: LineSpread, grid_px: Floats) -> Floats:
    """Shares of Gaussians ``STEP_PX`` wide at even places (px) that make a curve of whatever Gaussians."""
    shares = np.array(known.shares)
    if known.core_px**2 - STEP_PX**2 < (STEP_PX / 2) ** 2:
        return _split(known.centres_px, shares, grid_px)
    width_px = math.sqrt(known.core_px**2 - STEP_PX**2)
    each = gaussian(grid_px[:, None] - known.centres_px, width_px)
    return np.asarray(each / each.sum(0) @ shares)


def _split(at_px: Floats, light: Floats, centres_px: Floats) -> Floats:
    """Light at places (px) between even centres, shared by the two neighbours of each."""
    position = ((at_px - centres_px[0]) / STEP_PX).clip(0, len(centres_px) - 1)
    whole = np.minimum(np.floor(position + 1e-9).astype(int), len(centres_px) - 2)
    shares = np.zeros(len(centres_px))
    np.add.at(shares, whole, light * (1 - (position - whole)))
    np.add.at(shares, whole + 1, light * (position - whole))
    return shares


def _choose(halves: list[Normal], family: _Family, *, shapes: bool) -> SpreadFit:
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
    if known - stretched > scale * CLEARLY and not family.is_at_end(factor):
        response, after = family.response(factor), stretched
    if pulled and after - min(pulled.values()) > scale * (CLEARLY + CLEAR_SHARE * whole.count):
        pull = min(pulled, key=lambda each: pulled[each])
        shares = _any(whole, family.stretched(factor), pull)
        response, after = family.start.with_spread(family.spread(shares)), pulled[pull]
    return SpreadFit(
        response,
        response is not family.start,
        family.std(whole, factor, scale) * response.blur_px,
        known / whole.count,
        after / whole.count,
        whole.pixels,
    )


def _any(normal: Normal, near: Floats, pull: float) -> Floats:
    """Shares of the curve that explains some pixels best, pulled towards one in its curvature."""
    second = np.diff(np.eye(len(near)), 2, axis=0)
    penalty = second.T @ second + 1e-4 * np.eye(len(near))
    penalty *= pull * np.trace(normal.matrix) / np.trace(penalty)
    root = np.linalg.cholesky(normal.matrix + penalty)
    right = np.linalg.solve(root, normal.right + penalty @ near)
    try:
        shares, _ = nnls(root.T, right, maxiter=MOST_STEPS * len(near))
    except RuntimeError:
        # What the data leave so open is no better than the curve that it is pulled towards.
        return near
    return np.asarray(shares)
