"""How votes and brightness become a verdict, without any picture."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.model.geometry import Pose
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot
from dsl_core.simulation.published_rig import published_rig

PLAN = CapturePlan(
    camera_size_px=(24, 16),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=0.4), Setting(exposure_ms=20.0, level=0.8)),
)
SHOTS = list(PLAN.shots())
LINE = next(shot for shot in SHOTS if shot.role == "spectral" and shot.setting == 0 and shot.pattern == 1)
LATER = next(shot for shot in SHOTS if shot.role == "spectral" and shot.setting == 1 and shot.pattern == 1)
WON, LOST, TORN, FEW = Contest(100, 0.9), Contest(100, 0.1), Contest(100, 0.9, -9.0), Contest(11, -1.0)


def proof(is_calibrated: bool = True) -> FrameProof:
    return FrameProof(PLAN, published_rig() if is_calibrated else None)


def decided(
    contests: dict[Verdict, Contest], share: float | None = 0.85, shown: Shot | None = None, shot: Shot = LINE
) -> Finding:
    return proof()._decide(shot, contests, share, lambda: shown)


def test_a_picture_that_wins_is_right_where_the_shot_before_was_among_its_rivals() -> None:
    assert decided({Verdict.LATE: WON, Verdict.DARK: WON}).verdict is Verdict.RIGHT
    assert decided({Verdict.DARK: WON}).verdict is Verdict.UNTOLD
    assert decided({Verdict.LATE: FEW, Verdict.DARK: WON}).verdict is Verdict.UNTOLD
    assert decided({Verdict.LATE: WON, Verdict.DARK: TORN}).verdict is Verdict.TORN


def test_a_lost_picture_is_named_after_its_worst_rival_and_rather_late_than_another() -> None:
    assert decided({Verdict.DARK: LOST, Verdict.OTHER: Contest(100, 0.0)}).verdict is Verdict.OTHER
    late = {Verdict.LATE: Contest(100, -0.2), Verdict.OTHER: Contest(100, -0.49)}
    assert decided(late).verdict is Verdict.LATE
    assert decided({**late, Verdict.OTHER: Contest(100, -0.51)}).verdict is Verdict.OTHER


@pytest.mark.parametrize(("away", "verdict"), [(-1, Verdict.LATE), (1, Verdict.SWAPPED), (2, Verdict.OTHER)])
def test_a_lost_picture_is_named_after_the_line_it_shows(away: int, verdict: Verdict) -> None:
    found = decided({Verdict.DARK: LOST}, None, SHOTS[LINE.index + away])
    assert (found.verdict, found.again) == (verdict, (LINE,))
    assert found.detail.startswith("that of ")
    assert decided({Verdict.DARK: LOST}, None, LINE).verdict is Verdict.DARK


def test_light_too_weak_is_a_matter_of_exposure_and_none_of_darkness() -> None:
    # What is expected of a line is 0.85 of its light.
    assert decided({Verdict.DARK: LOST}, 0.85 * 0.21).verdict is Verdict.EXPOSURE
    assert decided({Verdict.DARK: LOST}, 0.85 * 0.19).verdict is Verdict.DARK
    assert decided({Verdict.DARK: LOST, Verdict.OTHER: LOST}, 0.85).verdict is not Verdict.EXPOSURE
    assert decided({Verdict.DARK: LOST}, 0.85 * 0.21).detail == "0.21 times what was expected"


@pytest.mark.parametrize(
    ("shot", "share", "is_right"),
    [
        (LINE, 0.85 * 0.56, True),
        (LINE, 0.85 * 0.54, False),
        (LINE, 0.85 * 2.9, True),
        (LINE, 0.85 * 3.1, False),
        (LATER, 0.56, True),
        (LATER, 0.54, False),
        (LATER, 1.75, True),
        (LATER, 1.85, False),
    ],
)
def test_first_exposures_are_within_what_a_calibration_says(shot: Shot, share: float, is_right: bool) -> None:
    found = proof()._judge_exposure(shot, share)
    assert (found.verdict is Verdict.RIGHT) == is_right
    assert found.is_wrong != is_right
    assert not proof(False)._judge_exposure(shot, share).is_wrong, "without one nobody knows"


@pytest.mark.parametrize(
    ("share", "is_right"), [(0.69 * 0.8, True), (0.67 * 0.8, False), (1.45 * 0.8, True), (1.55 * 0.8, False)]
)
@pytest.mark.parametrize("is_calibrated", [True, False])
def test_later_exposures_are_within_the_median_of_those_before(
    share: float, is_right: bool, is_calibrated: bool
) -> None:
    judge = proof(is_calibrated)
    for light in (0.5, 0.8, 0.8, 0.8, 0.9):
        judge._light.setdefault(("spectral", 1), deque(maxlen=9)).append(light)
    found = judge._judge_exposure(LATER, share)
    assert (found.verdict is Verdict.RIGHT) == is_right
    assert judge._light["spectral", 1][-1] == (share if is_right else 0.9)


def test_what_is_usual_is_never_more_than_predicted_and_nine_shots_are_remembered() -> None:
    judge = proof()
    assert judge._usual(LINE) == 0.85
    assert judge._usual(LATER) == 1.0
    judge._light["spectral", 1] = deque([1.2, 1.3])
    assert judge._usual(LATER) == 1.0
    for _ in range(20):
        assert judge._judge_exposure(LINE, 0.8).verdict is Verdict.RIGHT
    assert len(judge._light["spectral", 0]) == 9


def test_light_of_a_setting_is_that_of_its_exposure_and_level() -> None:
    assert proof(False)._scale_of(LATER) == pytest.approx(2 * 2**2.2)
    rig = published_rig()
    response = rig.projector_response
    dark = response.radiance(0.0)
    wanted = 2 * (response.radiance(0.8) - dark) / (response.radiance(0.4) - dark)
    assert proof()._scale_of(LATER) == pytest.approx(float(wanted))
    known = proof()
    known._scale[1] = 3.5
    assert known._scale_of(LATER) == 3.5


def test_black_of_a_setting_is_taken_or_follows_the_exposure() -> None:
    judge = proof()
    old = np.array([260, 300, 4000], np.uint16)
    # Above the black level of 260 DN, twice as much.
    assert judge._black(LATER, old).tolist() == [260, 340, 4095]
    assert proof(False)._black(LATER, old).tolist() == [260, 300, 4000]
    taken = np.array([1, 2, 3], np.uint16)
    black = next(shot for shot in SHOTS if shot.role == "black" and shot.setting == 1)
    judge._kept[black.index] = taken
    assert judge._black(LATER, old).tolist() == [1, 2, 3]
    assert judge._black(black, old).tolist() == [260, 340, 4095], "not by itself"


def test_a_wrong_line_that_was_compared_with_a_doubtful_one_has_both_taken_again() -> None:
    judge = proof()
    wrong = Finding(LATER, Verdict.LATE, (LATER,))
    assert judge._with_doubtful(wrong).again == (LATER,)
    assert judge._with_doubtful(wrong).again == (LINE, LATER), "contested twice"
    other = proof()
    other._untold.add(LINE.index)
    assert other._with_doubtful(wrong).again == (LINE, LATER)


def test_rivals_are_the_shots_before_and_after() -> None:
    judge = proof()
    assert judge._rivals(LINE) == [
        (Verdict.SWAPPED, SHOTS[LINE.index + 1]),
        (Verdict.LATE, SHOTS[LINE.index - 1]),
    ]
    assert judge._rivals(SHOTS[0]) == [(Verdict.SWAPPED, SHOTS[1])]
    assert judge._rivals(SHOTS[-1]) == [(Verdict.LATE, SHOTS[-2])]


@pytest.mark.parametrize(("turned", "rises"), [(False, True), (True, False)])
def test_columns_rise_as_the_calibration_says(turned: bool, rises: bool) -> None:
    rig = published_rig()
    if turned:
        about_the_axis = Pose(rotation=((-1, 0, 0), (0, -1, 0), (0, 0, 1)), translation_mm=(-70, 0, 0))
        rig = rig.model_copy(update={"pose": about_the_axis})
    code = FrameProof(PLAN, rig)._code
    assert code is not None
    assert code._rises is not None
    assert bool(code._rises) is rises
    unknown = proof(False)._code
    assert unknown is not None
    assert unknown._rises is None
