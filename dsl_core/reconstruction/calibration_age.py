"""What the frames of a scan do not show: a rig that has changed since it was calibrated, weeks before."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from dsl_core.model.rig import Rig

#: Within a week lamps hardly age, and people remember what they have touched.
FRESH = timedelta(days=7)


def unseen_since(rig: Rig, captured: str) -> str:
    """A sentence on what a scan ``captured`` at a time (ISO 8601) leaves open; empty for a fresh calibration.

    Light that has become weaker looks like a darker surface, and a projector that has turned like a nearer or
    farther one: no residual shows either. The oldest part of the calibration counts. Nothing is said where a
    date is missing or cannot be read.
    """
    dates = [note.accepted for note in rig.calibrations] or [rig.provenance.created]
    scanned, accepted = _time(captured), [time for time in map(_time, dates) if time is not None]
    if scanned is None or not accepted:
        return ""
    age = scanned - min(accepted)
    if age <= FRESH:
        return ""
    return (
        f"The calibration is {age.days} days older than this scan. No scan shows by itself whether the light"
        " has changed in level since, which puts reflectance off, or camera or projector have moved a little,"
        " which puts depth off: run the drift check, or scan a surface that you know."
    )


def _time(text: str) -> datetime | None:
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    return time if time.tzinfo is not None else time.replace(tzinfo=UTC)
