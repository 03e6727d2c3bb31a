"""A line of which one colour alone shows the pattern before is asked again; one of all colours is right."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.judging.first_lines import judge_line
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.prediction import Lit
from dsl_core.model.plan import Columns
from tests.cases.proof_rules import LINE, PLAN, SHOTS, known

WIDE, HIGH, BLACK, CONTRAST = 32, 18, 300.0, 1000.0


def known_columns(monkeypatch: pytest.MonkeyPatch) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Let each column of the camera see that of the projector: channels of its pixels, and their keys."""
    row, column = (each.ravel() for each in np.indices((HIGH, WIDE)))
    channel = np.array([0, 1, 1, 2])[(row + column) % 4]
    key = (3 * column + channel).astype(np.intp)
    flat = [np.full(key.size, value, np.float32) for value in (BLACK, CONTRAST, 5.0)]
    lit = Lit(np.arange(key.size), key, *flat)
    monkeypatch.setattr(Known, "lit", property(lambda self: lit))
    return channel, key


def judged(monkeypatch: pytest.MonkeyPatch, late: int | None) -> Finding:
    """Of a camera each column of which sees that of the projector, where one channel may be late."""
    scan, (channel, key) = known(), known_columns(monkeypatch)
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


@pytest.mark.parametrize("white_for_green", [False, True])
def test_pixels_see_some_of_each_uniform_colour(
    monkeypatch: pytest.MonkeyPatch, white_for_green: bool
) -> None:
    # Of white, red pixels (columns) get little from red (rows), those of all colours some from green.
    of_white = np.array([[0.56, 0.04, 0.02], [0.27, 0.86, 0.24], [0.17, 0.1, 0.74]])
    lights = (*np.eye(3), np.ones(3))
    levels = tuple((tuple(map(float, light)),) * WIDE for light in lights)
    scan = Known(
        PLAN.model_copy(update={"spectral": Columns.model_validate({"levels": levels})}),
        None,
        12,
        "RGGB",
        False,
        True,
    )
    channel, _ = known_columns(monkeypatch)
    lines = [shot for shot in scan.shots if shot.role == "spectral" and shot.setting == 0]
    shown = [lights[i] for i in ((0, 3, 2, 3) if white_for_green else range(4))]
    found = [
        judge_line(scan, shot, np.rint(BLACK + CONTRAST * (light @ of_white)[channel]).astype(np.uint16))
        for shot, light in zip(lines, shown, strict=True)
    ]
    assert [each.is_wrong for each in found] == [False, white_for_green, False, False]
