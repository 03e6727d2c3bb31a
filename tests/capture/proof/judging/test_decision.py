"""What a picture is found to be follows from its contests and its light, without any picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Finding, Light, Verdict
from dsl_core.capture.proof.judging.decision import decide, in_place, named
from dsl_core.model.plan import Shot, describe_shot
from tests.cases.proof_rules import LINE, LOST, SHOTS, WON, known

TORN, DOUBTFUL, FEW = Contest(100, 0.6, -9.0), Contest(100, 0.9, -2.0, -2.0), Contest(11, -1.0, -11.0)


def decided(
    contests: Mapping[Verdict, Contest], share: float | None, name: Callable[[], Shot | None] = lambda: None
) -> Finding:
    return decide(LINE, contests, share, known().learned, name)


@pytest.mark.parametrize(
    ("contests", "share", "verdict"),
    [
        ({Verdict.LATE: WON}, 0.8, Verdict.RIGHT),
        ({Verdict.LATE: WON}, 0.1, Verdict.EXPOSURE),
        # That it is neither white nor black says nothing; nor do a few pixels.
        ({Verdict.OTHER: WON, Verdict.DARK: WON}, 0.8, Verdict.UNTOLD),
        ({Verdict.LATE: FEW, Verdict.DARK: FEW}, 0.8, Verdict.UNTOLD),
        ({Verdict.OTHER: WON}, 0.1, Verdict.EXPOSURE),
        ({Verdict.LATE: LOST, Verdict.DARK: WON}, 0.8, Verdict.LATE),
        ({Verdict.LATE: WON, Verdict.OTHER: TORN}, 0.8, Verdict.TORN),
        ({Verdict.LATE: LOST, Verdict.OTHER: TORN}, 0.8, Verdict.LATE),
        # Darker than half of what is expected is nearer to black, and yet not without its pattern.
        ({Verdict.DARK: LOST, Verdict.LATE: WON}, 0.21 * 0.85, Verdict.EXPOSURE),
        ({Verdict.DARK: LOST, Verdict.LATE: WON}, 0.19 * 0.85, Verdict.DARK),
        ({Verdict.DARK: LOST}, None, Verdict.DARK),
        ({Verdict.DARK: LOST, Verdict.OTHER: LOST}, 0.4, Verdict.DARK),
    ],
)
def test_what_a_picture_is_follows_from_its_contests(
    contests: dict[Verdict, Contest], share: float | None, verdict: Verdict
) -> None:
    found = decided(contests, share)
    assert found.verdict is verdict
    assert found.again == (() if verdict in (Verdict.RIGHT, Verdict.UNTOLD) else (LINE,))
    if verdict is Verdict.EXPOSURE and share is not None:
        assert found.detail == f"{share / 0.85:.2g} times what was expected"
    assert not found.is_doubtful


def test_a_few_odd_rows_make_a_picture_doubtful_unless_it_is_wrong() -> None:
    doubtful = {Verdict.LATE: WON, Verdict.OTHER: DOUBTFUL}
    rows = "a few rows of it showed another pattern"
    assert decided(doubtful, 0.8) == Finding(
        LINE, Verdict.RIGHT, detail=rows, is_doubtful=True, light=Light.USUAL
    )
    assert not decided(doubtful, 0.1).is_doubtful
    only = decided({Verdict.OTHER: DOUBTFUL}, 0.8)
    assert only.verdict is Verdict.UNTOLD


@pytest.mark.parametrize(
    ("contests", "verdict"), [({Verdict.LATE: WON}, Verdict.RIGHT), ({}, Verdict.UNTOLD)]
)
def test_a_picture_of_other_light_than_those_before_is_doubtful(
    contests: dict[Verdict, Contest], verdict: Verdict
) -> None:
    learned = known().learned
    for _ in range(3):
        assert decide(LINE, contests, 0.8, learned).light is Light.USUAL
    found = decide(LINE, contests, 1.2, learned)
    assert (found.verdict, found.light, found.is_doubtful) == (verdict, Light.STEP, True)
    learned.steps.believe(LINE)
    assert decide(LINE, contests, 1.2, learned).light is Light.USUAL


@pytest.mark.parametrize(
    ("votes", "is_mixed"),
    [
        (Contest(150, 0.24), True),
        (Contest(150, 0.62), True),
        (Contest(150, 0.72), False),
        # Of few pixels, most may be at edges.
        (Contest(35, 0.58), False),
        (Contest(35, 0.4), True),
    ],
)
@pytest.mark.parametrize("rival", [Verdict.LATE, Verdict.SWAPPED])
def test_a_line_that_is_less_itself_than_those_before_is_doubtful(
    rival: Verdict, votes: Contest, is_mixed: bool
) -> None:
    learned = known().learned
    usual = {Verdict.LATE: Contest(150, 0.95), Verdict.SWAPPED: Contest(150, 0.95)}
    for _ in range(3):
        assert not decide(LINE, usual | {rival: votes}, 0.8, known().learned).is_doubtful, "nothing before"
        assert not decide(LINE, usual, 0.8, learned).is_doubtful
    found = decide(LINE, usual | {rival: votes}, 0.8, learned)
    assert (found.verdict, found.is_doubtful) == (Verdict.RIGHT, is_mixed)
    assert found.detail == ("it was mixed with another pattern" if is_mixed else "")
    assert not decide(SHOTS[3], usual | {rival: votes}, 0.8, learned).is_doubtful, "not of the code"


@pytest.mark.parametrize(
    ("shown", "verdict"),
    [(12, Verdict.LATE), (14, Verdict.SWAPPED), (15, Verdict.OTHER), (11, Verdict.OTHER)],
)
def test_the_line_that_is_shown_names_what_went_wrong(shown: int, verdict: Verdict) -> None:
    found = decided({Verdict.OTHER: LOST}, 0.8, lambda: SHOTS[shown])
    assert found == Finding(LINE, verdict, (LINE,), f"that of {describe_shot(SHOTS[shown])}")


def test_without_it_the_rival_that_won_most_does_and_late_before_all_that_are_nearly_as_likely() -> None:
    def verdict(late: float, other: float, shown: Shot | None = None) -> Verdict:
        lost = {Verdict.LATE: Contest(100, late), Verdict.OTHER: Contest(100, other)}
        found = named(LINE, lost, shown)
        assert found.again == (LINE,)
        assert found.detail == ""
        return found.verdict

    assert verdict(-0.7, -0.9) is Verdict.LATE
    assert verdict(-0.5, -0.9) is Verdict.OTHER
    assert verdict(-0.5, -0.9, LINE) is Verdict.OTHER, "its own line says nothing"
    assert named(LINE, {Verdict.DARK: LOST, Verdict.OTHER: WON}, None).verdict is Verdict.DARK


@pytest.mark.parametrize(
    ("lost", "shown", "verdict"),
    [
        (Contest(16, 0.1), LINE, Verdict.UNTOLD),
        (Contest(16, -0.25), SHOTS[LINE.index + 1], Verdict.UNTOLD),
        (Contest(16, -0.5), SHOTS[LINE.index + 1], Verdict.SWAPPED),
        (Contest(16, 0.1), SHOTS[LINE.index + 2], Verdict.OTHER),
        (Contest(16, 0.1), None, Verdict.SWAPPED),
        (Contest(16, -0.5), LINE, Verdict.SWAPPED),
        (Contest(100, 0.1), LINE, Verdict.SWAPPED),
    ],
)
def test_a_line_that_lights_a_few_pixels_at_edges_is_not_another_one(
    lost: Contest, shown: Shot | None, verdict: Verdict
) -> None:
    found = decided({Verdict.SWAPPED: lost, Verdict.LATE: WON}, 0.8, lambda: shown)
    assert found.verdict is verdict
    assert found.is_doubtful == (verdict is Verdict.UNTOLD)


@pytest.mark.parametrize(
    ("place", "is_doubtful"),
    [(Contest(12, -0.51), True), (Contest(11, -0.9), False), (Contest(40, -0.5), False), (WON, False)],
)
def test_a_single_line_that_seems_beside_its_place_is_asked_again(place: Contest, is_doubtful: bool) -> None:
    right = Finding(LINE, Verdict.RIGHT)
    found = in_place(right, {Verdict.LATE: WON}, {1: place, -1: WON}, known().learned)
    assert (found.verdict, found.is_wrong, found.is_doubtful) == (Verdict.RIGHT, False, is_doubtful)
    assert found.detail == ("its line was next to its place" if is_doubtful else "")
