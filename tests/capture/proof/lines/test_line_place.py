"""Lines shown a column or two away from their place are found, with the shot since which they are."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.lines.line_place import LEAST_MEAN, LinePlaces, contests_of_sides, moved
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting, Shot
from dsl_core.model.rig import Rig
from dsl_core.patterns.images import pattern_image
from dsl_core.pipeline import fit_plan
from dsl_core.simulation.sim_devices import open_twin

#: Lines that are scanned, and the one from which on they are displaced.
LINES, SINCE = range(40, 72), 56


def line(index: int, setting: int = 0) -> Shot:
    return Shot(index, "spectral", index, setting, 20.0, 1.0)


def told(places: LinePlaces, means: dict[int, float], voters: int = 10) -> tuple[int, list[int]] | None:
    """What is said of lines with these votes for their place against the one above, by index."""
    found = None
    for index, mean in means.items():
        found = places.judge(line(index), {1: Contest(voters, mean), -1: Contest(voters, 0.8)})
    return None if found is None else (found[0], [shot.index for shot in found[1]])


def test_frames_are_asked_together_until_they_are_sure() -> None:
    assert told(LinePlaces(), {0: 0.8, 1: 0.7, 2: -0.8, 3: -0.7}) is None
    assert told(LinePlaces(), {0: 0.8, 1: 0.7, 2: -0.8, 3: -0.7, 4: -0.8}) == (1, [2, 3, 4])


def test_a_single_frame_says_nothing_however_many_pixels_it_has() -> None:
    assert told(LinePlaces(), {0: 0.8, 1: -0.8}, 4000) is None
    assert told(LinePlaces(), {0: 0.8, 1: -0.8, 2: -0.8}, 4000) == (1, [1, 2])


def test_lines_that_are_half_way_are_left_to_the_reconstruction() -> None:
    assert told(LinePlaces(), dict.fromkeys(range(50), -0.2), 4000) is None


def test_lines_are_told_from_a_third_of_the_way_on() -> None:
    voters, frames = 4000, 2
    just = LEAST_MEAN * (1 + 0.5 / (voters * frames))
    assert told(LinePlaces(), dict.fromkeys(range(frames), -just), voters) == (1, [*range(frames)])
    assert told(LinePlaces(), dict.fromkeys(range(frames), -LEAST_MEAN * 0.9999), voters) is None


def test_frames_taken_again_count_as_they_are_now() -> None:
    places = LinePlaces()
    assert told(places, {0: -0.8, 1: -0.8, 2: -0.8}) == (1, [0, 1, 2])
    assert told(places, {0: 0.8, 1: 0.8, 2: 0.8, 3: 0.8, 4: -0.8}) is None


def test_of_several_places_the_one_with_most_votes_is_told() -> None:
    places = LinePlaces()
    for index in range(4):
        found = places.judge(line(index), {1: Contest(10, -0.9), 2: Contest(20, -0.9), -1: Contest(10, 0.9)})
    assert found is not None
    assert found[0] == 2


def test_a_picture_that_is_wrong_needs_no_others_and_counts_for_none() -> None:
    places = LinePlaces()
    assert places.judge(line(3), {1: Contest(40, -0.9)}) is None
    assert places.judge(line(3), {1: Contest(40, -0.9)}, is_wrong=True) == (1, (line(3),))
    assert places.judge(line(4), {1: Contest(10, -0.9)}, is_wrong=True) is None
    assert places.judge(line(5), {1: Contest(15, -0.9)}) is None, "as if it were the first"


def test_a_moved_profile_keeps_its_colours_and_loses_what_leaves_the_picture() -> None:
    profile = np.arange(12, dtype=np.float32)
    assert moved(profile, 1).tolist() == [0, 0, 0, *range(9)]
    assert moved(profile, -1).tolist() == [*range(3, 12), 0, 0, 0]


@cache
def _scan(columns: int, since_setting: int = 0) -> tuple[CapturePlan, Rig, dict[int, NDArray[np.uint16]]]:
    """Code, white, black and some lines of a box at two settings, displaced since a line of one of them."""
    plan = CapturePlan(
        code=GrayCode(rows=False),
        spectral=ScanLines(step_px=5),
        settings=(Setting(exposure_ms=20.0, level=0.4), Setting(exposure_ms=20.0, level=0.8)),
        code_settings=(0,),
    )
    with open_twin({"scene": "box", "size": "64x48"}) as devices:
        plan, pictures = fit_plan(plan, devices), {}
        for shot in plan.shots():
            if shot.role == "spectral" and (shot.pattern not in LINES or shot.setting > since_setting):
                continue
            is_displaced = shot.role == "spectral" and shot.setting == since_setting and shot.pattern >= SINCE
            devices.camera.configure(shot.exposure_ms)
            devices.projector.show(np.roll(pattern_image(plan, shot), columns * is_displaced, 1))
            devices.camera.prepare(shot.index)
            pictures[shot.index] = devices.camera.snap().pixels
        assert devices.calibration is not None
        return plan, devices.calibration, pictures


def _wrong(columns: int, since_setting: int = 0) -> list[Finding]:
    plan, rig, pictures = _scan(columns, since_setting)
    proof = FrameProof(plan, rig)
    found = [proof.judge(s, pictures[s.index]) for s in plan.shots() if s.index in pictures]
    return [each for each in found if each.is_wrong]


@pytest.mark.parametrize("setting", [0, 1])
@pytest.mark.parametrize("columns", [-1, 1])
def test_lines_shown_a_column_away_are_found_within_a_few_frames(columns: int, setting: int) -> None:
    first = _wrong(columns, setting)[0]
    assert first.verdict is Verdict.DISPLACED
    assert abs(first.again[0].pattern - SINCE) <= 1
    assert first.shot.setting == setting
    assert first.shot.pattern < SINCE + 10
    assert f"(at least 1 column towards {'higher' if columns > 0 else 'lower'} columns)" in first.sentence


@pytest.mark.parametrize("setting", [0, 1])
@pytest.mark.parametrize("columns", [-2, 2])
def test_lines_shown_two_columns_away_are_found_at_once(columns: int, setting: int) -> None:
    wrong = _wrong(columns, setting)
    assert wrong[0].shot.pattern < SINCE + 3
    assert Verdict.DISPLACED in {each.verdict for each in wrong}


@pytest.mark.parametrize("setting", [0, 1])
def test_lines_in_their_place_are_right(setting: int) -> None:
    assert _wrong(0, setting) == []


@pytest.mark.parametrize(
    ("near", "asked"),
    [
        (Contest(12, 0.61), [-1, 1]),
        (Contest(11, 0.9), [-1, 1, -2, 2]),
        (Contest(40, 0.6), [-1, 1, -2, 2]),
        (Contest(40, -0.9), [-1, 1, -2, 2]),
    ],
)
def test_two_columns_away_is_asked_unless_one_column_away_is_out_of_the_question(
    near: Contest, asked: list[int]
) -> None:
    sides: list[int] = []

    def contest(side: int) -> Contest:
        sides.append(side)
        return near if abs(side) == 1 else Contest(5, 0.5)

    found = contests_of_sides(contest)
    assert (sides, sorted(found)) == (asked, [-2, -1, 1, 2])
    assert found[2] == (Contest(5, 0.5) if 2 in asked else near)
