"""Pixels vote for one of two predictions; an end of the picture that votes against shows a tear."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.contest import Contest, vote

WANTED, RIVAL = np.full(400, 900, np.float32), np.full(400, 100, np.float32)


def test_a_picture_as_predicted_wins_and_the_rival_loses() -> None:
    won, lost = vote(WANTED, WANTED, RIVAL), vote(RIVAL, WANTED, RIVAL)
    assert (won.mean, lost.mean) == (1.0, -1.0)
    assert won.is_told
    assert not won.is_lost
    assert not won.is_torn
    assert lost.is_lost


def test_half_way_between_is_no_vote_and_beyond_counts_no_more() -> None:
    assert vote(np.full(400, 500, np.float32), WANTED, RIVAL).mean == 0.0
    assert vote(np.full(400, 4000, np.float32), WANTED, RIVAL).mean == 1.0


def test_a_tear_is_found_at_either_end() -> None:
    for torn in (np.r_[WANTED[:360], RIVAL[360:]], np.r_[RIVAL[:40], WANTED[40:]]):
        found = vote(torn, WANTED, RIVAL)
        assert found.is_torn
        assert not found.is_lost
        assert found.worst_end == -40.0


def test_rows_in_the_middle_against_are_a_doubt_and_no_tear() -> None:
    found = vote(np.r_[WANTED[:200], RIVAL[200:210], WANTED[210:]], WANTED, RIVAL)
    assert (found.worst_end, found.worst_run) == (0.0, -10.0)
    assert found.is_doubtful
    assert not found.is_torn
    assert vote(np.r_[RIVAL[:3], WANTED[3:]], WANTED, RIVAL).worst_run == -3.0
    assert vote(WANTED, WANTED, RIVAL).worst_run == 0.0


def test_scattered_pixels_against_are_no_tear() -> None:
    seen = WANTED.copy()
    seen[::9] = 100
    assert not vote(seen, WANTED, RIVAL).is_torn


def test_few_pixels_tell_nothing() -> None:
    assert not vote(RIVAL[:11], WANTED[:11], RIVAL[:11]).is_told
    assert not vote(RIVAL[:0], WANTED[:0], RIVAL[:0]).is_told
    assert vote(WANTED[:12], WANTED[:12], RIVAL[:12]).is_told


@pytest.mark.parametrize(("mean", "is_lost"), [(0.16, False), (0.14, True), (-1.0, True)])
def test_a_picture_is_lost_below_a_small_majority(mean: float, is_lost: bool) -> None:
    assert Contest(100, mean).is_lost == is_lost
    assert not Contest(11, mean).is_lost


@pytest.mark.parametrize(("count", "limit"), [(100, 8.0), (1000, 20.0)])
def test_a_tear_has_eight_votes_and_a_fiftieth_of_all(count: int, limit: float) -> None:
    assert Contest(count, 0.9, -limit - 0.1).is_torn
    assert not Contest(count, 0.9, -limit + 0.1).is_torn
    assert not Contest(11, 0.9, -limit - 0.1).is_torn


@pytest.mark.parametrize(("count", "limit"), [(100, 1.5), (1000, 5.0)])
def test_few_votes_against_in_a_row_are_a_doubt(count: int, limit: float) -> None:
    assert Contest(count, 0.9, 0.0, -limit - 0.1).is_doubtful
    assert not Contest(count, 0.9, 0.0, -limit + 0.1).is_doubtful
    assert not Contest(11, 0.9, 0.0, -limit - 0.1).is_doubtful
