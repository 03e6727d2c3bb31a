"""A class for every pixel of a result, from how well each class explains its spectrum.

Three measures: the spectral angle (F. A. Kruse et al., Remote Sens. Environ. 44, 1993), the root mean square
difference, and the probability that follows from the deviation stated for each band. The first two need a
threshold that somebody chooses; the third needs a rate: how many pixels of a known class may be called
"none of these". Scores are computed once; `ClassMap.of` applies limits to them in milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.alike import groups_alike, nearest_shapes
from dsl_core.analysis.band_noise import band_correlation, usual_correlation
from dsl_core.analysis.classes import FEWEST_BANDS, SpectralClass, is_judged, marked_by, shared_names
from dsl_core.analysis.evened import evened
from dsl_core.analysis.likelihood import Block, class_fit
from dsl_core.analysis.mark_colours import Ground, mark_colour
from dsl_core.errors import DecodeError
from dsl_core.evaluation.uncertainty import DECIDED_FROM
from dsl_core.progress import NoProgress, Progress
from dsl_core.words import as_given, counted

Cube = NDArray[np.float32] | NDArray[np.float64]
Map = NDArray[np.float32]
Mask = NDArray[np.bool_]
#: Level of a spectrum relative to its class: as sure as the result states it, or any.
Brightness = Literal["stated", "free"]

#: Pixels at once, so that intermediates stay small.
_AT_ONCE = 8192
#: Classes of a map that ENVI, and a colour table, can hold.
MOST_CLASSES = 250
#: What a map calls the pixels that have no class; no class is called that.
_NOT_JUDGED, _NONE, _UNSURE = "not judged", "none of these", "undecided"
NOT_JUDGED_COLOUR, NONE_COLOUR, UNSURE_COLOUR = "#000000", "#777777", "#c8c8c8"


class Measure(Enum):
    """How a spectrum is compared with a class; the value is its name on the command line."""

    PROBABILITY = "probability"
    ANGLE = "angle"
    RMSE = "rmse"


@dataclass(frozen=True)
class Limits:
    """What a pixel must fulfil to be given a class.

    ``worst``: for the probability, the share of pixels of a known class that may be called none of these; for
    the other measures the largest angle (rad) or difference (1). ``margin``: for the probability, that of the
    class, and for the others by which share the second class must be worse. Raises `DecodeError` for limits
    that are no numbers, or below 0.
    """

    worst: float
    margin: float

    def __post_init__(self) -> None:
        for name, given in (("worst", self.worst), ("margin", self.margin)):
            if not isinstance(given, int | float | np.number) or not 0 <= given < math.inf:
                raise DecodeError(
                    f"The limit {name!r} must be a number of at least 0, not {as_given(given)}."
                )

    @classmethod
    def chosen(cls, measure: Measure, worst: float | None, margin: float | None) -> Limits:
        """The usual limits but for those that are given.

        Raises `DecodeError`, also for a share or a probability above 1.
        """
        usual = _USUAL[measure]
        limits = cls(usual.worst if worst is None else worst, usual.margin if margin is None else margin)
        if measure is Measure.PROBABILITY and max(limits.worst, limits.margin) > 1:
            raise DecodeError(
                f"For the probability, 'worst' is a share of pixels and 'margin' a probability, from 0 to 1;"
                f" given {limits.worst:g} and {limits.margin:g}. Give smaller ones, or another measure."
            )
        return limits

    @classmethod
    def usual(cls, measure: Measure) -> Limits:
        """The limits that are used unless others are given."""
        return _USUAL[measure]


_USUAL = {
    Measure.PROBABILITY: Limits(0.01, 0.95),
    Measure.ANGLE: Limits(0.1, 0.1),
    Measure.RMSE: Limits(0.03, 0.1),
}


@dataclass(frozen=True)
class Scores:
    """How each pixel (rows, columns) compares with the classes, by ``names`` and indices of `mark_colours`.

    ``best`` and ``second`` are indices into ``names``, -1 where nothing was judged. ``fit`` is, of the best
    class, the share of its own pixels that fit worse (probability), else its angle (rad) or difference;
    ``margin`` its probability among the classes, else by which share the second is worse.
    """

    measure: Measure
    names: tuple[str, ...]
    colours: tuple[int, ...]
    best: NDArray[np.int16]
    second: NDArray[np.int16]
    fit: Map
    margin: Map


@dataclass(frozen=True)
class ClassMap:
    """A class for every pixel (rows, columns).

    0 is not judged, 1 + an index in ``names`` a class; then come `none` and `unsure`.
    """

    names: tuple[str, ...]
    colours: tuple[int, ...]
    values: NDArray[np.uint8]

    @classmethod
    def of(cls, scores: Scores, limits: Limits | None = None) -> ClassMap:
        """The map under limits; a pixel without margin to a second class is not given a name."""
        limits = limits or Limits.usual(scores.measure)
        judged = scores.best >= 0
        is_rate = scores.measure is Measure.PROBABILITY
        with np.errstate(invalid="ignore"):
            none = scores.fit < limits.worst if is_rate else scores.fit > limits.worst
            unsure = scores.margin < limits.margin
        values = (scores.best + 1).astype(np.uint8)
        values[judged & unsure] = len(scores.names) + 2
        values[judged & none] = len(scores.names) + 1
        values[~judged] = 0
        return cls(scores.names, scores.colours, values)

    @property
    def none(self) -> int:
        """The value of pixels that are none of the classes."""
        return len(self.names) + 1

    @property
    def unsure(self) -> int:
        """The value of pixels that may be of two classes."""
        return len(self.names) + 2

    @property
    def labels(self) -> tuple[str, ...]:
        """A name for every value of the map."""
        return (_NOT_JUDGED, *self.names, _NONE, _UNSURE)

    def palette(self, ground: Ground = "light") -> tuple[str, ...]:
        """A colour ``#rrggbb`` for every value of the map: of a class, that of the mark it comes from."""
        classes = (mark_colour(index, ground) for index in self.colours)
        return (NOT_JUDGED_COLOUR, *classes, NONE_COLOUR, UNSURE_COLOUR)


def score(
    reflectance: Cube,
    std: Cube | None,
    data_share: Cube | None,
    flags: NDArray[np.integer],
    classes: Sequence[SpectralClass],
    measure: Measure = Measure.PROBABILITY,
    brightness: Brightness = "stated",
    progress: Progress | None = None,
    bands_nm: NDArray[np.float64] | None = None,
) -> Scores:
    """Compare every pixel with every class.

    Cubes (bands, rows, columns), ``flags`` (rows, columns). ``bands_nm`` (bands,) say how bands err together
    where too few pixels do; without them, they are taken to be the usual 5 nm apart. Bands that the prior
    decided, not the data, count for the probability in no pixel. Raises `DecodeError` for too few classes or
    other bands, for a class with a name of pixels without one, for fewer than `FEWEST_BANDS` bands unless the
    measure is the difference, and for a probability without deviations.
    """
    classes = marked_by(shared_names(classes), {})
    _check(reflectance, std, classes, measure)
    judged = is_judged(flags) & np.isfinite(reflectance).all(0)
    progress = progress or NoProgress()
    names = tuple(each.name for each in classes)
    scores = Scores(
        measure,
        names,
        tuple(each.colour or 0 for each in classes),
        best=np.full(flags.shape, -1, np.int16),
        second=np.full(flags.shape, -1, np.int16),
        fit=np.full(flags.shape, np.nan, np.float32),
        margin=np.full(flags.shape, np.nan, np.float32),
    )
    if measure is not Measure.PROBABILITY:
        _by_distance(scores, reflectance, np.flatnonzero(judged), classes, progress)
        return scores
    assert std is not None
    judged &= np.isfinite(std).all(0)
    at, done = np.flatnonzero(judged), 0
    nm = np.arange(0.0, 5.0 * len(reflectance), 5.0) if bands_nm is None else bands_nm
    alike, correlations = _correlations(reflectance, std, at, flags == 0, classes, nm)
    flat = [cube.reshape(len(cube), -1) for cube in (reflectance, std)]
    decided = None if data_share is None else data_share.reshape(len(data_share), -1) >= DECIDED_FROM
    for pixels, group, bands in _alike(at, alike, decided, len(reflectance)):
        progress.report("compare with the classes", done, at.size)
        done += pixels.size
        if np.count_nonzero(bands) < FEWEST_BANDS:
            continue
        values, spread = (np.asarray(cube[np.ix_(bands, pixels)], np.float32) for cube in flat)
        correlation = correlations[group][np.ix_(bands, bands)]
        block = Block.of(values, spread, correlation, brightness == "free")
        _by_probability(scores, block, pixels, [_of_bands(each, bands) for each in classes])
    return scores


def _correlations(
    reflectance: Cube,
    std: Cube,
    at: NDArray[np.intp],
    good: Mask,
    classes: Sequence[SpectralClass],
    bands_nm: NDArray[np.float64],
) -> tuple[NDArray[np.intp], list[NDArray[np.float64]]]:
    """How bands err together in each group of pixels; of all together where one has too few pixels.

    The group of each pixel (flat), -1 where nothing is judged, and the correlation of each group.
    """
    shape = nearest_shapes(reflectance, at, classes)
    together = band_correlation(reflectance, std, good & (shape >= 0).reshape(good.shape))
    if together is None:
        together = usual_correlation(bands_nm)
    groups = groups_alike(reflectance, std, shape, good.ravel(), classes, together)
    of_groups = groups.reshape(good.shape)
    each = (
        band_correlation(reflectance, std, good & (of_groups == group)) for group in range(groups.max() + 1)
    )
    return groups, [together if found is None else found for found in each]


def _check(reflectance: Cube, std: Cube | None, classes: Sequence[SpectralClass], measure: Measure) -> None:
    if not classes or len(classes) > MOST_CLASSES:
        raise DecodeError(
            f"A class map needs 1 to {MOST_CLASSES} classes; given {len(classes)}. Choose other spectra, or"
            " group them."
        )
    taken = [each.name for each in classes if each.name in (_NOT_JUDGED, _NONE, _UNSURE)]
    if taken:
        raise DecodeError(
            f"No class can be called {taken[0]!r}: a class map calls pixels without a class so. Rename it."
        )
    wrong = [each.name for each in classes if len(each.mean) != len(reflectance)]
    if wrong:
        raise DecodeError(f"{wrong[0]} does not have the {len(reflectance)} bands of the result.")
    if measure is not Measure.RMSE and len(reflectance) < FEWEST_BANDS:
        raise DecodeError(
            f"The result has {counted(len(reflectance), 'band')}; to compare shapes of spectra,"
            f" {FEWEST_BANDS} at least are needed. Reconstruct more bands, or classify by rmse."
        )
    states_any = std is not None and any(np.isfinite(band).any() for band in std)
    if measure is Measure.PROBABILITY and not states_any:
        raise DecodeError(
            "The result states no deviations, so there are no probabilities. Classify by angle or rmse."
        )


def _alike(
    at: NDArray[np.intp], group: NDArray[np.intp], decided: Mask | None, bands: int
) -> Iterator[tuple[NDArray[np.intp], int, Mask]]:
    """Pixels in blocks of one group of which the data decide the same bands, with group and bands."""
    if decided is None:
        patterns, which = np.ones((1, bands), bool), np.zeros(at.size, np.intp)
    else:
        packed = np.packbits(decided[:, at], axis=0)
        _, first, which = np.unique(packed, axis=1, return_index=True, return_inverse=True)
        patterns, which = decided[:, at[first]].T, which.ravel()
    order = np.lexsort((group[at], which))
    at, keys = at[order], np.stack([which[order], group[at[order]]])
    borders = np.flatnonzero(np.any(np.diff(keys, axis=1), axis=0)) + 1
    for members, key in zip(np.split(at, borders), np.split(keys, borders, axis=1), strict=True):
        for start in range(0, members.size, _AT_ONCE):
            yield members[start : start + _AT_ONCE], int(key[1, 0]), patterns[key[0, 0]]


def _of_bands(each: SpectralClass, bands: Mask) -> SpectralClass:
    """A class at some of its bands."""
    if bands.all():
        return each
    members = (
        replace(m, mean=m.mean[bands], std=m.std[bands], components=m.components[:, bands])
        for m in each.members
    )
    return replace(each, members=tuple(members))


def _by_probability(
    scores: Scores, block: Block, at: NDArray[np.intp], classes: Sequence[SpectralClass]
) -> None:
    from scipy.special import chdtrc

    chi_square, log_likelihood = np.empty((2, len(classes), at.size))
    alike = evened(classes, np.median(block.std, axis=1), block.is_free)
    for index, (each, wide) in enumerate(zip(classes, alike, strict=True)):
        chi_square[index], log_likelihood[index] = class_fit(block, each)
        if wide is not each:
            log_likelihood[index] = class_fit(block, wide)[1]
    order = np.argsort(-log_likelihood, axis=0)
    best = order[0]
    total = np.logaddexp.reduce(log_likelihood, axis=0)
    every = np.arange(at.size)
    freedom = len(block.reflectance) - int(block.is_free)
    scores.best.flat[at] = best
    scores.second.flat[at] = order[1] if len(classes) > 1 else -1
    scores.fit.flat[at] = chdtrc(freedom, chi_square[best, every])
    scores.margin.flat[at] = np.exp(log_likelihood[best, every] - total)


def _by_distance(
    scores: Scores,
    reflectance: Cube,
    at: NDArray[np.intp],
    classes: Sequence[SpectralClass],
    progress: Progress,
) -> None:
    """Angle or root mean square difference to the nearest spectrum of each class."""
    flat = reflectance.reshape(len(reflectance), -1)
    for start in range(0, at.size, _AT_ONCE):
        progress.report("compare with the classes", start, at.size)
        pixels = at[start : start + _AT_ONCE]
        values = flat[:, pixels].astype(np.float32)
        distance = np.stack(
            [np.min([_distance(scores.measure, values, m.mean) for m in c.members], axis=0) for c in classes]
        )
        order = np.argsort(distance, axis=0)
        every = np.arange(pixels.size)
        nearest = distance[order[0], every]
        scores.best.flat[pixels] = order[0]
        scores.fit.flat[pixels] = nearest
        scores.margin.flat[pixels] = 1.0
        if len(classes) > 1:
            scores.second.flat[pixels] = order[1]
            second = distance[order[1], every]
            # Of two classes that both fit without any difference, neither is better.
            worse = np.divide(nearest, second, out=np.ones_like(nearest), where=second > 0)
            scores.margin.flat[pixels] = 1 - worse


def _distance(measure: Measure, values: Map, mean: NDArray[np.float64]) -> Map:
    wanted = mean.astype(np.float32)
    if measure is Measure.RMSE:
        return np.asarray(np.sqrt(np.mean(np.square(values - wanted[:, None]), axis=0)))
    size = np.linalg.norm(values, axis=0) * np.linalg.norm(wanted)
    return np.asarray(np.arccos(np.clip(wanted @ values / np.maximum(size, 1e-20), -1, 1)), np.float32)
