"""Pictures predicted from what is known so far, and rivals that they are told apart from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.contest import Contest, ballots, counted, vote
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Floats, Raster
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.patterns.multiplexed import profile
from dsl_core.solve.normal import STD_OF_MEDIAN_SIZE
from dsl_core.solve.ranks import median, quantile
from dsl_core.solve.thinned import thinned

#: Two predictions tell a pixel apart if they differ by this share of its light and so many deviations.
APART, SIGMAS = 0.3, 6.0
#: Share of a column's light that its neighbours on either side get.
BLUR = 0.15
#: Brightness is measured if all its pixels together are so many deviations bright, and there are so many.
BRIGHT_SIGMAS, FEWEST_BRIGHT = 25.0, 12
#: Unlit pixels that say how much light of the room has changed since black was taken.
FEWEST_UNLIT = 60
#: A pixel is bright with this share of white. First orders of wide lines and light from surface to surface
#: give as much to one in sixteen of those that should be dark; another pattern does to more than this share.
BRIGHT_SHARE, ELSEWHERE = 0.5, 0.2
#: A share of the pixels that a line leaves unlit has none of its first orders either; and by how many
#: deviations of a pixel black has to have gained before it is taken off.
NO_ORDERS, LEAST_GAINED = 0.25, 0.5
#: Columns count as lit by a pattern above this share of full light.
LIT_SHARE = 0.1
#: By how much pixels are brighter than white, and not by light of the room: as a share of the contrast of
#: most of them, and in deviations.
OVER_WHITE, OVER_WHITE_SIGMAS = 0.3, 8.0
#: Brightness is measured where a pattern has this share of its brightest column: on the flank of a line light
#: depends on parts of a column, which the code does not tell.
BODY_SHARE = 0.5
#: A prediction explains another one that is nearer to it than this share of what a rival is apart.
EXPLAINED = 0.25
#: Of the pixels that a rival leaves bright or dark, every so many are asked where there are plenty.
PLENTY = 4000
#: So many of the pixels that tell predictions apart are enough to leave others unasked.
ENOUGH = 500
#: Medians and shares are of so many pixels, spread over the picture, where there are plenty.
SPREAD = 2000
#: Pixels are looked up by their columns if these are in fewer runs than this.
_RUNS = 16
_NOTHING = np.float32(0)


@dataclass(frozen=True)
class Lit:
    """Pixels whose column is known, at one setting: flat indices, ``key`` = 3 column + channel, counts."""

    index: NDArray[np.intp]
    key: NDArray[np.intp]
    black: Floats
    contrast: Floats
    sigma: Floats

    def where(self, keys: NDArray[np.bool_]) -> NDArray[np.intp]:
        """The pixels (count,) of all keys that are marked, flat (3 width,), in their order."""
        order, starts = self._by_key
        marked = np.flatnonzero(keys[: starts.size - 1])
        if marked.size == 0:
            return marked
        # A line lights a few columns side by side: most pixels need not be looked at.
        ends = np.flatnonzero(marked[1:] - marked[:-1] > 1)
        if ends.size >= _RUNS or 3 * marked.size > starts.size:
            return np.flatnonzero(keys[self.key])
        lower = [starts[marked[0]], *starts[marked[ends + 1]]]
        upper = [*starts[marked[ends] + 1], starts[marked[-1] + 1]]
        found = np.concatenate([order[a:b] for a, b in zip(lower, upper, strict=True)])
        found.sort()
        return found

    def unlit(self, wanted: Floats) -> NDArray[np.intp]:
        """Pixels, spread over the picture, that a `line_profile` leaves dark."""
        some, keys = self._spread
        return some[wanted[keys] <= 0]

    @cached_property
    def over_white(self) -> Floats:
        """Counts above which pixels are brighter than white."""
        return np.asarray(self.black + self.contrast + np.float32(OVER_WHITE_SIGMAS) * self.sigma)

    @cached_property
    def usual_contrast(self) -> np.float32:
        """The median of white over black."""
        return median(self.contrast)

    @cached_property
    def _by_key(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pixels in the order of their keys, and where those of each key begin and end."""
        starts = np.append(0, np.cumsum(np.bincount(self.key)))
        return np.argsort(self.key, kind="stable"), starts

    @cached_property
    def _spread(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        some = thinned(np.arange(self.key.size), SPREAD)
        return some, self.key[some]


def line_profile(plan: CapturePlan, shot: Shot) -> Floats | None:
    """Light over columns and LEDs, flat (3 width,), as a camera sees it; None for a pattern with rows."""
    width, shot = plan.projector_size_px[0], plan.original(shot)
    match shot.role:
        case "white":
            return np.ones(3 * width, np.float32)
        case "black":
            return np.zeros(3 * width, np.float32)
        case "code":
            return None
    sharp = profile(plan.spectral, width, shot.pattern).astype(np.float32)
    wide = np.pad(sharp, ((1, 1), (0, 0)), mode="edge")
    return np.asarray((1 - 2 * BLUR) * sharp + BLUR * (wide[2:] + wide[:-2])).ravel()


@dataclass(frozen=True)
class LineBallots:
    """Votes of pixels, row after row, on which of two patterns of columns they see, and their keys."""

    votes: Floats
    key: NDArray[np.intp]

    def of_colour(self, colour: int) -> Contest:
        """What the pixels of one colour say together."""
        return counted(self.votes[self.key % 3 == colour])


def ballots_of_lines(seen: Counts, lit: Lit, wanted: Floats, rival: Floats) -> LineBallots:
    """Which of two patterns of columns (`line_profile`) pixels see, of those that can tell."""
    chosen = thinned(lit.where(np.abs(wanted - rival) > APART), PLENTY)
    black, contrast = lit.black[chosen], lit.contrast[chosen]
    key = lit.key[chosen]
    votes = ballots(
        seen[lit.index[chosen]].astype(np.float32),
        black + contrast * wanted[key],
        black + contrast * rival[key],
    )
    return LineBallots(votes, key)


def contest_of_lines(seen: Counts, lit: Lit, wanted: Floats, rival: Floats) -> Contest:
    """Which of two patterns of columns (`line_profile`) a picture shows."""
    return counted(ballots_of_lines(seen, lit, wanted, rival).votes)


@dataclass(frozen=True)
class Places:
    """Which pixels of known columns a pattern lights, and some that it does not, as indices into a `Lit`."""

    lit: NDArray[np.intp]
    unlit: NDArray[np.intp]

    @classmethod
    def of(cls, lit: Lit, wanted: Floats) -> Places:
        """Those of a `line_profile`."""
        return cls(lit.where(wanted > LIT_SHARE), lit.unlit(wanted))


def brightness_of_lines(seen: Counts, lit: Lit, wanted: Floats, noise: Noise) -> float | None:
    """Light of a picture over that expected where it should be brightest; None where too little is lit.

    Light that unlit pixels gained since black was taken is the room's and is left out.
    """
    at = Places.of(lit, wanted)
    body = at.lit[wanted[lit.key[at.lit]] > BODY_SHARE * wanted.max()]
    chosen = body[seen[lit.index[body]] < noise.sensor.full_scale_dn]
    room = _of_room(seen[lit.index[at.unlit]] - lit.black[at.unlit])
    light = lit.contrast[chosen] * wanted[lit.key[chosen]]
    gain = seen[lit.index[chosen]] - lit.black[chosen] - room
    return _ratio(gain, light, lit.sigma[chosen] ** 2)


def is_lit_elsewhere(seen: Counts, lit: Lit, wanted: Floats) -> bool:
    """Whether a picture of columns is as bright as white where its `line_profile` leaves it dark.

    A single edge of a code in place of a line leaves most pixels dark, so that votes do not tell it.
    """
    unlit = lit.unlit(wanted)
    bright = seen[lit.index[unlit]] - lit.black[unlit] > BRIGHT_SHARE * lit.contrast[unlit]
    return int(bright.sum()) > max(FEWEST_UNLIT, ELSEWHERE * unlit.size)


def is_over_white(seen: Counts, lit: Lit, wanted: Floats) -> bool:
    """Whether a picture of columns has pixels brighter than white where its `line_profile` leaves it dark.

    A window of another program may be there, which hardly any votes are against. White is all lines together,
    so that none of them is brighter; ``lit`` holds the black and the contrast of the picture's setting.
    """
    if lit.unlit(wanted).size < FEWEST_UNLIT:
        return False
    over = np.flatnonzero(seen[lit.index] > lit.over_white)
    over = over[wanted[lit.key[over]] <= 0]
    if over.size < FEWEST_BRIGHT:
        return False
    more = seen[lit.index[over]] - lit.black[over] - lit.contrast[over]
    return int((more > OVER_WHITE * lit.usual_contrast).sum()) >= FEWEST_BRIGHT


def black_gained(seen: Counts, lit: Lit, wanted: Floats, noise: Noise) -> np.float32:
    """What black has gained since it was taken, as a picture of a line shows it, DN; 0 for little.

    ``wanted`` is its `line_profile`. First orders reach some of the pixels that a line does not light, so
    that those with the least light tell.
    """
    unlit = lit.unlit(wanted)
    if unlit.size < FEWEST_UNLIT:
        return _NOTHING
    black = lit.black[unlit]
    sigma = np.float32(np.sqrt(2 * median(noise.variance(black))))
    # What a normal distribution has its lowest quarter below.
    gained = quantile(seen[lit.index[unlit]] - black, NO_ORDERS) + sigma / np.float32(STD_OF_MEDIAN_SIZE)
    return gained if abs(gained) > LEAST_GAINED * sigma else _NOTHING


def _of_room(gain: Floats) -> np.float32:
    """What the room's light has gained since black, from what unlit pixels have: their median."""
    return median(gain) if gain.size >= FEWEST_UNLIT else _NOTHING


def _ratio(seen: Floats, wanted: Floats, variance: Floats) -> float | None:
    """Light over the light wanted, of all pixels together; None where noise blurs it."""
    total = float(wanted.sum())
    if seen.size < FEWEST_BRIGHT or total < BRIGHT_SIGMAS * float(np.sqrt(variance.sum())):
        return None
    return float(seen.sum()) / total


@dataclass(frozen=True)
class Expected:
    """A picture predicted from one of an earlier setting: flat counts, and their variance."""

    counts: Floats
    variance: Floats

    @cached_property
    def least_variance(self) -> np.float32:
        """That of the pixel that is known best."""
        return np.float32(self.variance.min())


def rescaled(
    picture: Counts,
    old_black: Counts,
    new_black: Floats,
    scale: float,
    noise: Noise,
    gained_dn: np.float32 = _NOTHING,
) -> Expected:
    """The picture of an earlier setting at another one, whose light is ``scale`` times as strong.

    The picture has ``gained_dn`` over its black.
    Noise is scaled as well and may take counts below zero: cut off there, their sum would be too bright.
    """
    factor, full = np.float32(scale), noise.sensor.full_scale_dn
    counts = np.subtract(picture, old_black, dtype=np.float32)
    if gained_dn:
        counts -= gained_dn
    counts *= factor
    counts += new_black
    np.minimum(counts, np.float32(full), out=counts)
    variance = noise.variance(picture) + noise.variance(old_black)
    variance *= factor**2
    # Nobody knows how much brighter a saturated pixel was.
    variance[(picture >= full) & (counts < full)] = np.inf
    return Expected(counts, variance)


def contest_of_places(
    seen: Counts,
    wanted: Expected,
    lit: Lit,
    dark: tuple[Floats, float],
    profiles: tuple[Floats, Floats],
    noise: Noise,
) -> Contest:
    """Whether a predicted picture is seen, or one whose pattern is displaced, for which there is no picture.

    The latter follows from ``dark``: the black picture, flat, and how much stronger light is than in ``lit``;
    and from the ``profiles`` of the pattern in its place and out of it. Only pixels are asked whose
    prediction the former explains: most are brighter, by what lenses and a film spread.
    """
    chosen = lit.where(np.abs(profiles[0] - profiles[1]) > APART)
    key, at, full = lit.key[chosen], lit.index[chosen], np.float32(noise.sensor.full_scale_dn)
    black, light = dark[0][at], np.float32(dark[1]) * lit.contrast[chosen]
    usual, rival = (np.minimum(black + light * each[key], full) for each in profiles)
    expected, counts = wanted.counts[at], seen[at].astype(np.float32)
    apart = np.abs(expected - rival)
    variance = noise.variance(seen)[at] + wanted.variance[at]
    asked = (np.abs(expected - usual) < EXPLAINED * apart) & (apart**2 > SIGMAS**2 * variance)
    return vote(counts[asked], expected[asked], rival[asked])


def contest_of_pictures(
    seen: Counts,
    wanted: Expected,
    rival: Expected,
    black: Floats,
    least: Floats | None,
    noise: Noise,
    raster: Raster,
) -> Contest:
    """Which of two predicted pictures a picture is; ``black`` is the one without any light of the pattern.

    Pixels that the predictions tell apart by less than ``least`` are not asked.

    Where pixels are too noisy to tell, means over blocks are asked.
    """
    found = contest_of_pixels(seen, noise.variance(seen), wanted, rival, black, least, noise.least_variance)
    if found.is_told:
        return found
    share = np.float32(1 / raster.pooled)
    variance = raster.pool(noise.variance(seen)) * share
    one, other = (Expected(raster.pool(e.counts), raster.pool(e.variance) * share) for e in (wanted, rival))
    least = None if least is None else raster.pool(least)
    return contest_of_pixels(raster.pool(seen), variance, one, other, raster.pool(black), least)


def contest_of_pixels(
    seen: Counts | Floats,
    variance: Floats,
    wanted: Expected,
    rival: Expected,
    black: Floats,
    least: Floats | None,
    least_variance: float = 0.0,
) -> Contest:
    """The contest of pixels that tell predictions apart; none seen has less than ``least_variance``.

    All arrays are flat and of the same pixels, ``variance`` that of their counts.
    """
    # Hundreds of pictures are judged, each against several, and most pixels are the same in both.
    apart = wanted.counts - rival.counts
    np.abs(apart, out=apart)
    least_variance += float(wanted.least_variance + rival.least_variance)
    likely = np.flatnonzero(apart > np.float32(SIGMAS * np.sqrt(least_variance)))
    chosen = likely
    for some in (thinned(likely, PLENTY), likely):
        light = APART * (np.maximum(wanted.counts[some], rival.counts[some]) - black[some])
        if least is not None:
            np.maximum(light, least[some], out=light)
        noise = variance[some] + wanted.variance[some] + rival.variance[some]
        between = apart[some]
        chosen = some[(between > light) & (between**2 > np.float32(SIGMAS**2) * noise)]
        if chosen.size >= ENOUGH or some.size == likely.size:
            break
    return vote(seen[chosen].astype(np.float32), wanted.counts[chosen], rival.counts[chosen])


def brightness_of_picture(
    seen: Counts, wanted: Expected, black: Floats, noise: Noise, lit: Lit | None, profile: Floats | None
) -> float | None:
    """Light of a picture over that expected; None where too little of it can be measured.

    With the columns of pixels and the `line_profile` of the pattern, only pixels that it lights count, and
    what unlit ones have is left out on both sides: light of the room that has changed, however much the
    prediction scales it, is none of the pattern's. Pixels are chosen by their columns, as noise would choose
    those that are expected too bright.
    """
    full = noise.sensor.full_scale_dn
    variance, room, gained = noise.variance(seen), _NOTHING, _NOTHING
    if lit is not None and profile is not None:
        at = Places.of(lit, profile)
        dark, lights = lit.index[at.unlit], lit.index[at.lit]
        room, gained = (_of_room(each[dark] - black[dark]) for each in (wanted.counts, seen))
        seen, black, variance = seen[lights], black[lights], variance[lights]
        wanted = Expected(wanted.counts[lights], wanted.variance[lights])
    sound = (seen < full) & (wanted.counts < 0.9 * full)
    light, gain = wanted.counts - black - room, seen - black - gained
    return _ratio(gain[sound], light[sound], (wanted.variance + variance)[sound])
