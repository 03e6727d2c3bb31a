"""What is remembered of pictures, and what every picture is asked, mostly without any picture."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.raster import Counts
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.model.plan import Shot
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.published_rig import published_rig
from tests.cases.proof_rules import LINE, PLAN, SHOTS, counts


def proof() -> FrameProof:
    return FrameProof(PLAN, published_rig())


def told(verdict: Verdict, again: tuple[Shot, ...] = ()) -> Any:
    return lambda shot, seen: Finding(shot, verdict, again)


def test_wrong_pictures_are_forgotten_and_right_ones_told(monkeypatch: pytest.MonkeyPatch) -> None:
    judge = proof()
    judge._neighbours = SimpleNamespace(is_doubtful=lambda *parts: True)  # type: ignore[assignment]
    monkeypatch.setattr(judge, "_judge", told(Verdict.UNTOLD))
    assert judge.judge_raster(LINE, counts(5)).is_doubtful, "unlike its neighbours"
    assert judge.judge_raster(SHOTS[3], counts(6)).is_doubtful is False, "only lines have neighbours"
    assert (set(judge._known.kept), judge._known.untold) == ({13, 3}, {13, 3})
    monkeypatch.setattr(judge, "_judge", told(Verdict.RIGHT))
    assert not judge.judge_raster(LINE, counts(7)).is_doubtful, "told is told"
    assert judge._known.untold == {3}
    monkeypatch.setattr(judge, "_judge", told(Verdict.LATE, (LINE, SHOTS[14])))
    assert judge.judge_raster(SHOTS[14], counts(8)).verdict is Verdict.LATE
    assert set(judge._known.kept) == {3}
    assert judge.judge_raster(SHOTS[14], counts(8)).verdict is Verdict.REPEATED, "pixel by pixel"
    monkeypatch.setattr(judge, "_judge", told(Verdict.RIGHT))
    assert judge.judge_raster(SHOTS[15], counts(8)).verdict is Verdict.RIGHT, "only what is wrong is repeated"


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


@pytest.mark.parametrize(
    ("indices", "is_fine"),
    [((8, 9), True), ((4, 5), True), ((3, 4), False), ((2, 3), False), ((8, 10), False), ((), False)],
)
def test_the_finest_stripes_are_the_last_three_pairs(indices: tuple[int, ...], is_fine: bool) -> None:
    assert proof().are_finest([SHOTS[index] for index in indices]) == is_fine


def test_the_first_setting_is_that_of_the_first_code() -> None:
    assert proof().first_setting == 0


#: Light that noise of usual cameras hides from most pixels.
DIM_DN = 25.0


def pictures(light_dn: tuple[float, float]) -> list[Counts]:
    """Every pattern at the camera's own pixels, with so much light at each setting, and noise."""
    rng = np.random.default_rng(0)
    found = []
    for shot in SHOTS:
        shown = pattern_image(PLAN, shot)[:, :, 0] > 0
        light = 300 + light_dn[shot.setting] * shown + rng.normal(0, 3, shown.shape)
        found.append(light.round().astype(np.uint16))
    return found


@pytest.mark.parametrize("light_dn", [(DIM_DN, 1000.0), (300.0, 1000.0)], ids=["dark", "lit"])
def test_the_code_of_the_next_setting_is_judged_by_itself_where_the_first_says_nothing(
    light_dn: tuple[float, float],
) -> None:
    taken = pictures(light_dn)
    clean = FrameProof(PLAN)
    found = [clean.judge(*each) for each in zip(SHOTS, taken, strict=True)]
    assert not any(each.is_wrong for each in found)
    is_dark = light_dn[0] < 100
    assert (clean.first_setting, clean.unproven) == (int(is_dark), "")
    assert all(each.verdict is Verdict.RIGHT for each in found[29:]), "lines of the bright setting"
    torn = FrameProof(PLAN)
    taken[25] = np.vstack([taken[25][:9], taken[24][9:]])
    found = [torn.judge(*each) for each in zip(SHOTS[:26], taken[:26], strict=True)]
    assert found[25].is_wrong


def test_a_scan_whose_code_says_nothing_at_any_setting_is_not_proven() -> None:
    judge, taken = FrameProof(PLAN), pictures((DIM_DN, DIM_DN))
    for shot in SHOTS[:28]:
        assert judge.unproven == "", "a later code may be brighter"
        judge.judge(shot, taken[shot.index])
    assert "neither lost in noise nor saturated" in judge.unproven
