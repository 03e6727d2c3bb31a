"""What follows from a plan, a calibration and the pictures that are kept."""

from __future__ import annotations

import pytest

from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.judging.known import Known
from dsl_core.model.geometry import Pose
from dsl_core.simulation.published_rig import published_rig
from tests.cases.proof_rules import LINE, PLAN, SHOTS, counts, known


def test_rivals_are_the_shots_before_and_after() -> None:
    assert known().rivals(LINE) == [(Verdict.SWAPPED, SHOTS[14]), (Verdict.LATE, SHOTS[12])]
    assert known().rivals(SHOTS[0]) == [(Verdict.SWAPPED, SHOTS[1])]
    assert known().rivals(SHOTS[-1]) == [(Verdict.LATE, SHOTS[-2])]


def test_pairs_are_those_whose_pictures_are_both_there() -> None:
    scan = known()
    for at in (0, 1, 4, 6, 7, 8, 9):
        scan.kept[at] = counts(100 + at)
    assert set(scan.code_pairs()) == {0, 3, 4}
    assert scan.code_pairs()[3][1] is scan.kept[7]


def test_white_and_black_of_a_setting_are_both_there_or_neither() -> None:
    scan = known()
    scan.kept[26] = counts(200)
    assert scan.ends(1) is None
    scan.kept[27] = counts(100)
    white, black = scan.ends(1) or (None, None)
    assert white is scan.kept[26]
    assert black is scan.kept[27]
    assert scan.black(SHOTS[29]) is black
    assert scan.ends(0) is None
    assert scan.black(LINE) is None


def test_what_is_to_be_taken_again_is_forgotten() -> None:
    scan = known()
    scan.remember(SHOTS[3], counts(5), (), is_told=False)
    scan.remember(LINE, counts(6), (), is_told=False)
    assert (set(scan.kept), scan.untold) == ({3, 13}, {3, 13})
    scan.remember(LINE, counts(7), (), is_told=True)
    assert scan.untold == {3}
    scan.remember(SHOTS[14], counts(8), (LINE, SHOTS[14]), is_told=False)
    assert (set(scan.kept), scan.untold) == ({3}, {3})
    scan.remember(SHOTS[15], counts(9), (SHOTS[3],), is_told=True)
    assert set(scan.kept) == {15}, "another shot is wrong, not this one"


@pytest.mark.parametrize(("turned", "rises"), [(False, True), (True, False)])
def test_columns_rise_as_the_calibration_says(turned: bool, rises: bool) -> None:
    turned_rig = published_rig()
    if turned:
        about_the_axis = Pose(rotation=((-1, 0, 0), (0, -1, 0), (0, 0, 1)), translation_mm=(-70, 0, 0))
        turned_rig = turned_rig.model_copy(update={"pose": about_the_axis})
    code = Known(PLAN, turned_rig, 12, "RGGB", at_the_end=False, knows_light=True).code
    assert code is not None
    assert code._rises is not None
    assert bool(code._rises) is rises
    unknown = Known(PLAN, None, 12, "RGGB", at_the_end=False, knows_light=True).code
    assert unknown is not None
    assert unknown._rises is None
