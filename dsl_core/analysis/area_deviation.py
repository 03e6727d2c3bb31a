"""By how much the pixels and areas of classes may be off, from what is known of each pixel.

Three causes, by what the map itself shows:

- **Edges.** A pixel is of one class, but edges run through pixels. Between two classes each pixel along a
  straight piece of the edge is wrong by the same part, spread evenly over one pixel: 1/12 px^2, and pixels of
  a straight piece err together. Beside pixels without a class the edge lies somewhere within these, all round
  in the same sense: they may hold anything from nothing to all. A count leaves them out, so that it is too
  low by half of them on average; it is stated with 1/sqrt(3) px of each. An area counts half of each
  (of an undecided one, its probability), with 1/sqrt(12) px.
- **Classes.** A pixel is of its class with a probability, independently of others; pixels that are called
  undecided are missing by the probability of the class, all of them together.
- **Depth.** An area goes with the square of the depth. Errors of depth are taken to be shared by all pixels,
  which is the most that they can do.

Angles and differences are no probabilities: maps by them have no deviations. Errors of normals are not known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.classify import ClassMap, Measure, Scores

Values = NDArray[np.intp]
Map = NDArray[np.float64]

#: Variance of what is spread evenly over one pixel, px^2; and its mean square from one end, px^2.
_EVENLY, _FROM_END = 1 / 12, 1 / 3


@dataclass(frozen=True)
class ClassDeviations:
    """One standard deviation by the values of a map: pixels, and area in mm2 (None without points).

    NaN for what is no class, and for a class without pixels while some that have a point were not judged: no
    map says how many of these are of it. ``beside_mm2`` is what an area has in pixels without a class, on
    average.
    """

    pixels: Map
    areas_mm2: Map | None = None
    beside_mm2: Map | None = None


def class_deviations(
    scores: Scores, shown: ClassMap, areas_mm2: Map | None = None, depth_relative_std: Map | None = None
) -> ClassDeviations | None:
    """Deviations of a map's classes; None where the scores are no probabilities.

    ``areas_mm2`` and ``depth_relative_std`` (rows, columns): area of each pixel, NaN without a point, and the
    deviation of its depth as a share of it, 0 if it is not given.
    """
    if scores.measure is not Measure.PROBABILITY:
        return None
    variance, _ = _variance(scores, shown, np.ones(shown.values.shape), _FROM_END)
    pixels = np.sqrt(variance)
    unknown = np.isin(np.arange(len(pixels)), [0, shown.none, shown.unsure])
    if not_judged(shown, areas_mm2).any():
        unknown |= np.bincount(shown.values.ravel(), minlength=len(pixels)) == 0
    pixels[unknown] = np.nan
    if areas_mm2 is None:
        return ClassDeviations(pixels)
    weights = _everywhere(areas_mm2)
    variance, beside = _variance(scores, shown, weights, _EVENLY)
    # Pixels of a class that have no point are missing from its area.
    pointless = np.where(np.isfinite(areas_mm2), 0.0, weights)
    variance += np.bincount(shown.values.ravel(), pointless.ravel(), len(variance)) ** 2
    if depth_relative_std is not None:
        by_depth = 2 * weights * np.nan_to_num(depth_relative_std)
        variance += np.bincount(shown.values.ravel(), by_depth.ravel(), len(variance)) ** 2
    variance[unknown] = np.nan
    return ClassDeviations(pixels, np.sqrt(variance), beside)


def not_judged(shown: ClassMap, areas_mm2: Map | None = None) -> NDArray[np.bool_]:
    """Pixels (rows, columns) that may be of any class: not judged, though they have a point if any has."""
    unjudged = shown.values == 0
    return np.asarray(unjudged if areas_mm2 is None else unjudged & np.isfinite(areas_mm2))


def _everywhere(areas_mm2: Map) -> Map:
    """Areas of all pixels: one without a point is as large as the nearest that has one.

    Where nothing was measured a class may go on, for as much as elsewhere.
    """
    known = np.isfinite(areas_mm2)
    if known.all() or not known.any():
        return np.nan_to_num(areas_mm2)
    # Opening a result, whose page knows class maps, does not wait for scipy.
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(areas_mm2[tuple(nearest)])


def _variance(scores: Scores, shown: ClassMap, weights: Map, of_beside: float) -> tuple[Map, Map]:
    """Variance of the sum of weights (rows, columns) for each value of a map, without that of depth.

    Also what it has on average in pixels without a class beside it, of which one holds a share with the
    variance ``of_beside``.
    """
    values, size = shown.values.astype(np.intp), len(shown.labels)
    variance, missing = np.zeros(size), np.zeros(size)
    beside = np.zeros(0, np.intp)
    index = np.arange(values.size).reshape(values.shape)
    for ours, theirs, weight, at in _sides(values, weights, index):
        is_edge = (ours != theirs) & _is_class(ours, shown)
        between = is_edge & _is_class(theirs, shown)
        # A straight piece errs as one.
        begins = between.copy()
        begins[1:] &= ~(between[:-1] & (ours[:-1] == ours[1:]))
        piece = np.cumsum(begins.T).reshape(begins.T.shape).T - 1
        lengths = np.bincount(piece[between], weight[between], int(begins.sum()))
        variance += np.bincount(ours.T[begins.T], _EVENLY * lengths**2, size)
        alone = is_edge & ~between
        beside = np.concatenate([beside, at[alone] * size + ours[alone]])
    beside = np.unique(beside)
    pixel, value = np.divmod(beside, size)
    missing += np.sqrt(of_beside) * np.bincount(value, weights.ravel()[pixel], size)
    _add_classes(scores, shown, weights, beside, variance, missing)
    expected = weights.ravel()[pixel] * _share_beside(scores, shown, pixel, value)
    return np.asarray(variance + missing**2), np.asarray(np.bincount(value, expected, size), np.float64)


def _share_beside(scores: Scores, shown: ClassMap, pixel: Values, value: Values) -> Map:
    """The share of pixels (flat indices) that the class of a value beside them has on average.

    Half of one that nothing explains: an edge runs through it. An undecided one may as well be of two other
    classes, and has its probability of this one.
    """
    best, second, margin = (a.ravel()[pixel] for a in (scores.best, scores.second, scores.margin))
    sure = np.clip(margin.astype(np.float64), 0, 1)
    named = np.where(best + 1 == value, sure, np.where(second + 1 == value, 1 - sure, 0.0))
    return np.asarray(np.where(shown.values.ravel()[pixel] == shown.unsure, named, 0.5))


def _sides(values: Values, weights: Map, index: Values) -> Iterator[tuple[Values, Values, Map, Values]]:
    """Each pixel, one neighbour, and its index, turned so that straight edges run along the first axis."""
    for turn in (False, True):
        v, w, i = (values.T, weights.T, index.T) if turn else (values, weights, index)
        yield v[:, :-1], v[:, 1:], w[:, :-1], i[:, 1:]
        yield v[:, 1:], v[:, :-1], w[:, 1:], i[:, :-1]


def _is_class(values: Values, shown: ClassMap) -> NDArray[np.bool_]:
    return np.asarray((values > 0) & (values < shown.none))


def _add_classes(
    scores: Scores, shown: ClassMap, weights: Map, beside: Values, variance: Map, missing: Map
) -> None:
    """Add what probabilities leave open; ``beside`` (pixel times values, plus value) is counted before."""
    size = len(shown.labels)
    judged = np.flatnonzero(scores.best >= 0)
    best, second = (a.ravel()[judged].astype(np.intp) + 1 for a in (scores.best, scores.second))
    value, weight = shown.values.ravel()[judged], weights.ravel()[judged]
    sure = np.clip(scores.margin.ravel()[judged].astype(np.float64), 0, 1)
    for other, probability in ((best, sure), (second, 1 - sure)):
        # A second class of 0 is none: there is one class only.
        named = (other > 0) & (value > 0) & (value < shown.none)
        chance = weight**2 * probability * (1 - probability)
        variance += np.bincount(other[named], chance[named], size)
        unsure = (other > 0) & (value == shown.unsure) & ~np.isin(judged * size + other, beside)
        missing += np.bincount(other[unsure], (weight * probability)[unsure], size)
