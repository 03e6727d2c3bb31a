"""What brightness of pictures is usual, and how far one may be from it."""

from __future__ import annotations

import pytest

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.usual_light import UsualLight
from dsl_core.model.plan import Role, Shot


def shot(role: Role = "spectral", setting: int = 0) -> Shot:
    return Shot(13, role, 1, setting, 10.0, 1.0)


LINE, LATER_LINE = shot(), shot(setting=1)


def test_it_is_what_a_film_leaves_then_the_median_of_nine_but_never_more_than_one() -> None:
    usual = UsualLight(0, is_calibrated=True)
    assert (usual.share(LINE), usual.share(LATER_LINE)) == (0.85, 1.0)
    assert not usual.knows(LINE)
    for share in (0.5, 0.7, 0.6):
        assert usual.judge(LINE, share).verdict is Verdict.RIGHT
    assert usual.knows(LINE)
    assert usual.share(LINE) == 0.6
    for share in 9 * [0.9] + 4 * [0.8]:
        usual.judge(LINE, share)
    assert usual.share(LINE) == 0.9, "five of the last nine"
    usual.judge(LINE, 0.8)
    assert usual.share(LINE) == 0.8
    for _ in range(9):
        usual.judge(LINE, 1.1)
    assert usual.share(LINE) == 1.0
    assert usual.share(shot("white")) == 0.85, "of each role and setting by itself"


@pytest.mark.parametrize(
    ("line", "before", "share", "is_right"),
    [
        (LATER_LINE, None, 0.56, True), (LATER_LINE, None, 0.54, False),
        (LATER_LINE, None, 1.79, True), (LATER_LINE, None, 1.81, False),
        (LATER_LINE, 0.6, 0.69 * 0.6, True), (LATER_LINE, 0.6, 0.67 * 0.6, False),
        (LATER_LINE, 0.6, 1.49 * 0.6, True), (LATER_LINE, 0.6, 1.51 * 0.6, False),
        (LINE, None, 0.56 * 0.85, True), (LINE, None, 0.54 * 0.85, False),
        (LINE, None, 2.99 * 0.85, True), (LINE, None, 3.01 * 0.85, False),
        (LINE, 0.6, 2.99 * 0.6, True), (LINE, 0.6, 0.67 * 0.6, False),
    ],
)  # fmt: skip
def test_a_picture_may_differ_from_it_by_so_much(
    line: Shot, before: float | None, share: float, is_right: bool
) -> None:
    usual = UsualLight(0, is_calibrated=True)
    if before is not None:
        usual.judge(line, before)
    known = usual.share(line)
    found = usual.judge(line, share)
    if is_right:
        assert found == Finding(line, Verdict.RIGHT)
    else:
        said = f"{share / known:.2g} times what was expected"
        assert found == Finding(line, Verdict.EXPOSURE, (line,), said)
        assert usual.share(line) == known, "what is wrong is not usual"


def test_without_a_calibration_only_pictures_after_the_first_have_a_wrong_brightness() -> None:
    usual = UsualLight(0, is_calibrated=False)
    assert usual.judge(LATER_LINE, 0.1).verdict is Verdict.RIGHT
    assert usual.judge(LATER_LINE, 0.2).verdict is Verdict.EXPOSURE
    assert usual.judge(LATER_LINE, None).verdict is Verdict.RIGHT


def test_a_first_picture_of_wrong_brightness_leaves_the_next_one_the_first() -> None:
    usual = UsualLight(0, is_calibrated=True)
    assert usual.judge(LATER_LINE, 0.1).is_wrong
    assert not usual.knows(LATER_LINE)


def test_a_picture_by_which_predictions_are_scaled_is_as_bright_as_predicted() -> None:
    usual = UsualLight(0, is_calibrated=True)
    usual.judge(LATER_LINE, 0.6)
    usual.begin(LATER_LINE)
    assert usual.share(LATER_LINE) == 1.0
    usual.judge(LATER_LINE, 0.8)
    assert usual.share(LATER_LINE) == 0.9, "with those after it"
