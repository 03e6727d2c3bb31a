"""What attributes of a result hold as JSON: results come from strangers too, so nothing is taken on trust."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError

from dsl_core.model.plan import CapturePlan

#: Name of the attribute that holds the plan by which a result's frames were captured.
PLAN_ATTRIBUTE = "capture_plan"
#: Name of that which is the relative deviation of all reflectances together, which no pixel shows.
SCALE_ATTRIBUTE = "reflectance_scale_rel_std"
#: Name of that which lists sentences about pictures that do not show their pattern.
DOUBTS = "frames_in_doubt"
#: Names of those that say how wide the bands of a reconstruction are, and where the first of them is.
BAND_WIDTH, FIRST_BAND = "band_width_nm", "first_band_nm"
#: A band is one of those if it is off by no more than this share of their width.
_ON_BAND = 1e-3


def band_attributes(bands_nm: ArrayLike) -> dict[str, float]:
    """What is stated of bands (bands,), nm, that are next to each other; nothing of others."""
    nm = np.asarray(bands_nm, np.float64)
    steps = np.abs(np.diff(nm))
    if not steps.size or not steps[0] > 0 or np.ptp(steps) > _ON_BAND * steps[0]:
        return {}
    return {BAND_WIDTH: round(float(steps.mean()), 6), FIRST_BAND: float(nm[0])}


def stated_band_width_nm(attributes: Mapping[Any, Any], bands_nm: ArrayLike) -> float | None:
    """How wide bands (bands,), nm, are of which others may have been left out.

    None where nobody says, and for means of several. Those of an even number are not among the bands stated;
    those of each 2 p + 1 in turn are so many apart, with p left out before them. Other means of an odd number
    cannot be told from bands that were picked.

    >>> stated = band_attributes([430.0, 435.0, 440.0])
    >>> stated_band_width_nm(stated, [430.0, 440.0]), stated_band_width_nm(stated, [432.5])
    (5.0, None)
    """
    try:
        width, first = (float(attributes[name]) for name in (BAND_WIDTH, FIRST_BAND))
    except (KeyError, TypeError, ValueError):
        return None
    if not (0 < width < math.inf and math.isfinite(first)):
        return None
    steps = (np.asarray(bands_nm, np.float64) - first) / width
    places = np.rint(steps)
    if not (np.abs(steps - places) <= _ON_BAND).all():
        return None
    in_turn = np.abs(np.diff(places)) == 2 * np.abs(places[:1]) + 1
    return None if places[:1].any() and in_turn.size > 1 and in_turn.all() else width


def weights_of_wider(
    bands_nm: ArrayLike,
    attributes: Mapping[Any, Any],
    wider_nm: ArrayLike,
    wider_attributes: Mapping[Any, Any],
) -> NDArray[np.float64] | None:
    """Weights (wider, bands) that average bands (bands,), nm, over wider ones (wider,), nm.

    None unless both say how wide they are, they differ, and the bands rise with none left out in between. A
    row is NaN where the bands do not reach.
    """
    nm, wanted_nm = (np.asarray(each, np.float64) for each in (bands_nm, wider_nm))
    own = stated_band_width_nm(attributes, nm)
    wider = stated_band_width_nm(wider_attributes, wanted_nm)
    if own is None or wider is None or wider <= own * (1 + _ON_BAND) or len(nm) < 2:
        return None
    if np.ptp(np.append(np.diff(nm), own)) > _ON_BAND * own:
        return None
    # Exact where one width is a multiple of the other: a wide triangle is the sum of narrow ones.
    weights = (1 - np.abs(nm - wanted_nm[:, None]) / wider).clip(min=0)
    beyond = (wanted_nm < nm[0] - _ON_BAND) | (wanted_nm > nm[-1] + _ON_BAND)
    return np.where(beyond[:, None], np.nan, weights / weights.sum(1, keepdims=True).clip(min=_ON_BAND))


def sentences_of(attributes: Mapping[Any, Any], name: str) -> tuple[str, ...]:
    """The sentences that an attribute lists, none where there are none that can be read."""
    try:
        found = json.loads(str(attributes.get(name, "[]")))
    except (ValueError, RecursionError):
        return ()
    return tuple(map(str, found)) if isinstance(found, list) else ()


def plan_of(attributes: Mapping[Any, Any]) -> CapturePlan | None:
    """The plan by which the frames were captured; None where there is none, or none that can be read."""
    try:
        return CapturePlan.model_validate_json(str(attributes.get(PLAN_ATTRIBUTE, "")))
    except ValidationError:
        return None
