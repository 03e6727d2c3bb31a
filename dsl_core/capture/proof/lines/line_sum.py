"""Whether lines got the light that white got: light adds up, so that all lines together are white.

No picture by itself tells that a projector gives dark pictures another share of its light than bright ones:
every line has as much as those before it, and white, black and code, taken once more, look as they did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.plan import CapturePlan, LineComb, ScanLines, Shot
from dsl_core.patterns.multiplexed import profiles

#: How far the sum may be from white: what 43 clean scans of all scenes differ by, beyond noise, is a fifth.
LEAST, SIGMAS = 0.02, 4.0
#: What black may have changed by unseen, DN, with and without pictures of it among the lines: a level that
#: wanders shows in these, and what they show is allowed for besides.
UNSEEN_DN, UNKNOWN_DN = 0.1, 1.0
#: How uneven the lines may light the columns, as a share, but for those at the edges of the picture.
EVEN, EDGE = 0.02, 16
#: Pixels needed to say anything.
FEWEST = 60
#: A share of white below none by so many deviations is less light than black had.
SIGMAS_BELOW = 3.0
#: What that tells: no shadow and no projector takes more light than there is.
LESS_THAN_NONE = (
    ": less than none, so that black was darker than in its own pictures. The light of the room (sun, lamps)"
    " or the camera's black level changed in between. Keep the light of the room away, let the camera warm"
    " up, and scan again."
)


def is_below_none(share: float, std: float) -> bool:
    """Whether a share of the light of white, with its deviation, is surely negative."""
    return share < -SIGMAS_BELOW * std


@dataclass(frozen=True)
class LineSum:
    """Light of all lines together over what white has of it, with its deviation and how far off it may be."""

    share: float
    std: float
    allowed: float

    @property
    def is_off(self) -> bool:
        """Whether it is not the light of white."""
        return abs(self.share - 1) > self.allowed


def line_sum(
    plan: CapturePlan, setting: int, kept: Mapping[int, Counts], lit: Lit, noise: Noise
) -> LineSum | None:
    """The sum of the lines of a setting, from the raster of each shot; None where it says nothing.

    That is where lines do not light all columns evenly, or pictures are not there. What light and black have
    changed by meanwhile is taken off, as far as white and black, taken once more, show it.
    """
    own = [shot for shot in plan.shots() if shot.setting == setting]
    lines = [shot for shot in own if shot.role == "spectral"]
    by_role = {shot.role: shot for shot in own if shot.role in ("white", "black")}
    if not {shot.index for shot in (*lines, *by_role.values())} <= kept.keys() or len(by_role) < 2:
        return None
    cover = even_cover(plan)
    if cover is None or lit.index.size < FEWEST:
        return None
    # Half of the pixels have most of the light.
    at = lit.index[lit.contrast >= np.median(lit.contrast)]
    again = [shot for shot in plan.shots() if shot.role == "sentinel" and shot.index in kept]
    black, white = (_course(by_role[role], again, plan, kept, at) for role in ("black", "white"))
    places = [shot.index for shot in lines]
    dark, bright = (np.interp(places, *course) for course in (black, white))
    light = sum(float(kept[index][at].sum(dtype=np.float64)) for index in places) - float(dark.sum())
    # Light of white when each line was taken; its own black is the one nearest in time.
    usual = cover * float((bright - dark).sum()) / len(lines)
    if usual <= 0:
        return None
    variance = noise.variance(kept[by_role["black"].index])[at].sum(dtype=np.float64)
    std = len(lines) * float(np.sqrt(variance / _pictures(places, black[0]))) / usual
    unseen = UNSEEN_DN if len(black[0]) > 1 else UNKNOWN_DN
    # Nobody knows when between two takes black and white changed.
    steps = [float(np.abs(np.diff(sums)).max(initial=0)) / 2 for _, sums in (black, white)]
    wander = len(lines) * (unseen * at.size + steps[0]) / usual + steps[1] / white[1][0]
    allowed = LEAST + SIGMAS * std + wander
    return LineSum(light / usual, std, allowed)


def _course(
    first: Shot, again: list[Shot], plan: CapturePlan, kept: Mapping[int, Counts], at: np.ndarray
) -> tuple[list[int], list[float]]:
    """Places in the plan of a shot and of those that repeat it, and the sums of their counts."""
    shots = [first, *(each for each in again if plan.original(each).index == first.index)]
    sums = [float(kept[each.index][at].sum(dtype=np.float64)) for each in shots]
    return [each.index for each in shots], sums


def _pictures(places: list[int], taken: list[int]) -> float:
    """As many pictures as have the noise of what is interpolated, on average, from those ``taken``."""
    weights = np.mean([np.interp(places, taken, each) for each in np.eye(len(taken))], axis=1)
    return float(1 / np.sum(weights**2))


def even_cover(plan: CapturePlan) -> float | None:
    """How many lines of a plan light each column; None where they do so unevenly, or are drawn in shades."""
    if not isinstance(plan.spectral, ScanLines | LineComb):
        return None
    cover = profiles(plan.spectral, plan.projector_size_px[0]).sum(0, dtype=np.float64)
    edge = len(cover) // EDGE
    inner = cover[edge : len(cover) - edge]
    mean = float(inner.mean())
    return mean if mean > 0 and float(inner.std()) < EVEN * mean else None
