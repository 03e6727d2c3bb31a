"""By which rules pictures are right or wrong, and what is remembered of them, mostly without any picture."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.capture.proof.contest import Contest
from dsl_core.capture.proof.finding import Finding, Light, Verdict
from dsl_core.capture.proof.prediction import Expected
from dsl_core.capture.proof.raster import Counts
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.model.geometry import Pose
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot, describe_shot
from dsl_core.model.rig import Rig
from dsl_core.simulation.published_rig import published_rig

#: Shots 0 to 9 are the code, 10 white, 11 black, 12 to 15 lines; from 16 on the same at another setting.
PLAN = CapturePlan(
    camera_size_px=(32, 18),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=1.0), Setting(exposure_ms=30.0, level=0.5)),
)
SHOTS = tuple(PLAN.shots())
LINE, LATER_LINE = SHOTS[13], SHOTS[29]
WON, LOST = Contest(100, 0.9, 0.0), Contest(100, -0.9, -90.0)
TORN, DOUBTFUL, FEW = Contest(100, 0.6, -9.0), Contest(100, 0.9, -2.0, -2.0), Contest(11, -1.0, -11.0)


def rig() -> Rig:
    return published_rig()


def proof(is_calibrated: bool = True) -> FrameProof:
    return FrameProof(PLAN, rig() if is_calibrated else None)


def counts(value: int) -> Counts:
    found = np.full(32 * 18, value, np.uint16)
    found.flags.writeable = False
    return found


def nothing() -> Shot | None:
    return None


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
    found = proof()._decide(LINE, contests, share, nothing)
    assert found.verdict is verdict
    assert found.again == (() if verdict in (Verdict.RIGHT, Verdict.UNTOLD) else (LINE,))
    if verdict is Verdict.EXPOSURE and share is not None:
        assert found.detail == f"{share / 0.85:.2g} times what was expected"
    assert not found.is_doubtful


def test_a_few_odd_rows_make_a_picture_doubtful_unless_it_is_wrong() -> None:
    doubtful = {Verdict.LATE: WON, Verdict.OTHER: DOUBTFUL}
    assert proof()._decide(LINE, doubtful, 0.8, nothing) == Finding(
        LINE, Verdict.RIGHT, is_doubtful=True, light=Light.USUAL
    )
    assert not proof()._decide(LINE, doubtful, 0.1, nothing).is_doubtful
    only = proof()._decide(LINE, {Verdict.OTHER: DOUBTFUL}, 0.8, nothing)
    assert only.verdict is Verdict.UNTOLD


@pytest.mark.parametrize(
    ("contests", "verdict"), [({Verdict.LATE: WON}, Verdict.RIGHT), ({}, Verdict.UNTOLD)]
)
def test_a_picture_of_other_light_than_those_before_is_doubtful(
    contests: dict[Verdict, Contest], verdict: Verdict
) -> None:
    judge = proof()
    for _ in range(3):
        assert judge._decide(LINE, contests, 0.8, nothing).light is Light.USUAL
    found = judge._decide(LINE, contests, 1.2, nothing)
    assert (found.verdict, found.light, found.is_doubtful) == (verdict, Light.STEP, True)
    judge.believe_light(LINE)
    assert judge._decide(LINE, contests, 1.2, nothing).light is Light.USUAL


@pytest.mark.parametrize(
    ("shown", "verdict"),
    [(12, Verdict.LATE), (14, Verdict.SWAPPED), (15, Verdict.OTHER), (11, Verdict.OTHER)],
)
def test_the_line_that_is_shown_names_what_went_wrong(shown: int, verdict: Verdict) -> None:
    found = proof()._decide(LINE, {Verdict.OTHER: LOST}, 0.8, lambda: SHOTS[shown])
    assert found == Finding(LINE, verdict, (LINE,), f"that of {describe_shot(SHOTS[shown])}")


def test_without_it_the_rival_that_won_most_does_and_late_before_all_that_are_nearly_as_likely() -> None:
    def named(late: float, other: float, shown: Shot | None = None) -> Verdict:
        lost = {Verdict.LATE: Contest(100, late), Verdict.OTHER: Contest(100, other)}
        found = proof()._named(LINE, lost, shown)
        assert found.again == (LINE,)
        assert found.detail == ""
        return found.verdict

    assert named(-0.7, -0.9) is Verdict.LATE
    assert named(-0.5, -0.9) is Verdict.OTHER
    assert named(-0.5, -0.9, LINE) is Verdict.OTHER, "its own line says nothing"
    assert proof()._named(LINE, {Verdict.DARK: LOST, Verdict.OTHER: WON}, None).verdict is Verdict.DARK


@pytest.mark.parametrize(
    ("lost", "shown", "verdict"),
    [
        (Contest(16, 0.1), LINE, Verdict.UNTOLD),
        (Contest(16, 0.1), SHOTS[14], Verdict.SWAPPED),
        (Contest(16, 0.1), None, Verdict.SWAPPED),
        (Contest(16, -0.5), LINE, Verdict.SWAPPED),
        (Contest(100, 0.1), LINE, Verdict.SWAPPED),
    ],
)
def test_a_line_that_lights_a_few_pixels_at_edges_is_not_another_one(
    lost: Contest, shown: Shot | None, verdict: Verdict
) -> None:
    found = proof()._decide(LINE, {Verdict.SWAPPED: lost, Verdict.LATE: WON}, 0.8, lambda: shown)
    assert found.verdict is verdict
    assert found.is_doubtful == (verdict is Verdict.UNTOLD)


def test_rivals_are_the_shots_before_and_after() -> None:
    judge = proof()
    assert judge._rivals(LINE) == [(Verdict.SWAPPED, SHOTS[14]), (Verdict.LATE, SHOTS[12])]
    assert judge._rivals(SHOTS[0]) == [(Verdict.SWAPPED, SHOTS[1])]
    assert judge._rivals(SHOTS[-1]) == [(Verdict.LATE, SHOTS[-2])]


def test_what_a_wrong_line_was_compared_with_is_taken_again_where_it_was_never_told() -> None:
    judge = proof()
    found = Finding(LATER_LINE, Verdict.LATE, (LATER_LINE,))
    assert judge._with_doubtful(found) is found
    assert judge._with_doubtful(found).again == (LINE, LATER_LINE), "found wrong twice"
    judge = proof()
    judge._untold.add(LINE.index)
    assert judge._with_doubtful(found).again == (LINE, LATER_LINE)
    # The first line may have changed places with the black picture before it.
    judge._untold.add(12)
    first = judge._with_doubtful(Finding(SHOTS[28], Verdict.LATE, (SHOTS[28],)))
    assert first.again == (SHOTS[11], SHOTS[12], SHOTS[28])
    code = Finding(SHOTS[17], Verdict.LATE, (SHOTS[17],))
    judge._untold.add(1)
    assert judge._with_doubtful(code) is code


def told(verdict: Verdict, again: tuple[Shot, ...] = ()) -> Any:
    return lambda shot, seen: Finding(shot, verdict, again)


def test_wrong_pictures_are_forgotten_and_right_ones_told(monkeypatch: pytest.MonkeyPatch) -> None:
    judge = proof()
    judge._neighbours = SimpleNamespace(is_doubtful=lambda *parts: True)  # type: ignore[assignment]
    monkeypatch.setattr(judge, "_judge", told(Verdict.UNTOLD))
    assert judge.judge_raster(LINE, counts(5)).is_doubtful, "unlike its neighbours"
    assert judge.judge_raster(SHOTS[3], counts(6)).is_doubtful is False, "only lines have neighbours"
    assert (set(judge._kept), judge._untold) == ({13, 3}, {13, 3})
    monkeypatch.setattr(judge, "_judge", told(Verdict.RIGHT))
    assert not judge.judge_raster(LINE, counts(7)).is_doubtful, "told is told"
    assert judge._untold == {3}
    monkeypatch.setattr(judge, "_judge", told(Verdict.LATE, (LINE, SHOTS[14])))
    assert judge.judge_raster(SHOTS[14], counts(8)).verdict is Verdict.LATE
    assert set(judge._kept) == {3}
    assert judge.judge_raster(SHOTS[14], counts(8)).verdict is Verdict.REPEATED, "pixel by pixel"
    monkeypatch.setattr(judge, "_judge", told(Verdict.RIGHT))
    assert judge.judge_raster(SHOTS[15], counts(8)).verdict is Verdict.RIGHT, "only what is wrong is repeated"


def test_dark_pixels_are_asked_once_the_black_of_a_later_setting_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    judge, asked = proof(), list[float]()
    judge._kept.update({at: counts(2000 if at == 10 else 100 + at) for at in range(16)})

    def contest(*parts: Any) -> Contest:
        asked.append(0.0 if parts[4] is None else float(parts[4].max()))
        return WON

    monkeypatch.setattr("dsl_core.capture.proof.verifier.contest_of_pictures", contest)
    judge._judge_again(SHOTS[16], counts(120))
    assert min(asked) > 0, "only what is bright can be relied on"
    judge._kept[27] = counts(111)
    asked.clear()
    judge._judge_again(SHOTS[16], counts(120))
    assert set(asked) == {0.0}
    asked.clear()
    judge._judge_again(SHOTS[27], counts(111))
    assert min(asked) > 0, "black cannot vouch for itself"


@pytest.mark.parametrize("wrong", [(True, False), (True, True), (False, True)])
def test_a_picture_judged_with_and_without_gained_black_counts_once(
    monkeypatch: pytest.MonkeyPatch, wrong: tuple[bool, bool]
) -> None:
    judge = proof()
    monkeypatch.setattr(judge._later, "gained", lambda shot: np.float32(3))

    def later(shot: Shot, seen: Counts, less_gained: bool = True) -> Finding:
        light = 0.8 if less_gained else 0.7
        judge._learned.usual.judge(shot, light)
        judge._learned.steps.judge(shot, light, None)
        judge._learned.places.judge(shot, {1: Contest(100, light)})
        is_wrong = wrong[not less_gained]
        if is_wrong:
            judge._learned.contested.add(less_gained)
        return Finding(shot, Verdict.DISPLACED, (shot,) if is_wrong else ())

    monkeypatch.setattr(judge, "_judge_later", later)
    is_first = wrong != (True, False)
    assert judge._judge_again(LATER_LINE, counts(5)).is_wrong == (wrong[0] and wrong[1])
    light = 0.8 if is_first else 0.7
    assert list(judge._learned.usual._known["spectral", 1]) == [light]
    assert list(judge._learned.steps._known["spectral", 1, True]) == [light]
    assert [votes for _, votes, _ in judge._learned.places._votes[1].values()] == [100 * light]
    assert judge._learned.contested == ({True} if wrong[0] and is_first else set())


def test_only_the_brightness_of_lines_is_asked_of_what_they_light(monkeypatch: pytest.MonkeyPatch) -> None:
    judge, wanted = proof(), Expected(np.ones(4, np.float32), np.ones(4, np.float32))
    monkeypatch.setattr(
        "dsl_core.capture.proof.verifier.brightness_of_picture", lambda *parts: float(parts[-1] is not None)
    )
    for shot in (SHOTS[16], SHOTS[26], SHOTS[27], LATER_LINE):
        asked = judge._brightness_again(shot, counts(5), wanted, wanted.counts)
        assert asked == (shot.role == "spectral")


def test_two_patterns_of_the_first_code_never_give_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    judge = proof()
    monkeypatch.setattr(judge, "_judge", told(Verdict.UNTOLD))
    same = counts(8).copy()
    same[0] = 9
    assert judge.judge_raster(SHOTS[2], same).verdict is Verdict.UNTOLD
    assert judge.judge_raster(SHOTS[2], same).verdict is Verdict.UNTOLD, "the same shot, without noise"
    found = judge.judge_raster(SHOTS[3], same)
    assert (found.verdict, found.again) == (Verdict.REPEATED, (SHOTS[3],))
    assert judge.judge_raster(SHOTS[3], same).verdict is Verdict.REPEATED, "and so it stays"
    assert judge.judge_raster(SHOTS[4], counts(8)).verdict is Verdict.UNTOLD
    assert judge.judge_raster(SHOTS[5], counts(8)).verdict is Verdict.UNTOLD, "dark as a picture can be"
    judge.judge_raster(LINE, same)
    assert judge.judge_raster(SHOTS[14], same).verdict is Verdict.UNTOLD, "lines may miss the picture"


def test_controls_are_patterns_of_pairs_that_are_both_there() -> None:
    judge = proof()
    for at in (0, 1, 4, 6, 7, 8, 9):
        judge._kept[at] = counts(100 + at)
    assert set(judge._code_pairs()) == {0, 3, 4}
    assert judge._code_pairs()[3][1] is judge._kept[7]
    assert proof().controls() == ()
    assert judge.first_setting == 0


@pytest.mark.parametrize(("turned", "rises"), [(False, True), (True, False)])
def test_columns_rise_as_the_calibration_says(turned: bool, rises: bool) -> None:
    turned_rig = rig()
    if turned:
        about_the_axis = Pose(rotation=((-1, 0, 0), (0, -1, 0), (0, 0, 1)), translation_mm=(-70, 0, 0))
        turned_rig = turned_rig.model_copy(update={"pose": about_the_axis})
    code = FrameProof(PLAN, turned_rig)._code
    assert code is not None
    assert code._rises is not None
    assert bool(code._rises) is rises
    unknown = proof(is_calibrated=False)._code
    assert unknown is not None
    assert unknown._rises is None


def test_black_that_is_brighter_than_the_lines_is_taken_again_with_the_first_line() -> None:
    judge, rng = proof(), np.random.default_rng(5)

    def dark(lit: int) -> Counts:
        level = np.full(32 * 18, 300.0)
        level[20 * lit : 20 * lit + 20] += 60
        found = np.rint(level + rng.normal(0, 2, level.size)).astype(np.uint16)
        found.flags.writeable = False
        return found

    # White is not there yet, so that no line is judged by its columns.
    judge.judge_raster(SHOTS[11], dark(0))
    found = [judge.judge_raster(SHOTS[12 + at], dark(1 + at)) for at in range(4)]
    assert [each.is_wrong for each in found] == [False, False, False, True]
    assert [shot.index for shot in found[-1].again] == [11, 12]
    assert "black is brighter than the lines after it" in found[-1].sentence


def test_the_first_pictures_are_named_once_the_code_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    judge: Any = proof()
    assert judge.first_pictures() == ()
    judge._code = SimpleNamespace(lit=object())
    assert judge.first_pictures() == (), "it is not there"
    judge._kept[0] = judge._kept[2] = counts(300)
    assert judge.first_pictures() == (SHOTS[0],)
    monkeypatch.setattr("dsl_core.capture.proof.verifier.MANY_SHOTS", len(SHOTS))
    assert judge.first_pictures() == (SHOTS[0], SHOTS[2])
    assert [shot.index for shot in judge.code_after(SHOTS[2])] == list(range(3, 12))


@pytest.mark.parametrize(
    ("indices", "is_fine"),
    [((8, 9), True), ((4, 5), True), ((3, 4), False), ((2, 3), False), ((8, 10), False), ((), False)],
)
def test_the_finest_stripes_are_the_last_three_pairs(indices: tuple[int, ...], is_fine: bool) -> None:
    assert proof().are_finest([SHOTS[index] for index in indices]) == is_fine
