"""The course of the light from witnesses: a drift is found, chance is not, and flicker is told from both."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dsl_core.reconstruction.light import course as course_module
from dsl_core.reconstruction.light.course import LightCourse, light_course
from dsl_core.reconstruction.light.heard import QUIET, Heard, Witness

SHOTS = 200


def witnesses(drift: float, flicker: float, seed: int = 1) -> list[Witness]:
    """Of 80 lines at two settings relative to white, and of white taken again at the end."""
    rng = np.random.default_rng(seed)
    log = drift * np.arange(SHOTS) / (SHOTS - 1) + flicker * rng.normal(size=SHOTS)
    noise = 0.003 * rng.normal(size=SHOTS)
    white = 0.05
    found = [Witness(110 + k, None, log[110 + k] - white + noise[k], 0.003, k / 40 - 1) for k in range(80)]
    found += [
        Witness(20 + k, 110 + k, log[20 + k] - log[110 + k] + noise[100 + k], 0.003, setting=0)
        for k in range(80)
    ]
    return [*found, Witness(199, 15, log[199] - log[15] + noise[199], 0.001)]


def test_steady_light_is_left_alone() -> None:
    for seed in range(20):
        course = light_course(witnesses(0.0, 0.0, seed), SHOTS)
        assert course is not None
        assert course.is_steady
        assert not course.log.any() or np.abs(course.log).max() < 1e-4


def test_a_drift_is_measured_from_the_first_shot_on() -> None:
    course = light_course(witnesses(-0.1, 0.0), SHOTS)
    assert course is not None
    assert course.drifts
    assert not course.flickers
    truth = -0.1 * np.arange(SHOTS) / (SHOTS - 1)
    assert np.abs(course.log - truth).max() < 0.006
    assert abs(course.drift + 0.1) < 3 * course.drift_std + 0.002


@pytest.mark.parametrize(("drift", "drifts"), [(-0.055, True), (0.003, False)])
def test_two_pictures_taken_again_are_enough(drift: float, drifts: bool) -> None:
    again = [Witness(shot, 15, drift * (shot - 15) / (SHOTS - 1), 0.001) for shot in (104, 199)]
    course = light_course(again, SHOTS)
    assert course is not None
    assert (course.drifts, course.flickers) == (drifts, False)
    if drifts:
        assert np.abs(course.log - drift * np.arange(SHOTS) / (SHOTS - 1)).max() < 0.006
    assert light_course([replace(each, setting=0) for each in again], SHOTS) is None, "settings may differ"


@pytest.mark.parametrize(("change", "drifts"), [(-0.1, True), (0.03, True), (0.02, False), (0.0, False)])
def test_a_single_picture_taken_again_says_how_far_the_light_came_but_not_when(
    change: float, drifts: bool
) -> None:
    course = light_course([Witness(150, 20, change, 0.001)], SHOTS)
    assert (course is not None) == drifts
    if course is None:
        return
    assert (course.drifts, course.flickers, course.drift) == (True, False, change)
    assert not course.log[:21].any()
    assert course.log[150:] == pytest.approx(change)
    # A change at any one shot in between is within two deviations at nearly all others, as a steady one is.
    at = np.arange(SHOTS)
    for since in (30, 85, 140):
        away = np.abs(np.where(at < since, 0.0, change) - course.log)[21:150]
        assert np.mean(away <= 2 * course.std[21:150]) > 0.85
    assert course.std[85] == pytest.approx(abs(change) / 2, rel=0.02)


def test_settings_that_do_not_agree_are_not_taken_for_drift() -> None:
    heard = [
        replace(each, log=each.log + (0.0 if each.setting is None else -0.2)) for each in witnesses(0.0, 0.0)
    ]
    course = light_course(heard, SHOTS)
    assert course is not None
    assert not course.drifts
    assert not course.is_steady
    assert course.settings == pytest.approx((-0.2,), abs=0.002)
    # Three settings, two of which are off, each by its own.
    third = [replace(each, setting=1, log=each.log + 0.3) for each in heard if each.setting == 0]
    course = light_course([*heard, *third], SHOTS)
    assert course is not None
    assert course.settings == pytest.approx((-0.2, 0.1), abs=0.002)


def test_a_drift_that_other_witnesses_see_too_is_not_taken_for_settings() -> None:
    for drift in (0.1, -0.3):
        course = light_course(witnesses(drift, 0.01), SHOTS)
        assert course is not None
        assert course.settings == ()
        assert course.drift == pytest.approx(drift, abs=0.02)
    # Settings alone cannot tell the two apart.
    alone = [each for each in witnesses(-0.3, 0.0) if each.setting is not None]
    course = light_course(alone, SHOTS)
    assert course is not None
    assert course.drifts
    assert course.settings == pytest.approx((0.3 * 90 / 199,), abs=0.01)


def test_flicker_is_not_taken_for_drift() -> None:
    course = light_course(witnesses(0.0, 0.06), SHOTS)
    assert course is not None
    assert course.flickers
    assert not course.drifts
    assert course.flicker == pytest.approx(0.06, rel=0.3)
    assert course.white == pytest.approx(0.05, abs=0.02)


def test_too_few_witnesses_say_nothing() -> None:
    assert light_course(witnesses(0.0, 0.0)[:3], SHOTS) is None


def test_terms_are_those_of_weighted_least_squares_with_what_is_believed_before() -> None:
    heard = [each for each in witnesses(0.08, 0.02, 4) if each.shot % 3]
    heard[5] = replace(heard[5], log=heard[5].log + 0.3)
    flicker = 0.01
    values, covariance, left = course_module._fit(Heard.of(heard), SHOTS, flicker, (0.5, 0.3), 0.01)
    rows, noise = [], []
    for each in heard:
        t, u = each.shot / 199, 0.0 if each.against is None else each.against / 199
        free = each.against is None
        rows.append([t - u, t**2 - u**2, -1.0 if free else 0.0, each.slope, float(each.setting == 0)])
        noise.append(each.std**2 + 0.002**2 + (1 if free else 2) * flicker**2)
    design, sigma = np.array(rows), np.sqrt(noise)
    log = np.array([each.log for each in heard])
    believed = np.diag(1 / np.array([0.5, 0.3, 1.0, 0.02, 0.01]))
    share = np.ones(len(log))
    for _ in range(4):
        root = np.sqrt(share) / sigma
        stacked = np.vstack([design * root[:, None], believed])
        wanted = np.linalg.lstsq(stacked, np.append(log * root, np.zeros(5)), rcond=None)[0]
        off = np.abs(log - design @ wanted) / sigma
        share = np.where(off > 2.5, 2.5 / off, 1.0)
    assert values == pytest.approx(wanted, rel=1e-6, abs=1e-9)
    assert covariance == pytest.approx(np.linalg.inv(stacked.T @ stacked), rel=1e-6, abs=1e-12)
    assert left == pytest.approx(log - design @ wanted, abs=1e-9)


def test_flicker_is_what_the_middle_of_the_squares_leaves_beyond_their_own_noise() -> None:
    heard = [Witness(k, None if k % 2 else 0, 0.0, 0.003) for k in range(7)]
    left = np.array([0.0, 0.01, 0.02, 0.03, -0.04, 0.05, 0.9])
    found, std = course_module._flicker(Heard.of(heard), left)
    many, own = np.array([2, 1, 2, 1, 2, 1, 2]), 0.003**2 + 0.002**2
    assert found == pytest.approx(np.sqrt(np.median((left**2 / chi2.median(1) - own) / many)))
    assert std == pytest.approx(np.median((left**2 + own) / many) * np.sqrt(2 / 7) / found)
    none, chance = course_module._flicker(Heard.of(heard), 0 * left)
    assert none == 0.0
    assert chance == pytest.approx(np.sqrt(np.median(own / many) * np.sqrt(2 / 7) * 2))


@pytest.mark.parametrize(
    ("value", "std", "drifts", "flickers"),
    [(0.0061, 0.0, True, False), (0.0059, 0.0, False, False), (0.0081, 0.0, True, True),
     (0.046, 0.01, True, True), (0.044, 0.01, False, False)],
)  # fmt: skip
def test_changes_count_beyond_chance_and_beyond_what_nobody_minds(
    value: float, std: float, drifts: bool, flickers: bool
) -> None:
    for sign in (1, -1):
        course = LightCourse(np.zeros(1), np.zeros(1), 0.0, 0.0, sign * value, std, value, std)
        assert (course.drifts, course.flickers) == (drifts, flickers)
        assert course.is_steady == (not drifts and not flickers)


def test_the_curve_begins_at_zero_and_its_deviation_is_that_of_its_terms() -> None:
    heard = witnesses(-0.1, 0.0)
    course = course_module._course(Heard.of(heard), SHOTS, (0.5, 0.3))
    values, covariance, _ = course_module._fit(Heard.of(heard), SHOTS, course.flicker, (0.5, 0.3), 0.01)
    time = np.arange(SHOTS) / (SHOTS - 1)
    terms = np.stack([time, time**2])
    assert course.log == pytest.approx(values[:2] @ terms, abs=1e-4)
    assert course.std == pytest.approx(np.sqrt(np.diag(terms.T @ covariance[:2, :2] @ terms)), rel=1e-2)
    assert (course.log[0], course.std[0]) == (0.0, 0.0)
    assert (course.drift, course.drift_std) == (course.log[-1], course.std[-1])
    assert (course.white, course.slope) == pytest.approx((values[2], values[3]), abs=1e-4)


def test_four_witnesses_are_enough_and_a_drift_by_chance_is_told_but_not_followed() -> None:
    heard = [Witness(k, None, 0.0001 * k, 0.01) for k in (0, 50, 100, 199)]
    course = light_course(heard, SHOTS)
    assert course is not None
    assert np.abs(course.log).max() < 1e-5
    assert course.drift == course_module._course(Heard.of(heard), SHOTS, (0.5, 0.3)).drift
    assert abs(course.drift) > 0.001
    # A scan of one shot has no course, and is divided by nothing.
    alone = light_course([Witness(0, None, 0.01, 0.01)] * 4, 1)
    assert alone is not None
    assert alone.log.tolist() == [0.0]


def test_a_witness_far_off_counts_by_its_distance_and_not_by_its_square() -> None:
    std = 0.003
    sigma = float(np.hypot(std, QUIET))
    steady = [Witness(0, 0, away * sigma, std) for away in (1.0, -2.0, 10.0)]  # nothing is fitted to them
    misfit = course_module._misfit(
        Heard.of(steady), SHOTS, 0.0, course_module.DRIFT_STD, course_module.SETTING_STD
    )
    assert misfit == pytest.approx(1 + 4 + 2.5 * (2 * 10 - 2.5))


def test_steps_fitted_together_are_those_fitted_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = Heard.of(stepped(0.05, SHOTS // 2))
    believed = course_module.DRIFT_STD, course_module.SETTING_STD
    places = np.union1d(heard.shot, heard.against[heard.against >= 0])[1:]
    monkeypatch.setattr(course_module, "AT_ONCE", 7)
    together = course_module._misfits(heard, SHOTS, 0.004, *believed, places)
    of_all = course_module._believed(heard, *believed, with_step=True)
    alone = [
        course_module._chi_square(
            heard.design(SHOTS, int(at)), heard.log, course_module._noise(heard, 0.004), of_all
        )
        for at in places
    ]
    assert together.shape == places.shape
    assert together == pytest.approx(np.array(alone), rel=1e-9)
    assert course_module._misfits(heard, SHOTS, 0.004, *believed, places[:0]).shape == (0,)


def stepped(height: float, at: int, seed: int = 1) -> list[Witness]:
    """Steady witnesses but for light that changes at once at a shot."""
    found = []
    for each in witnesses(0.0, 0.0, seed):
        before = 0.0 if each.against is None else height * (each.against >= at)
        found.append(replace(each, log=each.log + height * (each.shot >= at) - before))
    return found


@pytest.mark.parametrize("at", [60, 130])
@pytest.mark.parametrize("height", [-0.08, -0.03, 0.05])
def test_light_that_changes_at_once_is_no_smooth_drift(at: int, height: float) -> None:
    course = light_course(stepped(height, at), SHOTS)
    assert course is not None
    assert course.step_at is not None
    assert abs(course.step_at - at) <= 1
    assert course.drift == pytest.approx(height, abs=0.004)
    truth = height * (np.arange(SHOTS) >= at)
    away = np.abs(course.log - truth)
    assert away[np.abs(np.arange(SHOTS) - at) > 1].max() < 0.004
    assert (away <= 3 * course.std + 0.003).all()


def test_a_drift_and_a_flicker_are_no_step() -> None:
    for seed in range(2):
        for heard in (witnesses(-0.1, 0.0, seed), witnesses(0.0, 0.03, seed), witnesses(0.05, 0.03, seed)):
            course = light_course(heard, SHOTS)
            assert course is not None
            assert course.step_at is None


def test_a_step_may_be_off_by_half_of_what_bright_and_faint_pictures_are_apart() -> None:
    heard = [replace(each, log=-0.05) if each.shot == 199 else each for each in stepped(-0.08, 60)]
    course = light_course(heard, SHOTS)
    assert course is not None
    assert course.drift == pytest.approx(-0.065, abs=0.004)
    assert course.drift_std == pytest.approx(0.015, abs=0.004)
    assert course.std[150] == pytest.approx(0.015, abs=0.004)
    assert course.std[:50].max() < 0.003


def test_codes_in_another_ratio_than_lines_are_no_step_unless_white_is_seen_to_change() -> None:
    """A camera that is not linear shows that: bright codes first, then faint lines from shot 20 on."""
    rng = np.random.default_rng(3)
    codes = [Witness(k, 100 + k, 0.02 + 0.001 * rng.normal(), 0.001, setting=0) for k in range(18)]
    lines = [Witness(k, 100 + k, 0.001 * rng.normal(), 0.005, setting=0) for k in range(20, 99)]
    course = light_course([*codes, *lines], SHOTS, first_lines=(20, 120))
    assert course is None or course.step_at is None
    seen = light_course([*codes, *lines, Witness(199, 15, -0.02, 0.001)], SHOTS, first_lines=(20, 120))
    assert seen is not None
    assert seen.step_at is not None
    assert abs(seen.step_at - 20) <= 2
