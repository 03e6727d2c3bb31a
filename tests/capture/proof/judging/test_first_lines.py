"""A line of which one colour alone shows the pattern before is asked again; one of all colours is right."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.judging.first_lines import judge_line
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.prediction import Lit
from tests.cases.proof_rules import LINE, SHOTS, known

WIDE, HIGH, BLACK, CONTRAST = 32, 18, 300.0, 1000.0


def judged(monkeypatch: pytest.MonkeyPatch, late: int | None) -> Finding:
    """Of a camera each column of which sees that of the projector, where one channel may be late."""
    scan = known()
    row, column = (each.ravel() for each in np.indices((HIGH, WIDE)))
    channel = np.array([0, 1, 1, 2])[(row + column) % 4]
    key = (3 * column + channel).astype(np.intp)
    flat = [np.full(key.size, value, np.float32) for value in (BLACK, CONTRAST, 5.0)]
    lit = Lit(np.arange(key.size), key, *flat)
    monkeypatch.setattr(Known, "lit", property(lambda self: lit))
    own, before = (scan.profile(each) for each in (LINE, SHOTS[LINE.index - 1]))
    assert own is not None
    assert before is not None
    share = np.where(channel == late, before[key], own[key])
    return judge_line(scan, LINE, np.rint(BLACK + 0.85 * CONTRAST * share).astype(np.uint16))


def test_a_line_of_all_colours_is_right(monkeypatch: pytest.MonkeyPatch) -> None:
    found = judged(monkeypatch, None)
    assert (found.verdict, found.is_doubtful, found.detail) == (Verdict.RIGHT, False, "")


@pytest.mark.parametrize(("late", "colour"), [(0, "red"), (2, "blue")])
def test_a_colour_of_the_line_before_is_asked_again(
    monkeypatch: pytest.MonkeyPatch, late: int, colour: str
) -> None:
    found = judged(monkeypatch, late)
    assert (found.verdict, found.is_doubtful) == (Verdict.RIGHT, True)
    assert found.detail == f"its {colour} was that of another pattern"
