"""Whether lines got the light that white got everywhere: light adds up in every part of a picture.

A shadow that comes in while lines are captured, smoke, or a door that opens takes or gives light to some
lines, and of these to some rows. Nothing of that shows in all lines and pixels together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.lines.line_sum import LESS_THAN_NONE, even_cover, is_below_none
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.patterns.multiplexed import profiles

Floats = NDArray[np.floating]

#: Parts of a picture: so many of its height, by so many of the projector's columns.
DOWN, ACROSS = 4, 24
#: How far sums of a part may be from those of the others, as a share of white, and in deviations.
LEAST, SIGMAS = 0.1, 6.0
#: The same for parts of all rows together, two of them beside each other.
LEAST_OF_COLUMNS = 0.06
#: The mean of two beside each other, of which either is off by so many deviations and both by so many: a few
#: dim lines seldom end where a part does.
SIGMAS_EACH, SIGMAS_BOTH = 3.0, 7.5
#: One of them alone, as of the last few lines of a small picture, is as far off as `LEAST`, by so many
#: deviations, and by so many times what most parts are: light that flickers leaves none as it was.
SIGMAS_ALONE, STANDS_OUT = 7.5, 5.0
#: Parts that have to be off, and pixels that a part needs.
FEWEST_PARTS, FEWEST = 3, 24
#: What parts beside each other leave of their differences (a share of the squares) if all rows are alike.
ALIKE = 0.15
#: White above this share of full scale may have lost light.
SOUND = 0.9
#: Share of the columns at either end of the picture that lines may light unevenly, as one in so many.
EDGE = 16


@dataclass(frozen=True)
class LocalSum:
    """Light of lines over what white has of it, in the part where they differ most from all others.

    ``shots`` are the first and the last of the lines that light the parts that are off, which are so in
    ``all_rows`` alike or in some.
    """

    share: float
    std: float
    shots: tuple[Shot, Shot]
    all_rows: bool = False

    @property
    def sentence(self) -> str:
        """What is wrong."""
        first, last = self.shots
        seen = (
            f"between frame {first.number} and frame {last.number} have {self.share:.2f} ±"
            f" {max(self.std, 0.005):.2f} times the light of white, which all lines add up to"
        )
        if is_below_none(self.share, self.std):
            return f"Lines {seen}{LESS_THAN_NONE}"
        if self.all_rows:
            missing = "all they lit was in a shadow or smoke"
            more = "other light came in (a torch, a door, somebody next to the object)"
            return (
                f"Lines {seen}, and others have not: the light of the projector changed for them (eco mode,"
                f" iris, the lamp), or {more if self.share > 1 else missing}. Switch eco mode and dynamic"
                " contrast off, keep the way of the light free, and scan again."
            )
        return (
            f"In parts of the picture, lines {seen}: something cast a shadow, smoke or steam drifted by, the"
            " light changed, or other light came in while they were captured. Keep the way of the light free"
            " and the room as it is, and scan again."
        )


def local_sum(
    plan: CapturePlan, setting: int, kept: Mapping[int, Counts], lit: Lit, noise: Noise, raster: Raster
) -> LocalSum | None:
    """Where lines of a setting do not add up to white, from the raster of each shot; None if they do.

    None as well where lines do not light all columns evenly, or pictures are not there. ``lit`` says which
    pixel has which column. What light changed by meanwhile is taken off, as far as white, taken once more,
    shows it, and so is what all parts have in common.
    """
    own = [shot for shot in plan.shots() if shot.setting == setting]
    lines = [shot for shot in own if shot.role == "spectral"]
    ends = {shot.role: shot for shot in own if shot.role in ("white", "black")}
    cover, width = even_cover(plan), plan.projector_size_px[0]
    if cover is None or len(ends) < 2 or not {each.index for each in (*lines, *ends.values())} <= kept.keys():
        return None
    black, white = (_takes(ends[role], plan, kept) for role in ("black", "white"))
    dark = np.asarray(np.mean([kept[each.index] for each in black], 0), np.float32)
    first = kept[ends["white"].index]
    edge, column = width // EDGE, lit.key // 3
    sound = (column >= edge) & (column < width - edge)
    sound &= (first[lit.index] < SOUND * noise.sensor.full_scale_dn) & (first[lit.index] > dark[lit.index])
    at, column = lit.index[sound], column[sound]
    if at.size < FEWEST_PARTS * FEWEST:
        return None
    seen = np.zeros(at.size, np.float32)
    for shot in lines:
        seen += kept[shot.index][at]
    seen -= np.float32(len(lines)) * dark[at]
    # Each pixel has most of its light from the lines of its own column.
    of_column = profiles(plan.spectral, width).sum(2).argmax(0)
    when = np.array([shot.index for shot in lines])[of_column[column]]
    places = [each.index for each in white]
    sums = np.array([float(kept[each][at].sum(dtype=np.float64)) - float(dark[at].sum()) for each in places])
    wanted = cover * (first[at] - dark[at]) * np.interp(when, places, sums / sums[0])
    part = at // raster.shape[1] * DOWN // raster.shape[0] * ACROSS
    part += (column - edge) * ACROSS // (width - 2 * edge)
    # Noise of black is in all lines alike.
    variance = noise.variance(dark)[at] * (len(lines) + len(lines) ** 2 / len(black))
    light = seen, wanted, variance
    return _worst(part, light, when, lines) or _worst_columns(part % ACROSS, light, when, lines)


def _takes(first: Shot, plan: CapturePlan, kept: Mapping[int, Counts]) -> list[Shot]:
    """A shot and those that repeat it, as far as they are there."""
    again = (each for each in plan.shots() if each.role == "sentinel" and each.index in kept)
    return [first, *(each for each in again if plan.original(each).index == first.index)]


def _worst(
    part: NDArray[np.integer],
    light: tuple[Floats, Floats, Floats],
    when: NDArray[np.integer],
    lines: Sequence[Shot],
) -> LocalSum | None:
    """The part that is furthest off, from light seen, light wanted and the variance of pixels by parts."""
    apart, std = _by_parts(part, DOWN * ACROSS, light)
    off = np.abs(apart) > np.maximum(LEAST, SIGMAS * std)
    if int(off.sum()) < FEWEST_PARTS:
        return None
    known = np.isfinite(std)
    across, of = np.arange(DOWN * ACROSS) % ACROSS, np.flatnonzero(known) % ACROSS
    means = np.bincount(of, apart[known], ACROSS) / np.maximum(np.bincount(of, minlength=ACROSS), 1)
    left = float(np.square(apart - means[across])[off].sum())
    all_rows = left < ALIKE * float(np.square(apart)[off].sum())
    return _told(apart, std, off, when[off[part]], lines, all_rows)


def _worst_columns(
    column: NDArray[np.integer],
    light: tuple[Floats, Floats, Floats],
    when: NDArray[np.integer],
    lines: Sequence[Shot],
) -> LocalSum | None:
    """The same for parts of all rows: what is off beside each other counts from less on.

    Thin haze, or a lamp that is dimmed for the last few lines, takes little from each part.
    """
    apart, std = _by_parts(column, ACROSS, light)
    off = np.abs(apart) > np.maximum(LEAST_OF_COLUMNS, SIGMAS * std)
    alike = apart[1:] * apart[:-1] > 0
    each = np.minimum(np.abs(apart[1:]) / std[1:], np.abs(apart[:-1]) / std[:-1])
    both, both_std = (apart[1:] + apart[:-1]) / 2, np.hypot(std[1:], std[:-1]) / 2
    is_off = np.abs(both) > np.maximum(LEAST_OF_COLUMNS, SIGMAS_BOTH * both_std)
    beside = alike & ((off[1:] & off[:-1]) | (is_off & (each > SIGMAS_EACH)))
    off = np.append(beside, False) | np.insert(beside, 0, False)
    known = np.isfinite(std)
    least = max(LEAST, STANDS_OUT * float(np.median(np.abs(apart[known])))) if known.any() else LEAST
    off |= np.abs(apart) > np.maximum(least, SIGMAS_ALONE * std)
    return _told(apart, std, off, when[off[column]], lines, True) if off.any() else None


def _by_parts(
    part: NDArray[np.integer], number: int, light: tuple[Floats, Floats, Floats]
) -> tuple[Floats, Floats]:
    """How far the sum of each part is from what all have in common, and its deviation, as shares of white.

    Parts of which too little is seen are not off, with a deviation that is infinite; so are all, where few
    are left.
    """
    count = np.bincount(part, minlength=number)
    seen, wanted, variance = (np.bincount(part, each, number) for each in light)
    used = (count >= FEWEST) & (wanted > 0)
    apart, std = np.zeros(number), np.full(number, np.inf)
    if int(used.sum()) >= 2 * FEWEST_PARTS:
        ratio, std[used] = seen[used] / wanted[used], np.sqrt(variance[used]) / wanted[used]
        apart[used] = ratio - _in_common(ratio, count[used] / wanted[used], std[used])
    return apart, std


def _told(
    apart: Floats,
    std: Floats,
    off: NDArray[np.bool_],
    at: NDArray[np.integer],
    lines: Sequence[Shot],
    all_rows: bool,
) -> LocalSum:
    """The worst of the parts that are off, and the first and the last line that light them, by indices."""
    worst = int(np.abs(np.where(off, apart, 0)).argmax())
    by_index = {shot.index: shot for shot in lines}
    span = by_index[int(at.min())], by_index[int(at.max())]
    return LocalSum(float(1 + apart[worst]), float(std[worst]), span, all_rows)


def _in_common(ratio: Floats, dark: Floats, std: Floats) -> Floats:
    """What all parts have in common, robustly: a share of white, and as much in every pixel.

    ``dark`` is one over the light of white, by how many pixels a part has.
    """
    terms = np.stack([np.ones_like(dark), dark], 1)
    weight = 1 / np.hypot(std, 0.01)
    for _ in range(10):
        found, *_ = np.linalg.lstsq(terms * weight[:, None], ratio * weight, rcond=None)
        left = np.abs(ratio - terms @ found)
        weight = 1 / np.hypot(std, 0.01) / np.sqrt(np.maximum(left / max(float(np.median(left)), 1e-9), 1))
    return np.asarray(terms @ found)
