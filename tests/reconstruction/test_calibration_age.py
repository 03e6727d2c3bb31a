"""What a calibration that is weeks older than its scan leaves open of light and mounts."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.calibration.accepted import AcceptedCalibration, CalibrationNote
from dsl_core.model.calibration.light_check import LightCheck
from dsl_core.model.fit import Fit
from dsl_core.model.rig import Provenance, Rig
from dsl_core.reconstruction.calibration_age import (
    CHECKED_REL_STD,
    DEFAULT_CHECKS,
    PER_ROOT_DAY,
    UNCHECKED_REL_STD,
    aged,
    light_level,
    scale_in_words,
    scale_rel_std,
    unseen_since,
    wander_per_root_day,
    whole_scale_rel_std,
)
from dsl_core.simulation.published_rig import published_rig

SCANNED = "2026-03-22T12:00:00+02:00"
THREE_WEEKS = "2026-03-01T10:00:00+00:00"


def rig_of(created: str, *accepted: str, name: str = "spectralon") -> Rig:
    notes = tuple(CalibrationNote(name=name, title="Spectralon", accepted=each) for each in accepted)
    return published_rig().model_copy(
        update={"provenance": Provenance(created=created), "calibrations": notes}
    )


def checked(checked: str, level: float, std: float = 0.0, calibrated: str = THREE_WEEKS) -> LightCheck:
    return LightCheck(checked=checked, calibrated=calibrated, levels=(level, level, level), std=std)


def with_checks(*checks: LightCheck) -> Rig:
    return rig_of(THREE_WEEKS).model_copy(update={"light_checks": checks})


@pytest.mark.parametrize(
    ("rig", "days"),
    [
        (rig_of("2026-03-01T10:00:00+00:00"), 21),
        (rig_of("2026-03-01T10:00:00"), 21),  # as some other program may have written it
        (rig_of("2026-03-21T10:00:00+00:00", "2026-03-20T10:00:00+00:00", "2026-02-28T23:00:00+00:00"), 21),
    ],
)
def test_an_old_calibration_is_told_with_its_age(rig: Rig, days: int) -> None:
    said = unseen_since(rig, SCANNED)
    assert f"is {days} days older than this scan" in said
    assert "run the drift check" in said


@pytest.mark.parametrize("created", ["2026-03-16T10:00:00+00:00", "2026-03-26T10:00:00+00:00", "", "spring"])
def test_nothing_is_said_of_a_fresh_calibration_or_one_without_a_date(created: str) -> None:
    assert unseen_since(rig_of(created), SCANNED) == ""
    assert unseen_since(rig_of("2026-03-01T10:00:00"), "long ago") == ""


def test_the_light_is_the_less_known_the_longer_ago_it_was_calibrated() -> None:
    """No wider within a day; after three weeks the level may well be 5 % off."""
    for fresh in ("2026-03-22T09:00:00+00:00", "2026-03-21T11:00:00+00:00", "2026-03-23T09:00:00+00:00"):
        assert aged(rig_of(fresh), SCANNED) == rig_of(fresh)
    old = aged(rig_of(THREE_WEEKS), SCANNED)
    assert old.reference_rel_std == pytest.approx(PER_ROOT_DAY * 20**0.5)
    assert 1.96 * old.reference_rel_std == pytest.approx(0.066, abs=0.001)
    white = rig_of(THREE_WEEKS).model_copy(update={"reference_rel_std": 0.04})
    assert aged(white, SCANNED).reference_rel_std == pytest.approx((0.04**2 + 20 * PER_ROOT_DAY**2) ** 0.5)
    for undated in (rig_of(""), rig_of("", THREE_WEEKS, name="geometry")):
        assert aged(undated, SCANNED) == undated
    said = unseen_since(rig_of(THREE_WEEKS), SCANNED)
    assert "The light was calibrated 21 days before this scan" in said
    assert "Deviations of reflectance contain 6.6% for its age." in said


def test_the_calibration_of_the_light_counts_not_another_part() -> None:
    notes = (
        CalibrationNote(name="geometry", title="Geometry", accepted=THREE_WEEKS),
        CalibrationNote(name="spectralon", title="Spectralon", accepted="2026-03-22T09:00:00+00:00"),
    )
    rig = rig_of(THREE_WEEKS).model_copy(update={"calibrations": notes})
    assert aged(rig, SCANNED) == rig
    said = unseen_since(rig, SCANNED)
    assert "days older" in said
    assert "light" not in said


def test_pictures_that_were_fitted_again_are_as_old_as_they_are() -> None:
    light = AcceptedCalibration(name="spectralon", title="Spectralon", accepted=SCANNED, captured=THREE_WEEKS)
    rig = rig_of("").model_copy(update={"calibrations": (light.note,)})
    assert aged(rig, SCANNED).reference_rel_std == pytest.approx(PER_ROOT_DAY * 20**0.5)
    assert "is 21 days older than this scan" in unseen_since(rig, SCANNED)


def test_a_calibration_after_the_scan_knows_its_light_no_better_than_one_before() -> None:
    later = rig_of("2026-04-12T10:00:00+00:00")
    assert aged(later, SCANNED).reference_rel_std == pytest.approx(PER_ROOT_DAY * 20**0.5)
    said = unseen_since(later, SCANNED)
    assert "21 days after this scan" in said
    assert "The calibration is 21 days newer than this scan" in said


def test_a_drift_check_sets_the_age_of_the_light_back() -> None:
    rig = with_checks(checked("2026-03-22T09:00:00+00:00", 1.0, 0.002))
    level = light_level(rig, SCANNED)
    assert level is not None
    assert level.rel_std == pytest.approx(0.002)
    assert level.check == rig.light_checks[0]
    assert "light" not in unseen_since(rig, SCANNED)
    # A check of another calibration tells nothing of this one.
    other = with_checks(checked("2026-03-22T09:00:00+00:00", 1.0, calibrated="2026-01-01T10:00:00+00:00"))
    level = light_level(other, SCANNED)
    assert level is not None
    assert level.days == pytest.approx(21)


def test_a_light_that_a_check_found_changed_is_contained_and_told() -> None:
    rig = with_checks(checked("2026-03-22T09:00:00+00:00", 0.95, 0.003))
    assert aged(rig, SCANNED).reference_rel_std == pytest.approx((0.05**2 + 0.003**2) ** 0.5)
    assert "drift check of 2026-03-22 found the light -5.0% ± 0.3% off" in unseen_since(rig, SCANNED)
    one = LightCheck(checked="", calibrated="", levels=(1.01, 1.0, 0.94))
    assert one.largest_change == pytest.approx(-0.06)


def test_the_last_calibration_that_measures_the_light_says_how_bright_it_is() -> None:
    """The bandpass filters replace what the Spectralon found, with the level that their own captures saw."""
    check, again = checked("2026-03-20T10:00:00+00:00", 0.95), "2026-03-21T10:00:00+00:00"
    for spectralon, bandpass in ((THREE_WEEKS, again), (again, THREE_WEEKS)):
        notes = (
            CalibrationNote(name="spectralon", title="Spectralon", accepted=SCANNED, light=spectralon),
            CalibrationNote(name="color-checker", title="Color Checker", accepted=SCANNED, captured=SCANNED),
            CalibrationNote(name="bandpass", title="Bandpass filters", accepted=SCANNED, light=bandpass),
        )
        rig = with_checks(check).model_copy(update={"calibrations": notes})
        said = unseen_since(rig, SCANNED)
        if bandpass == again:
            assert said == ""
        else:
            assert "found the light -5.0% ± 0.0% off" in said
            assert "Calibrate with the Spectralon again, and capture 'Bandpass filters' again" in said


def test_checks_of_long_ago_are_told_with_their_age() -> None:
    rig = with_checks(checked("2026-03-06T10:00:00+00:00", 1.0))
    assert "The light was last checked 16 days before this scan" in unseen_since(rig, SCANNED)


def test_without_a_date_of_the_calibration_checks_tell_of_the_light_by_themselves() -> None:
    first, last = (checked(f"2026-03-{day}T10:00:00+00:00", 0.95, calibrated="") for day in ("10", "14"))
    rig = rig_of("").model_copy(update={"light_checks": (first, last)})
    level = light_level(rig, SCANNED)
    assert level is not None
    assert (level.days, level.check) == (8, last)
    assert light_level(rig_of(""), SCANNED) is None
    # The first says how far off the light is, but not how fast it became so.
    assert wander_per_root_day((first,)) == pytest.approx(PER_ROOT_DAY)
    assert wander_per_root_day((first, last)) == pytest.approx(PER_ROOT_DAY * 0.75**0.5)
    # With a date they are of another calibration.
    dated = rig_of(THREE_WEEKS).model_copy(update={"light_checks": (first, last)})
    level = light_level(dated, SCANNED)
    assert level is not None
    assert level.check is None


def test_a_rig_whose_checks_were_steady_is_trusted_for_longer() -> None:
    steady = tuple(checked(f"2026-03-{day:02d}T10:00:00+00:00", 1.0) for day in (8, 15, 22))
    wanted = PER_ROOT_DAY * (DEFAULT_CHECKS / (DEFAULT_CHECKS + 3)) ** 0.5
    assert wander_per_root_day(steady) == pytest.approx(wanted)
    wild = (checked("2026-03-10T10:00:00+00:00", 1.09), checked("2026-03-05T10:00:00+00:00", 1.06))
    # 6 % in the first four days, 3 % in the next five, in whatever order they are kept.
    squares = 3 * PER_ROOT_DAY**2 + 0.06**2 / 4 + 0.03**2 / 5
    assert wander_per_root_day(wild) == pytest.approx((squares / 5) ** 0.5)


def test_what_checks_get_wrong_themselves_is_not_taken_for_light() -> None:
    unsure = (checked("2026-03-11T10:00:00+00:00", 1.02, 0.02),)
    assert wander_per_root_day(unsure) == pytest.approx(PER_ROOT_DAY * (3 / 4) ** 0.5)
    same_day = (checked("2026-03-01T12:00:00+00:00", 1.02),)
    assert wander_per_root_day(same_day) == pytest.approx(PER_ROOT_DAY)


@pytest.mark.parametrize("created", ["2026-03-22T09:00:00+00:00", "", "spring"])
def test_light_that_nobody_checked_may_be_some_per_cent_off_on_any_day(created: str) -> None:
    """Light 5 % darker within an hour of its calibration is a darker surface to every scan."""
    rig = rig_of(created)
    assert scale_rel_std(rig, SCANNED) == UNCHECKED_REL_STD
    said = scale_in_words(rig, SCANNED, UNCHECKED_REL_STD)
    assert "known to 5.9%" in said
    assert "not checked since the calibration" in said
    assert "run the drift check with the Spectralon" in said
    # What age adds is contained in the deviations; the rest is not, so that these are no wider within a day.
    assert aged(rig, SCANNED).reference_rel_std == rig.reference_rel_std


def test_a_drift_check_of_the_day_makes_the_scale_known() -> None:
    rig = with_checks(checked("2026-03-22T09:00:00+00:00", 1.0, 0.002))
    assert scale_rel_std(rig, SCANNED) == CHECKED_REL_STD
    said = scale_in_words(rig, SCANNED, CHECKED_REL_STD)
    assert "known to 1.0%" in said
    assert said.endswith("(light checked on 2026-03-22).")
    darker = with_checks(checked("2026-03-22T09:00:00+00:00", 0.95, 0.002))
    assert scale_rel_std(darker, SCANNED) == pytest.approx(0.05, abs=0.001)
    # A lamp that was switched off since is not known by a check of days ago.
    assert scale_rel_std(with_checks(checked("2026-03-20T09:00:00+00:00", 1.0)), SCANNED) == UNCHECKED_REL_STD


def test_the_scale_holds_what_all_pixels_have_in_common_and_light_once() -> None:
    """Settings that disagree, a turned camera or a poor white leave it no better known than each of them."""
    fresh, old = rig_of("2026-03-22T09:00:00+00:00"), rig_of(THREE_WEEKS)
    for rig in (fresh, old):
        light, stated = scale_rel_std(rig, SCANNED), aged(rig, SCANNED).reference_rel_std
        alone = Fit(common_rel_std=float(np.hypot(stated, rig.white_scale_rel_std)))
        own = np.hypot(rig.reference_rel_std, rig.white_scale_rel_std)
        assert whole_scale_rel_std(rig, SCANNED, alone) == pytest.approx(np.hypot(light, own))
        apart = Fit(common_rel_std=float(np.hypot(alone.common_rel_std, 0.05)))
        assert whole_scale_rel_std(rig, SCANNED, apart) == pytest.approx(np.linalg.norm([light, own, 0.05]))
    changed = Fit(level_rel_std=0.0335, common_rel_std=0.0)
    assert whole_scale_rel_std(fresh, SCANNED, changed) == 0.0335


def test_the_scale_of_an_old_calibration_is_known_no_better_than_its_light() -> None:
    assert scale_rel_std(rig_of(THREE_WEEKS), SCANNED) == pytest.approx(PER_ROOT_DAY * 20**0.5)
