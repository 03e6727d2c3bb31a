"""Which pictures are captured again to see whether anything moved."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.scene_check import SceneCheck
from dsl_core.model.plan import Shot
from dsl_core.patterns.images import pattern_image
from tests.cases.proof_rules import PLAN, SHOTS, counts, known
from tests.cases.small_rig import small_rig


def test_there_are_no_controls_before_the_code() -> None:
    assert SceneCheck(known()).controls() == ()


def test_the_first_pictures_are_named_once_the_code_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    scan: Any = known()
    check = SceneCheck(scan)
    assert check.first_pictures() == ()
    scan.code = SimpleNamespace(lit=object())
    assert check.first_pictures() == (), "it is not there"
    scan.kept[0] = scan.kept[2] = counts(300)
    assert check.first_pictures() == (SHOTS[0],)
    monkeypatch.setattr("dsl_core.capture.proof.scene_check.MANY_SHOTS", len(SHOTS))
    assert check.first_pictures() == (SHOTS[0], SHOTS[2])
    assert [shot.index for shot in check.code_after(SHOTS[2])] == list(range(3, 12))


@pytest.mark.parametrize(("moved_px", "repeats"), [(0, True), (4, False)])
def test_a_pair_repeats_where_both_of_its_pictures_show_the_same_again(moved_px: int, repeats: bool) -> None:
    check, pair = SceneCheck(known()), SHOTS[4:6]
    shown = {shot: (260 + 1000 * (pattern_image(PLAN, shot)[:, :, 0] > 0)).astype(np.uint16) for shot in pair}
    again = {**shown, pair[1]: np.roll(shown[pair[1]], moved_px, 1)}
    assert check.repeats(pair, shown, again) == repeats
    assert not check.repeats(SHOTS[2:6], shown, again), "the first of them were not captured again"
    assert not check.repeats(pair[:1], shown, again), "half a pair"


def test_a_control_is_mirrored_where_pixels_see_what_their_columns_show_on_the_other_side() -> None:
    scan: Any = known()
    check, column = SceneCheck(scan), np.tile(np.arange(32), 18)
    assert not check.shows_mirrored(SHOTS[2], counts(300).reshape(18, 32)), "no column is known"
    dark, contrast, sigma = (np.full(column.size, each, np.float32) for each in (260, 1000, 5))
    scan.code = SimpleNamespace(lit=Lit(np.arange(column.size), 3 * column, dark, contrast, sigma))
    # Of 32 columns, only the widest stripes are not their own mirror image.
    shown = (260 + 1000 * (pattern_image(PLAN, SHOTS[0])[:, :, 0] > 0)).astype(np.uint16)
    assert check.shows_mirrored(SHOTS[0], shown[:, ::-1])
    assert not check.shows_mirrored(SHOTS[0], shown)
    assert not check.shows_mirrored(SHOTS[2], shown), "this one is its own mirror image"


@pytest.mark.parametrize(
    ("role", "once", "longer", "again", "said"),
    [
        ("white", 900, 1000, 900, "has 0.86 times the light that it has once it is shown for longer"),
        ("white", 900, 900, 900, ""),
        ("white", 900, 1000, 1000, ""),
        ("white", 990, 1000, 990, ""),
        (
            "black",
            307,
            300,
            307,
            "Black, captured after white, holds 1.0% of the light of white, and",
        ),
        ("black", 307, 307, 307, ""),
        ("black", 302, 300, 302, ""),
    ],
    ids=["mixed", "drifted", "flickered", "steady", "lag", "room", "calm"],
)
def test_light_that_depends_on_the_picture_before_is_told_from_a_lamp_that_drifts(
    role: str, once: int, longer: int, again: int, said: str
) -> None:
    scan: Any = known()
    scan.kept = {10: counts(1000), 11: counts(300)}
    check, taken = SceneCheck(scan), list[tuple[str, bool]]()
    own = SHOTS[10 if role == "white" else 11]

    def take(shot: Shot, is_longer: bool) -> np.ndarray:
        taken.append((shot.role, is_longer))
        return counts(longer if is_longer else again).reshape(18, 32)

    check.see_settled(own, counts(once).reshape(18, 32), take)
    assert said in check.unsettled
    assert bool(check.unsettled) is bool(said)
    other = "black" if role == "white" else "white"
    asked = [(role, True), (other, False), (role, False)]
    assert taken == (asked if once in (900, 307) else [])


def test_sentinels_of_a_setting_that_was_too_dark_are_compared_with_no_other_one() -> None:
    scan: Any = known()
    check, taken = SceneCheck(scan), list[Shot]()
    scan.kept = {index: counts(1000 if shot.role == "white" else 300) for index, shot in enumerate(SHOTS)}
    scan.first = 1

    def take(shot: Shot, is_longer: bool) -> np.ndarray:
        taken.append(shot)
        return counts(300).reshape(18, 32)

    check.see_settled(SHOTS[10], counts(900).reshape(18, 32), take)
    assert (check.unsettled, taken) == ("", [])
    assert not check.is_unchanged(SHOTS[2], counts(300).reshape(18, 32))


def test_no_other_sentinel_is_asked_whether_it_settles() -> None:
    scan: Any = known()
    scan.kept = {10: counts(1000), 11: counts(300)}
    check, taken = SceneCheck(scan), list[Shot]()

    def take(shot: Shot, is_longer: bool) -> np.ndarray:
        taken.append(shot)
        return counts(300).reshape(18, 32)

    check.see_settled(SHOTS[13], counts(900).reshape(18, 32), take)
    assert (check.unsettled, taken) == ("", [])


@pytest.mark.parametrize(
    ("first", "longer", "again", "is_mixed"),
    [(320, 300, 320, True), (320, 300, 300, False), (300, 300, 300, False)],
    ids=["mixed", "lamp of the room", "calm"],
)
def test_pictures_that_hold_those_before_them_are_told_by_the_first_black(
    first: int, longer: int, again: int, is_mixed: bool
) -> None:
    scan: Any = known()
    scan.kept = {10: counts(1000), 11: counts(first)}
    check, taken = SceneCheck(scan), list[tuple[str, bool]]()

    def take(shot: Shot, is_longer: bool) -> np.ndarray:
        taken.append((shot.role, is_longer))
        return counts(longer if is_longer else again).reshape(18, 32)

    said = check.see_mixed(take)
    assert said == check.unsettled
    assert said.startswith("Black, captured after white, holds 2.9% of the light of white") is is_mixed
    assert taken == [("black", True), ("white", False), ("black", False)][: 1 if first == 300 else 3]


@pytest.mark.parametrize(
    ("room_dn", "times", "is_off"),
    [(0, 1.0, False), (0, 1.7, True), (90, 1.0, False), (90, 1.7, True)],
    ids=["as calibrated", "other levels", "sun came out", "both"],
)
def test_light_of_the_room_that_changed_is_no_change_of_levels(
    room_dn: int, times: float, is_off: bool
) -> None:
    scan: Any = known()
    rig = small_rig()
    scan.calibration, scan.knows_light, scan.bayer = rig, True, "RGGB"
    response, level = rig.projector_response, scan.plan.settings[scan.first].level
    full, half = (float(response.radiance(x)) - response.black_fraction for x in (level, level / 2))
    black, contrast = 300, 1000
    scan.kept = {10: counts(black + contrast), 11: counts(black)}
    scan.ends = lambda setting: (scan.kept[10], scan.kept[11])
    dim = counts(round(black + room_dn + times * contrast * half / full)).reshape(18, 32)
    now = tuple(counts(each + room_dn).reshape(18, 32) for each in (black + contrast, black))
    check = SceneCheck(scan)
    assert check.compare_whites(dim, (now[0], now[1])) is not is_off
