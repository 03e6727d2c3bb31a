"""Light or black that changed at once during a scan: when it did, and what that makes of each shot.

Old shots that are taken again say by how much, neighbouring frames when. A scan whose old shots look as they
did is not looked at any further.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import CapturedCode
from dsl_core.reconstruction.light.neighbour_steps import (
    NeighbourSteps,
    Scan,
    neighbour_steps,
    pair_against_white,
)
from dsl_core.reconstruction.light.step_date import Change, date_of_step
from dsl_core.reconstruction.merge import Exposed

Floats = NDArray[np.float64]

#: Changes between old shots that are looked into: logarithm of light, and black, DN; in deviations as well.
LEAST_LOG, LEAST_DN, SIGMAS = 0.01, 0.5, 6.0
#: Light that both neighbours hold in common has to be so many deviations to say by how much it changed.
TELLING = 10.0


@dataclass(frozen=True)
class Again:
    """What an old shot had more than at first when it was taken again as ``shot``, and the deviation."""

    shot: int
    more: float
    std: float


@dataclass(frozen=True)
class SuddenChanges:
    """Steps of black (DN) and of the logarithm of light by the first shot after each.

    ``explains_black`` is whether black did not change otherwise.
    """

    black_dn: dict[int, float]
    log: dict[int, float]
    explains_black: bool = True

    def exposed(self, scan: Scan) -> Exposed:
        """In what light each shot was taken: as calibrated at first, with black as in its black frame."""
        log, dn = (_course(steps, scan.plan.shot_count) for steps in (self.log, self.black_dn))
        blacks = {shot.setting: shot.index for shot in scan.shots_of("black", 0)}
        own = [blacks[shot.setting] for shot in scan.plan.shots()]
        return Exposed(np.exp(log), dn - dn[own])


def sudden_changes(
    scan: Scan, column: NDArray[np.integer], whites: Sequence[Again], blacks: Sequence[Again]
) -> SuddenChanges | None:
    """Date the changes that ``whites`` (logarithms of light) and ``blacks`` (DN) show; None if none can be.

    ``column`` are the projector columns of the picture's pixels, negative where unknown.
    """
    at_first = scan.plan.references()
    if not at_first:
        return None
    white, black = (Again(at_first[role].index, 0.0, 0.0) for role in ("white", "black"))
    of_light, of_black = _since_code(scan)
    lights = list(_changes([*of_light, white, *whites], LEAST_LOG))
    darks = list(_changes([*of_black, black, *blacks], LEAST_DN))
    if not lights and not darks:
        return None
    steps = neighbour_steps(scan, column)
    black_dn = {
        at: change.total
        for change in darks
        if (at := date_of_step(change, steps.black_dn, steps.black_std_dn)) is not None
    }
    log, log_std = _light_steps(scan, steps, black_dn)
    light = {
        at: change.total
        for change in lights
        if (at := date_of_step(change, log, log_std, black_dn.keys())) is not None
    }
    found = SuddenChanges(_as_exposed(scan, steps, black_dn, light), light, len(black_dn) == len(darks))
    return found if light or black_dn else None


def _since_code(scan: Scan) -> tuple[tuple[Again, ...], tuple[Again, ...]]:
    """Light and black of the first pair of the code, against those of white and black."""
    plan = scan.plan
    if isinstance(plan.code, CapturedCode):
        return (), ()
    first = min(plan.code_settings)
    at = next(shot.index for shot in scan.shots_of("code", 0) if shot.setting == first)
    light, black = pair_against_white(scan, first, 0)
    return (Again(at, *light),), (Again(at, *black),)


def _changes(seen: Sequence[Again], least: float) -> Iterator[Change]:
    for one, other in pairwise(seen):
        more, std = other.more - one.more, float(np.hypot(one.std, other.std))
        if np.isfinite(more) and abs(more) > max(least, SIGMAS * std):
            yield Change(one.shot, other.shot, more)


def _course(steps: dict[int, float], shots: int) -> Floats:
    course = np.zeros(shots)
    for at, more in steps.items():
        course[at:] += more
    return course


def _light_steps(scan: Scan, steps: NeighbourSteps, black_dn: dict[int, float]) -> tuple[Floats, Floats]:
    """By how much the logarithm of light differs from neighbour to neighbour, black taken off."""
    log, std = steps.log.copy(), steps.log_std.copy()
    above = SuddenChanges(black_dn, {}).exposed(scan).black_dn
    for at in np.flatnonzero(np.isfinite(steps.shared_dn) & np.isnan(log)):
        more = black_dn.get(int(at), 0.0)
        shared = steps.shared_dn[at] - (above[at] - more)
        if shared > TELLING * steps.black_std_dn[at]:
            change = (steps.black_dn[at] - more) / shared
            log[at], std[at] = np.log1p(max(change, -0.9)), steps.black_std_dn[at] / shared
    return log, std


def _as_exposed(
    scan: Scan, steps: NeighbourSteps, black_dn: dict[int, float], light: dict[int, float]
) -> dict[int, float]:
    """Steps of black as large as frames of their own setting show: that of a room grows with exposure."""
    first = min(scan.plan.code_settings)
    shots = tuple(scan.plan.shots())
    found = {}
    for at, more in black_dn.items():
        if shots[at].setting != first and shots[at].role == "spectral":
            around = steps.black_dn[[i for i in range(at - 4, at + 5) if 0 <= i < len(shots) and i != at]]
            shared = float(np.expm1(light.get(at, 0.0))) * steps.shared_dn[at]
            more = float(steps.black_dn[at] - np.nanmedian(around)) - shared
        found[at] = more
    return found
