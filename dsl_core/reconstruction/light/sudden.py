"""Light or black that changed at once during a scan: when it did, and what that makes of each shot.

Old shots that are taken again say by how much, neighbouring frames when. A scan whose old shots look as they
did is not looked at any further.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.plan import Shot
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
#: Taken for a steady one, a step leaves at most half of itself.
LEAST_LOG, LEAST_DN, SIGMAS = 0.02, 0.5, 6.0
#: Light that both neighbours hold in common has to be so many deviations to say by how much it changed.
TELLING = 10.0
#: Deviations from which on a step is not as large in its own frames as in white taken again.
UNLIKE = 4.0
#: What a change of black as lines show it may be wrong by, relative to it, and of that DN at least.
ROUGH_SHARE, ROUGH_DN = 0.1, 0.5


@dataclass(frozen=True)
class Again:
    """What an old shot had more than at first when it was taken again as ``shot``, and the deviation.

    Of black, ``share`` is how much of that was a share of what is above the camera's level, with deviation.
    """

    shot: int
    more: float
    std: float
    share: tuple[float, float] = (0.0, np.inf)


@dataclass(frozen=True)
class Gained:
    """A step of black: ``dn`` in every pixel, and this ``share`` of what it was above the camera's level."""

    dn: float
    share: float


@dataclass(frozen=True)
class SuddenChanges:
    """Steps of black and of the logarithm of light by the first shot after each.

    ``explains_black`` is whether black did not change otherwise. ``apart`` is by how much a step of light
    in its own frames differs from that in white taken again, where that is more than chance.
    """

    black: Mapping[int, Gained]
    log: Mapping[int, float]
    explains_black: bool = True
    apart: float = 0.0

    def exposed(self, scan: Scan) -> Exposed:
        """In what light each shot was taken: as calibrated at first, with black as in its black frame."""
        count = scan.plan.shot_count
        log = _course(self.log, count)
        dn = _course({at: each.dn for at, each in self.black.items()}, count)
        share = _course({at: each.share for at, each in self.black.items()}, count)
        blacks = {shot.setting: shot.index for shot in scan.shots_of("black", 0)}
        own = [blacks[shot.setting] for shot in scan.plan.shots()]
        # Its black frame may be a later one than the shot.
        return Exposed(np.exp(log), dn - dn[own], (share - share[own]) / (1 + share[own]))


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
    lights = [each for each, _ in _changes([*of_light, white, *whites], LEAST_LOG)]
    darks = list(_changes([*of_black, black, *blacks], LEAST_DN))
    if not lights and not darks:
        return None
    steps = neighbour_steps(scan, column)
    dated = {
        at: (change, share)
        for change, share in darks
        if (at := date_of_step(change, steps.black_dn, steps.black_std_dn)) is not None
    }
    rough = {at: _gained(scan, steps, at, *each, None) for at, each in dated.items()}
    log, log_std = _light_steps(scan, steps, rough)
    light = {
        at: change.total
        for change in lights
        if (at := date_of_step(change, log, log_std, dated.keys())) is not None
        # A projector whose light depends on how bright its picture is, or a camera that is not linear, gives
        # white another light than the code before it, and lines another one again.
        and at != white.shot
    }
    gained = {at: _gained(scan, steps, at, *each, light.get(at, 0.0)) for at, each in dated.items()}
    if not light and not dated:
        return None
    # Neighbouring lines differ by what the scene sends back as well; pictures of a code are all light.
    in_code = {shot.index for shot in scan.plan.shots() if shot.role == "code"} & light.keys()
    apart = max((_apart(log[at], log_std[at], light[at]) for at in in_code), default=0.0)
    return SuddenChanges(gained, light, len(dated) == len(darks), apart)


def _apart(seen: float, std: float, total: float) -> float:
    """By how much a step differs from that of white taken again: settings may gain and lose unlike light."""
    off = abs(seen - total)
    return float(off) if off > UNLIKE * std else 0.0


def share_of_black(
    more: NDArray[np.floating], black: NDArray[np.floating], white: NDArray[np.uint16]
) -> tuple[float, float]:
    """The share of black above its level by which it has grown by ``more``, and its deviation.

    Pictures are those of pixels of one setting. White tells bright surfaces from dark ones: the noise of
    black is in both of the others.
    """
    by = white.astype(np.float64) - white.mean()
    slope = float((by * black).sum())
    if slope == 0:
        return 0.0, float("inf")
    share = float((by * more).sum()) / slope
    left = more - more.mean() - share * (black - black.mean())
    return share, float(np.sqrt((by**2).sum()) * left.std() / abs(slope))


def _since_code(scan: Scan) -> tuple[tuple[Again, ...], tuple[Again, ...]]:
    """Light and black of the first pair of the code, against those of white and black."""
    plan = scan.plan
    if isinstance(plan.code, CapturedCode):
        return (), ()
    first = min(plan.code_settings)
    at = next(shot.index for shot in scan.shots_of("code", 0) if shot.setting == first)
    light, black = pair_against_white(scan, first, 0)
    return (Again(at, *light),), (Again(at, *black),)


def _changes(seen: Sequence[Again], least: float) -> Iterator[tuple[Change, tuple[float, float]]]:
    for one, other in pairwise(seen):
        more, std = other.more - one.more, float(np.hypot(one.std, other.std))
        if np.isfinite(more) and abs(more) > max(least, SIGMAS * std):
            known = one.share[0] if np.isfinite(one.share[1]) else 0.0
            yield Change(one.shot, other.shot, more), (other.share[0] - known, other.share[1])


def _course(steps: Mapping[int, float], shots: int) -> Floats:
    course = np.zeros(shots)
    for at, more in steps.items():
        course[at:] += more
    return course


def _light_steps(scan: Scan, steps: NeighbourSteps, black: Mapping[int, Gained]) -> tuple[Floats, Floats]:
    """By how much the logarithm of light differs from neighbour to neighbour, black taken off."""
    log, std = steps.log.copy(), steps.log_std.copy()
    above = SuddenChanges(black, {}).exposed(scan)
    none = Gained(0.0, 0.0)
    for at in np.flatnonzero(np.isfinite(steps.shared_dn) & np.isnan(log)):
        step, dark = black.get(int(at), none), steps.light_dark_dn[at]
        more = step.dn + step.share * dark
        shared = steps.shared_dn[at] - (above.black_dn[at] + above.black_share[at] * dark - more)
        if shared > TELLING * steps.light_std_dn[at]:
            change = (steps.light_dn[at] - more) / shared
            log[at], std[at] = np.log1p(max(change, -0.9)), steps.light_std_dn[at] / shared
    return log, std


def _gained(
    scan: Scan, steps: NeighbourSteps, at: int, change: Change, share: tuple[float, float], log: float | None
) -> Gained:
    """A step of black, from its mean and its share in old shots, and from what lines show of it.

    At another exposure than that of old shots, light of the room is more and the camera's level is not. The
    step of the light is that ``log``; None if it is not known yet.
    """
    shots: tuple[Shot, ...] = tuple(scan.plan.shots())
    black = scan.source.read(scan.plan.references()["black"]).astype(np.float64)
    dark = float(black.mean()) - scan.rig.sensor.black_level_dn
    rows = [(1.0, dark, change.total, 0.05), (0.0, 1.0, *share)]
    if log is not None and np.isfinite(steps.dark_dn[at]):
        around = [i for i in range(at - 4, at + 5) if 0 <= i < len(shots) and i != at]
        own = steps.black_dn[at] - float(np.nanmedian(steps.black_dn[around]))
        own -= float(np.expm1(log)) * steps.faint_dn[at]
        rows.append((1.0, steps.dark_dn[at], own, ROUGH_SHARE * abs(own) + ROUGH_DN))
    weight = np.array([1 / max(std, 1e-9) for *_, std in rows])
    design = np.array([[one, other] for one, other, *_ in rows]) * weight[:, None]
    # Unless something speaks for a share, all pixels have gained alike.
    design = np.vstack([design, [0.0, 1.0]])
    wanted = np.append(np.array([value for *_, value, _ in rows]) * weight, 0.0)
    dn, of_dark = np.linalg.lstsq(design, wanted, rcond=None)[0]
    return Gained(float(dn), float(of_dark))
