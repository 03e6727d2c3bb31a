"""What was found of a picture is said in a sentence with the shots to take again."""

from __future__ import annotations

import pytest

from dsl_core.capture.proof.finding import Finding, ProofReport, Verdict, displaced, together
from dsl_core.model.plan import Shot, describe_shot

SHOTS = [Shot(k, "code", k, 0, 10.0, 1.0) for k in range(4)]
FIRST, SECOND, _, LAST = (describe_shot(shot) for shot in SHOTS)


@pytest.mark.parametrize(
    ("count", "names"), [(1, FIRST), (2, f"{FIRST} or {SECOND}"), (4, f"{FIRST} to {LAST}")]
)
def test_shots_are_named_by_the_first_and_the_last(count: int, names: str) -> None:
    found = Finding(SHOTS[3], Verdict.TORN, tuple(SHOTS[:count]))
    assert found.names == names
    assert found.is_wrong
    wanted = "does not show its pattern: only a part of it shows that pattern, the rest another one."
    assert found.sentence == f"{names.capitalize()} {wanted}"
    assert "for whole frames" in found.remedy


def test_a_detail_is_added_and_what_is_right_needs_nothing() -> None:
    late = Finding(SHOTS[0], Verdict.LATE, (SHOTS[0],), "like code pattern 3")
    assert late.seen == "it still shows the pattern before (like code pattern 3)"
    right = Finding(SHOTS[0], Verdict.RIGHT)
    assert (right.is_wrong, right.seen, right.remedy, right.is_doubtful) == (False, "", "", False)


def test_a_report_has_a_sentence_for_each_finding() -> None:
    late = Finding(SHOTS[0], Verdict.LATE, (SHOTS[0],))
    assert ProofReport(150, (late,), 26).sentences == (late.sentence,)


def test_displaced_shots_are_named_with_the_number_of_columns() -> None:
    found = displaced(SHOTS[3], (SHOTS[2], SHOTS[3]), -2)
    assert found.verdict is Verdict.DISPLACED
    assert found.detail == "at least 2 columns towards lower columns"
    assert displaced(SHOTS[3], (SHOTS[3],), 1).detail == "at least 1 column towards higher columns"


def test_displaced_shots_that_follow_each_other_are_one_finding() -> None:
    parts = [displaced(shot, (shot,), 1) for shot in SHOTS]
    assert [each.again for each in together(parts)] == [tuple(SHOTS)]
    late = Finding(SHOTS[1], Verdict.LATE, (SHOTS[1],))
    other = displaced(SHOTS[2], (SHOTS[2],), -1)
    apart = [parts[0], late, late, parts[2], other]
    assert together(apart) == tuple(apart)
    later = Shot(4, "code", 0, 1, 10.0, 1.0)
    assert len(together([parts[3], displaced(later, (later,), 1)])) == 2, "of another setting"
