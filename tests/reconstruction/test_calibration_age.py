"""A calibration that is weeks older than its scan is told; a fresh one, or one without a date, is not."""

from __future__ import annotations

import pytest

from dsl_core.model.calibration.accepted import CalibrationNote
from dsl_core.model.rig import Provenance, Rig
from dsl_core.reconstruction.calibration_age import unseen_since
from dsl_core.simulation.published_rig import published_rig


def rig_of(created: str, *accepted: str) -> Rig:
    notes = tuple(CalibrationNote(name="spectralon", title="Spectralon", accepted=each) for each in accepted)
    return published_rig().model_copy(
        update={"provenance": Provenance(created=created), "calibrations": notes}
    )


@pytest.mark.parametrize(
    ("rig", "days"),
    [
        (rig_of("2026-03-01T10:00:00+00:00"), 21),
        (rig_of("2026-03-01T10:00:00"), 21),  # as some other program may have written it
        (rig_of("2026-03-21T10:00:00+00:00", "2026-03-20T10:00:00+00:00", "2026-02-28T23:00:00+00:00"), 21),
    ],
)
def test_an_old_calibration_is_told_with_its_age(rig: Rig, days: int) -> None:
    said = unseen_since(rig, "2026-03-22T12:00:00+02:00")
    assert f"is {days} days older than this scan" in said
    assert "run the drift check" in said


@pytest.mark.parametrize("created", ["2026-03-16T10:00:00+00:00", "2026-04-16T10:00:00+00:00", "", "spring"])
def test_nothing_is_said_of_a_fresh_calibration_or_one_without_a_date(created: str) -> None:
    assert unseen_since(rig_of(created), "2026-03-22T12:00:00+00:00") == ""
    assert unseen_since(rig_of("2026-03-01T10:00:00"), "long ago") == ""
