"""Sudden changes of light among pictures that show their pattern."""

import pytest

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Light
from dsl_core.capture.proof.light_steps import LightSteps
from dsl_core.model.plan import Shot


def line(index: int, setting: int = 0) -> Shot:
    return Shot(index, "spectral", index, setting, 100.0, 0.5)


@pytest.mark.parametrize(
    ("share", "light"),
    [(0.79, Light.STEP), (0.81, Light.USUAL), (1.29, Light.USUAL), (1.31, Light.STEP)],
)
def test_a_step_is_a_change_relative_to_the_pictures_before(share: float, light: Light) -> None:
    steps = LightSteps()
    for index, usual in enumerate((2.0, 2.1, 1.9)):
        assert steps.judge(line(index), usual, None) is Light.USUAL
    assert steps.judge(line(3), 2 * share, None) is light


def test_two_pictures_say_nothing_and_other_settings_have_their_own() -> None:
    steps = LightSteps()
    assert [steps.judge(line(i), share, None) for i, share in enumerate((1.0, 3.0))] == [Light.USUAL] * 2
    for index in range(3):
        steps.judge(line(index, 1), 1.0, None)
    assert steps.judge(line(3), 0.2, None) is Light.USUAL
    assert steps.judge(line(3, 1), 0.2, None) is Light.STEP


def test_a_step_is_usual_once_it_is_believed_and_no_part_of_what_is_usual_before() -> None:
    steps = LightSteps()
    for index in range(9):
        steps.judge(line(index), 1.0, None)
    for index in range(9, 19):
        assert steps.judge(line(index), 0.5, None) is Light.STEP
    steps.believe(line(18))
    assert [steps.judge(line(i), 0.5, None) for i in range(3)] == [Light.USUAL] * 3
    assert steps.judge(line(4), 1.0, None) is Light.STEP
    steps.believe(line(30))  # one that was no step
    assert steps.judge(line(5), 1.0, None) is Light.STEP


def test_a_second_picture_next_to_the_limit_is_the_same_step() -> None:
    steps = LightSteps()
    for index in range(3):
        steps.judge(line(index), 1.0, None)
    assert steps.judge(line(3), 0.79, None) is Light.STEP
    assert steps.judge(line(3), 0.82, None) is Light.STEP
    assert steps.judge(line(3), 0.91, None) is Light.USUAL, "the first was wrong"
    assert steps.judge(line(4), 0.82, None) is Light.USUAL


def test_without_a_brightness_votes_tell_a_loss_of_light_and_never_that_all_is_well() -> None:
    steps = LightSteps()
    for index in range(3):
        assert steps.judge(line(index), None, Contest(20, 0.96)) is Light.UNTOLD
    assert steps.judge(line(3), None, Contest(20, 0.78)) is Light.UNTOLD
    assert steps.judge(line(4), None, Contest(20, 0.74)) is Light.STEP
    assert steps.judge(line(5), None, Contest(11, 0.0)) is Light.UNTOLD, "too few votes"
    assert steps.judge(line(6), None, None) is Light.UNTOLD
    assert steps.judge(line(7), 0.1, None) is Light.USUAL, "a brightness is no vote"
