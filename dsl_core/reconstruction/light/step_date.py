"""When something changed that was measured before and after: at once, at some shot, or little by little.

Shots that are taken again at intervals say by how much light or black changed, not when. Neighbouring frames
say by how much they differ, too uncertainly to be added up over many. Both together date a change: if it
came at once, one difference is about as large as the whole, and all others are chance.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: How much likelier (chi-square) a step has to be than a steady change: at any shot, and at one of a few.
LIKELIER, LIKELIER_THERE = 25.0, 4.0
#: Other differences of so many deviations, and this share of the whole, are further changes: it was not one.
ALONE_SIGMAS, ALONE_SHARE = 5.0, 0.3
#: Variance by which scenes change from frame to frame, relative to that of the noise: at least.
LEAST_SCENE = 0.3
#: Differences that say what is usual between neighbours.
USUAL_OF = 9


@dataclass(frozen=True)
class Change:
    """A quantity changed by ``total`` from shot ``after`` to shot ``before``."""

    after: int
    before: int
    total: float


def date_of_step(change: Change, steps: Floats, stds: Floats, others: Collection[int] = ()) -> int | None:
    """The first shot after a change that came at once; None if it did not, or nobody can tell.

    ``steps`` and ``stds`` (shots,) are by how much each shot differs from the one before, and its deviation;
    NaN where that is not known. ``others`` are shots at which something else changed at once.
    """
    shots = np.arange(change.after + 1, change.before + 1)
    known = shots[np.isfinite(steps[shots])]
    if known.size < USUAL_OF:
        return None
    more = _unusual(steps[known])
    covariance = _covariance(more, stds[known])
    sure = np.linalg.inv(covariance)
    seen, gradual = sure @ more, np.full(known.size, change.total / known.size)
    like_step = 2 * change.total * seen - change.total**2 * np.diag(sure)
    like_drift = float(2 * gradual @ seen - gradual @ sure @ gradual)
    needed = np.where(np.isin(known, list(others)), LIKELIER_THERE, LIKELIER) + max(like_drift, 0.0)
    best = int((like_step - needed).argmax())
    away = np.abs(more) / np.sqrt(np.diag(covariance))
    others_alike = (away > ALONE_SIGMAS) & (np.abs(more) > ALONE_SHARE * abs(change.total))
    others_alike[best] = False
    return int(known[best]) if like_step[best] > needed[best] and not others_alike.any() else None


def _covariance(more: Floats, stds: Floats) -> Floats:
    """That of differences whose neighbours share a frame, and its noise, and which scenes change as well."""
    noise = np.median(stds) ** 2
    scene = max(float(robust_std(more)) ** 2 - noise, LEAST_SCENE * noise)
    shared = -stds[1:] * stds[:-1] / 2
    return np.asarray(np.diag(stds**2 + scene) + np.diag(shared, 1) + np.diag(shared, -1))


def _unusual(steps: Floats) -> Floats:
    """Differences less what is usual around them: pictures change slowly with the patterns as well."""
    half = USUAL_OF // 2
    wide = np.pad(steps, half, mode="reflect")
    around = np.lib.stride_tricks.sliding_window_view(wide, USUAL_OF)
    return np.asarray(steps - np.median(np.delete(around, half, axis=1), axis=1))
