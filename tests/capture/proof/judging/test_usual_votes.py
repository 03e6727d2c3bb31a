"""Pictures that show their own pattern less clearly than those before, and when that becomes usual."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.judging.usual_votes import UsualVotes
from tests.cases.proof_rules import LATER_LINE, LINE


def after(means: list[float]) -> UsualVotes:
    votes = UsualVotes()
    for mean in means:
        assert not votes.is_unclear(LINE, Verdict.LATE, Contest(400, mean))
    return votes


@pytest.mark.parametrize(("means", "is_told"), [([0.9, 0.9], False), ([0.9, 0.9, 0.9], True)])
def test_a_few_pictures_say_what_is_usual(means: list[float], is_told: bool) -> None:
    assert after(means).is_unclear(LINE, Verdict.LATE, Contest(400, 0.5)) == is_told


def test_each_rival_and_each_setting_has_votes_of_its_own() -> None:
    votes = after([0.9] * 3)
    assert not votes.is_unclear(LINE, Verdict.SWAPPED, Contest(400, 0.5))
    assert not votes.is_unclear(LATER_LINE, Verdict.LATE, Contest(400, 0.5))
    assert not votes.is_unclear(LINE, Verdict.LATE, Contest(11, 0.2)), "these are too few"


def test_what_stays_unclear_when_it_is_taken_again_becomes_usual() -> None:
    votes = after([0.9] * 4)
    doubts = 0
    for index in range(100, 110):
        shot = replace(LINE, index=index)
        if votes.is_unclear(shot, Verdict.LATE, Contest(400, 0.5)):
            doubts += 1
            assert votes.is_unclear(shot, Verdict.LATE, Contest(400, 0.52))
    assert doubts == 4


def test_a_mixture_that_another_picture_cures_does_not() -> None:
    votes = after([0.9] * 4)
    for index in range(100, 110):
        shot = replace(LINE, index=index)
        assert votes.is_unclear(shot, Verdict.LATE, Contest(400, 0.5))
        assert not votes.is_unclear(shot, Verdict.LATE, Contest(400, 0.9))
