"""What the frames of a scan do not show: a rig that has changed since it was calibrated, weeks before."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np

from dsl_core.model.calibration.light_check import LightCheck
from dsl_core.model.fit import Fit
from dsl_core.model.rig import Rig
from dsl_core.solve.normal import BAND_95

#: Within a week lamps hardly age, and people remember what they have touched.
FRESH = timedelta(days=7)
#: Within a day the light of a projector that has warmed up is that of its calibration.
STEADY = timedelta(days=1)
#: The level of the light wanders from then on: its relative deviation grows as the root of the days, by this
#: much for one. LED projectors lose little by age, and change by dust, heat and how they are set: after three
#: weeks 95 % of the levels are thought to be within 6.6 %. This is a default, not a measurement.
PER_ROOT_DAY = 0.0075
#: The same of a rig that a scan shows to be not as calibrated, whatever dates say: what moves a film a little
#: may change its light as well, which no scan shows. It counts as one that is three weeks old.
CHANGED_REL_STD = PER_ROOT_DAY * 20**0.5
#: The level of a lamp that nobody has measured since its calibration, on whatever day: how well it comes back
#: when it is switched on, and stays as its settings are. 95 % of the levels, of each colour by itself, are
#: thought to be within 6 % of the calibrated one. This is a default, not a measurement.
UNCHECKED_REL_STD = 0.03
#: How well a level is known on a day on which a drift check measured it, at best.
CHECKED_REL_STD = 0.005
#: What a rig's own drift checks say counts against the default as much as this many of them would.
DEFAULT_CHECKS = 3.0
#: Changes of the light between two checks on one day tell of the checks, not of age.
LEAST_DAYS = 1.0
#: The calibration that measures the level of the light in rigs whose calibrations do not say when they did.
LIGHT = "spectralon"


@dataclass(frozen=True)
class LightLevel:
    """How well the level of the light is known in a scan.

    ``rel_std`` is its relative deviation, ``days`` how far the scan is from when the level was last measured:
    by a drift ``check``, or by the calibration where that is None.
    """

    rel_std: float
    days: float
    check: LightCheck | None = None


def light_level(rig: Rig, captured: str) -> LightLevel | None:
    """How well the light's level is known in a scan ``captured`` at a time (ISO 8601); None without dates.

    What was measured nearest to the scan counts, before or after it: a check also where nobody noted when the
    light was calibrated.
    """
    scanned, calibrated = _time(captured), _time(light_calibrated(rig))
    if scanned is None:
        return None
    ages: list[tuple[timedelta, LightCheck | None]] = []
    if calibrated is not None:
        ages.append((abs(scanned - calibrated), None))
    for check in rig.light_checks:
        checked = _time(check.checked)
        if checked is not None and _time(check.calibrated) == calibrated:
            ages.append((abs(scanned - checked), check))
    if not ages:
        return None
    # Where both are as near, a check was made after the calibration, to see what had become of it.
    age, nearest = min(ages, key=lambda each: (each[0], each[1] is None))
    days = age / timedelta(days=1)
    wander = wander_per_root_day(rig.light_checks) * max(days - STEADY / timedelta(days=1), 0) ** 0.5
    found = (0.0, 0.0) if nearest is None else (nearest.largest_change, nearest.std)
    return LightLevel(float(np.linalg.norm([wander, *found])), days, nearest)


def scale_rel_std(rig: Rig, captured: str) -> float:
    """Relative deviation of the light of each colour in a scan ``captured`` at a time (ISO 8601).

    Nothing in the scan shows it, and all its reflectances are off by it together. Deviations of reflectance
    contain of this only what a drift check found and what age adds.
    """
    level = light_level(rig, captured)
    if level is None:
        return UNCHECKED_REL_STD
    is_checked = level.check is not None and level.days <= STEADY / timedelta(days=1)
    return max(level.rel_std, CHECKED_REL_STD if is_checked else UNCHECKED_REL_STD)


def whole_scale_rel_std(rig: Rig, captured: str, fit: Fit) -> float:
    """Relative deviation of the scale of a result's reflectance, with all that its pixels have in common.

    ``rig`` is as calibrated, and not yet `aged`. Light counts by what is known of it after all, which is less
    than deviations contain.
    """
    level = light_level(rig, captured)
    contained = 0.0 if level is None else level.rel_std
    others = max(fit.common_rel_std**2 - contained**2, 0.0) ** 0.5
    return float(np.hypot(others, max(scale_rel_std(rig, captured), fit.level_rel_std)))


def scale_in_words(rig: Rig, captured: str, rel_std: float) -> str:
    """What the scale of a scan's reflectance rests on, and to what share it is known."""
    level, calibrated = light_level(rig, captured), light_calibrated(rig)[:10]
    known = f"Scale of reflectance: known to {BAND_95 * rel_std:.1%}, for each colour of the light"
    if level is not None and level.check is not None:
        return f"{known} (light checked on {level.check.checked[:10]})."
    since = f" of {calibrated}" if calibrated else ""
    return (
        f"{known} (light not checked since the calibration{since}). No pixel shows it, and deviations do not"
        " contain all of it: run the drift check with the Spectralon, or scan a surface of known reflectance."
    )


def wander_per_root_day(checks: tuple[LightCheck, ...]) -> float:
    """Relative deviation of the light's level after a day, of which it grows as the root of the days.

    From how the levels changed between a rig's own checks, and the default; an error of the checks themselves
    counts as none of the light.

    >>> round(wander_per_root_day(()), 6)
    0.0075
    """
    squares = []
    for calibrated in dict.fromkeys(check.calibrated for check in checks):
        mine = [(_time(c.checked), c) for c in checks if c.calibrated == calibrated]
        known = sorted(((time, c) for time, c in mine if time is not None), key=lambda each: each[0])
        before, start = LightCheck(checked="", calibrated="", levels=(1.0, 1.0, 1.0)), _time(calibrated)
        if start is None and known:  # how old the light was at the first check is unknown
            start, before = known[0]
        for time, check in known:
            if start is not None and (days := (time - start) / timedelta(days=1)) >= LEAST_DAYS:
                change = np.subtract(check.levels, before.levels)
                own = check.std**2 + before.std**2
                squares.append(max(float(np.mean(change**2)) - own, 0.0) / days)
                before, start = check, time
    weight = DEFAULT_CHECKS + len(squares)
    return float(np.sqrt((DEFAULT_CHECKS * PER_ROOT_DAY**2 + sum(squares)) / weight))


def light_calibrated(rig: Rig) -> str:
    """When the level of a rig's light was calibrated, ISO 8601; empty where nobody noted it.

    Each calibration that measures it replaces what those before it found.
    """
    dates = [note.measured for note in rig.calibrations if note.name == LIGHT]
    dates += [note.light for note in rig.calibrations if note.light]
    return dates[-1] if dates else rig.provenance.created


def aged(rig: Rig, captured: str) -> Rig:
    """The rig whose stated white is as uncertain as its light is in a scan ``captured`` at a time."""
    level = light_level(rig, captured)
    if level is None or not level.rel_std:
        return rig
    unsure = float(np.hypot(rig.reference_rel_std, level.rel_std))
    return rig.model_copy(update={"reference_rel_std": unsure})


def doubt_of_changed(rig: Rig) -> float:
    """What is to be added to ``reference_rel_std`` of a rig that a scan shows to be not as calibrated."""
    return float(max(CHANGED_REL_STD**2 - rig.reference_rel_std**2, 0.0) ** 0.5)


def unseen_since(rig: Rig, captured: str) -> str:
    """Sentences on what a scan ``captured`` at a time (ISO 8601) leaves open; empty for a fresh calibration.

    Light that has become weaker looks like a darker surface, and a projector that has turned like a nearer or
    farther one: no residual shows either. The part of the calibration that is farthest from the scan counts
    for what has moved, the nearest measurement of the light for that. Nothing is said where a date is missing
    or cannot be read.
    """
    return " ".join(part for part in (_of_light(rig, captured), _of_mounts(rig, captured)) if part)


def _of_light(rig: Rig, captured: str) -> str:
    level = light_level(rig, captured)
    if level is None:
        return ""
    known = (
        f"no scan shows by itself whether its level has changed since. Deviations of reflectance contain"
        f" {BAND_95 * level.rel_std:.1%} for its age."
    )
    remedy = " Run the drift check with the Spectralon, or calibrate with it again."
    if level.check is not None:
        change, std = level.check.largest_change, level.check.std
        found = f"The drift check of {level.check.checked[:10]} found the light {change:+.1%} ± {std:.1%} off"
        if abs(change) > max(2 * std, 0.01):
            return f"{found}: reflectance is off by as much. {_calibrate_light(rig)}"
        if level.days <= FRESH.days:
            return ""
        return f"The light was last checked {_apart(rig, captured, level)} this scan, and {known}{remedy}"
    if level.days <= FRESH.days:
        return ""
    return f"The light was calibrated {_apart(rig, captured, level)} this scan, and {known}{remedy}"


def _calibrate_light(rig: Rig) -> str:
    """What to do about light that is not as calibrated."""
    others = [repr(note.title) for note in rig.calibrations if note.light and note.name != LIGHT]
    more = f", and capture {' and '.join(others)} again, which rest on its level as well" if others else ""
    return f"Calibrate with the Spectralon again{more}."


def _apart(rig: Rig, captured: str, level: LightLevel) -> str:
    """How long before or after a scan the light was measured."""
    measured = _time(light_calibrated(rig) if level.check is None else level.check.checked)
    scanned = _time(captured)
    assert measured is not None
    assert scanned is not None
    return f"{int(level.days)} days {'before' if measured <= scanned else 'after'}"


def _of_mounts(rig: Rig, captured: str) -> str:
    dates = [note.measured for note in rig.calibrations] or [rig.provenance.created]
    scanned, accepted = _time(captured), [time for time in map(_time, dates) if time is not None]
    if scanned is None or not accepted:
        return ""
    farthest = max(accepted, key=lambda time: abs(scanned - time))
    age, which = abs(scanned - farthest), "older" if farthest < scanned else "newer"
    if age <= FRESH:
        return ""
    return (
        f"The calibration is {age.days} days {which} than this scan. No scan shows by itself whether camera"
        " or projector have moved a little in between, which puts depth off: run the drift check, or scan a"
        " surface that you know."
    )


def _time(text: str) -> datetime | None:
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)
