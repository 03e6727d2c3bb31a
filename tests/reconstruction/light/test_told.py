"""What the light of a scan says to a person, and how unsure it leaves the level of reflectance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan, Setting
from dsl_core.model.rig import ProjectorResponse
from dsl_core.reconstruction.light.sudden import SuddenChanges
from dsl_core.reconstruction.light.told import (
    DRIFT,
    colour_findings,
    light_findings,
    sudden_findings,
    unsure_level,
)
from dsl_core.reconstruction.light.witnesses import ColoursAgain
from tests.cases.scan_light import PLAN, course_of


def test_settings_that_do_not_agree_are_told_with_the_one_that_is_farthest_off() -> None:
    apart = replace(course_of(), settings=(0.05, -0.2))
    told = next(each for each in light_findings(apart, True) if each.part == "response")
    assert told.significant
    assert told.value == pytest.approx(np.expm1(-0.2))
    assert "Setting 2 is 18.1% darker than setting 3" in told.sentence
    assert "made to agree" in told.sentence
    either = next(iter(light_findings(replace(apart, drift=0.3), True)))
    assert either.part == "light"
    assert any(
        "Or the light drifted" in each.sentence for each in light_findings(replace(apart, drift=0.3), True)
    )
    assert all(each.part == "light" for each in light_findings(course_of(), True))


def test_settings_that_do_not_agree_leave_the_level_unsure_as_a_wrong_gamma_does() -> None:
    """Light of levels 0.2 and 0.8 under a gamma of 2.4 instead of 2.2."""
    apart = (0.8 / 0.2) ** -0.2
    course = replace(course_of(), settings=(float(np.log(apart)),))
    two = PLAN.model_copy(update={"settings": CapturePlan().settings})
    # At equal light of both settings, it cannot be a camera that is not proportional to the light.
    alike = tuple(
        setting.model_copy(update={"exposure_ms": 100 / setting.level**2.2}) for setting in two.settings
    )
    two = two.model_copy(update={"settings": alike})
    exact = ProjectorResponse(gamma=2.2)
    unsure = unsure_level(two, exact, light_findings(course, True))
    assert unsure == pytest.approx(1 - 0.8**0.2, rel=0.03)
    assert unsure_level(two, exact, light_findings(course_of(), True)) == 0.0
    once = two.model_copy(update={"settings": (two.settings[1], two.settings[1])})
    assert unsure_level(once, exact, light_findings(course, True)) == 0.0


def test_settings_that_do_not_agree_leave_faint_light_unsure_as_a_camera_with_a_gamma_does() -> None:
    """Values that follow the light to the power 1.03, of exposures of which one is a tenth of the other."""
    level = CapturePlan().settings[1].level
    two = PLAN.model_copy(
        update={
            "settings": (Setting(exposure_ms=20, level=level), Setting(exposure_ms=200, level=level)),
        }
    )
    course = replace(course_of(), settings=(float(np.log(0.1**0.03)),))
    findings = tuple(light_findings(course, True))
    unsure = unsure_level(two, ProjectorResponse(), findings)
    # What is a tenth as bright as white reads so much less, compared with white.
    assert unsure == pytest.approx(-np.log(0.1**0.03), rel=1e-3)


def test_light_that_changed_at_once_is_told_with_the_frame_from_which_on() -> None:
    told, _ = light_findings(replace(course_of(-0.1), step_at=90), True)
    assert told.significant
    assert told.name == DRIFT
    assert told.sentence.startswith("The light has changed by -9.5% (±0.1%) at once, from about frame 91 on.")
    assert "Which light was as calibrated, no scan can tell" in told.sentence


def test_findings_say_what_was_corrected() -> None:
    drift, flicker = light_findings(course_of(-0.1, 0.0), True)
    assert (drift.part, drift.limit, drift.significant) == ("light", 0.006, True)
    assert (drift.value, drift.std) == pytest.approx((np.expm1(-0.1), 0.001 * np.exp(-0.1)))
    assert (flicker.value, flicker.std, flicker.limit, flicker.significant) == (0.0, 0.001, 0.008, False)
    assert "-9.5% (±0.1%)" in drift.sentence
    drift, flicker = light_findings(course_of(0.0, 0.05), False)
    assert not drift.significant
    assert flicker.significant
    assert "5.0% (rms). These patterns do not allow" in flicker.sentence


def test_what_a_change_of_the_light_is_off_by_is_common_to_all_frames() -> None:
    """It may be off, and any light from the first to the last may be that of the calibration."""
    course = replace(course_of(-0.1), drift_std=0.02, step_at=90)
    unsure = unsure_level(PLAN, ProjectorResponse(), light_findings(course, True))
    assert unsure == pytest.approx(np.hypot(0.02 * np.exp(-0.1), np.expm1(-0.1) / np.sqrt(3)))
    assert unsure > np.std(np.linspace(np.expm1(-0.1), 0.0, 1001))
    steady = light_findings(course_of(0.001), True)
    assert unsure_level(PLAN, ProjectorResponse(), steady) == 0.0


def test_a_step_that_is_another_in_its_own_frames_is_as_unsure() -> None:
    sudden = SuddenChanges({}, {40: -0.08}, apart=0.02)
    (told,) = sudden_findings(sudden)
    assert told.sentence.startswith("The light has changed by -7.7% (±2.0%) at once, from frame 41 on.")
    assert "Which light was as calibrated, no scan can tell" in told.sentence
    alike = unsure_level(PLAN, ProjectorResponse(), sudden_findings(replace(sudden, apart=0.0)))
    assert alike == pytest.approx(-np.expm1(-0.08) / np.sqrt(3))
    assert unsure_level(PLAN, ProjectorResponse(), [told]) == pytest.approx(np.hypot(alike, 0.02))


def test_colours_that_change_unlike_are_told_and_make_the_level_unsure() -> None:
    alike, unlike = (
        ColoursAgain((-0.05, -0.051, -0.049), 0.001, 0.0005),
        ColoursAgain((0.0, -0.1, -0.03), 0.06, 0.001),
    )
    assert list(colour_findings([])) == list(colour_findings([alike])) == []
    assert list(colour_findings([replace(unlike, std=0.02)])) == []
    (told,) = colour_findings([alike, unlike])
    assert "white has +0.0% in red, -9.5% in green, -3.0% in blue" in told.sentence
    assert unsure_level(PLAN, ProjectorResponse(), [told]) == pytest.approx(0.06)
