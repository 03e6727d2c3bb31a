"""Pictures of a first code that a camera sees column by column: what is located, and what is not."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.code.first_code import FirstCode
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Role, Setting, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels
from dsl_core.patterns.images import pattern_image

PLAN = CapturePlan(
    camera_size_px=(32, 18),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=1.0),),
    code_settings=(0,),
)
SHOTS = [shot for shot in PLAN.shots() if shot.role in ("code", "white", "black")]
RASTER = Raster(PLAN.camera_size_px)
SENSOR = Sensor()


def seen(shot: Shot, light: np.ndarray | float = 2000.0) -> Counts:
    """The camera's column is the projector's."""
    image = pattern_image(PLAN, shot)[..., 1] / 255.0
    return RASTER.take((SENSOR.black_level_dn + light * image).astype(np.uint16))


def judged(light: np.ndarray | float = 2000.0, rises: bool | None = True) -> tuple[FirstCode, list[Verdict]]:
    assert isinstance(PLAN.code, GrayCode)
    code = FirstCode(PLAN, PLAN.code, SHOTS, RASTER, Noise(SENSOR), "RGGB", rises)
    verdicts, before = [], None
    for shot in SHOTS:
        picture = seen(shot, light)
        verdicts.append(code.add(shot, picture, before).verdict)
        before = picture
    return code, verdicts


def test_a_code_whose_columns_run_the_wrong_way_round_is_of_a_mirrored_picture() -> None:
    code, verdicts = judged(rises=False)
    assert verdicts[-1] is Verdict.SWAPPED, "as if the widest pattern had changed places with its inverse"
    again = [code.add(shot, seen(shot), None) for shot in SHOTS[: PLAN.code_count]]
    wrong = [found for found in again if found.is_wrong]
    assert [found.verdict for found in wrong] == [Verdict.MIRRORED]
    assert set(wrong[0].again) == set(SHOTS[: PLAN.code_count])
    assert code.lit is None
    assert set(judged(rises=None)[1]) <= {Verdict.RIGHT, Verdict.UNTOLD}


def test_every_column_is_located_with_its_colour_and_contrast() -> None:
    code, verdicts = judged()
    assert set(verdicts) <= {Verdict.RIGHT, Verdict.UNTOLD}
    assert code.lacking == ()
    assert code.lit is not None
    assert set((code.lit.key // 3).tolist()) == set(range(32)), "the first and the last among them"
    columns = RASTER.take(np.tile(np.arange(32, dtype=np.uint16), (18, 1)))
    colours = RASTER.take(bayer_channels("RGGB", 18, 32).astype(np.uint16))
    assert (code.lit.key // 3).tolist() == columns[code.lit.index].tolist()
    assert (code.lit.key % 3).tolist() == colours[code.lit.index].tolist()
    assert code.lit.contrast == pytest.approx(np.full(code.lit.index.size, 2000.0), abs=1)


@pytest.mark.parametrize("role", ["white", "black"])
def test_nothing_is_located_while_an_end_is_to_be_taken_again(role: Role) -> None:
    code, _ = judged()
    again, other = (
        next(s for s in SHOTS if s.role == r) for r in (role, {"white": "black"}.get(role, "white"))
    )
    assert code.add(again, seen(other), None).is_wrong
    assert code.lit is None
    assert not code.add(again, seen(again), None).is_wrong
    assert code.lit is not None


def test_pixels_in_shadow_and_saturated_ones_are_not_located() -> None:
    light = np.full((18, 32), 2000.0)
    light[:, :5], light[:, 27:] = 3.0, SENSOR.full_scale_dn - SENSOR.black_level_dn
    code, _ = judged(light)
    assert code.lit is not None
    assert set((code.lit.key // 3).tolist()) == set(range(5, 27))


def test_nothing_is_located_of_few_pixels_or_without_all_pictures() -> None:
    light = np.zeros((18, 32))
    light[:, :3] = 2000.0
    assert judged(light)[0].lit is None
    light[:, :8] = 2000.0
    assert judged(light)[0].lit is not None
    assert isinstance(PLAN.code, GrayCode)
    part = FirstCode(PLAN, PLAN.code, SHOTS, RASTER, Noise(SENSOR), "RGGB", True)
    for shot in SHOTS[:-1]:
        part.add(shot, seen(shot), None)
    assert part.lit is None


def first_code(at_the_end: bool = False) -> FirstCode:
    assert isinstance(PLAN.code, GrayCode)
    return FirstCode(PLAN, PLAN.code, SHOTS, RASTER, Noise(SENSOR), "RGGB", True, at_the_end)


def level(share: float) -> Counts:
    """A picture as bright all over as this share of white."""
    found = np.full(RASTER.shape[0] * RASTER.shape[1], SENSOR.black_level_dn + 2000 * share)
    return np.asarray(found, np.uint16)


def end(picture: Counts, role: Role = "white", before: Counts | None = None) -> Finding:
    """What a picture in the place of white or black shows after the whole code."""
    code = first_code()
    for shot in SHOTS[:-2]:
        code.add(shot, seen(shot), None)
    return code.add(SHOTS[-2] if role == "white" else SHOTS[-1], picture, before)


@pytest.mark.parametrize(
    ("share", "verdict"),
    [
        (1.0, Verdict.RIGHT),
        (0.45, Verdict.OTHER),
        (0.28, Verdict.OTHER),
        (0.22, Verdict.DARK),
        (0.0, Verdict.DARK),
    ],
)
def test_white_is_another_picture_or_dark_by_how_near_it_is_to_black(share: float, verdict: Verdict) -> None:
    assert end(level(share)).verdict is verdict


def test_black_is_never_dark() -> None:
    assert end(level(0.0), "black").verdict is Verdict.RIGHT
    assert end(level(1.0), "black").verdict is Verdict.OTHER


def test_an_end_that_is_right_above_some_row_is_torn_and_one_like_the_picture_before_late() -> None:
    torn = level(1.0)
    torn[-120:] = level(0.0)[-120:]
    assert end(torn).verdict is Verdict.TORN
    late = seen(SHOTS[4])
    found = end(late, before=late)
    assert found.verdict is Verdict.LATE
    assert found.again == (SHOTS[-2],)
    assert found.detail == "like code pattern 5"
    assert end(late).verdict is not Verdict.LATE


@pytest.mark.parametrize("index", [0, 1])
def test_a_saturated_picture_of_the_first_pair_is_taken_again_before_others_are_judged_by_it(
    index: int,
) -> None:
    code = first_code()
    full = np.full_like(seen(SHOTS[0]), SENSOR.full_scale_dn)
    told = [code.add(shot, full if shot.index == index else seen(shot), None) for shot in SHOTS[:4]]
    assert [found.is_wrong for found in told] == [False, False, False, True]
    assert told[-1].verdict is Verdict.SATURATED
    assert told[-1].again == (SHOTS[0], SHOTS[1])
    assert not any(code.add(shot, seen(shot), None).is_wrong for shot in (*SHOTS[:2], *SHOTS[4:]))
    assert code.lit is not None


def test_an_overexposed_scene_is_no_single_saturated_picture() -> None:
    _, verdicts = judged(light=40_000.0)
    assert Verdict.SATURATED not in verdicts


def test_pictures_of_a_lamp_that_warms_up_are_taken_again_once_it_has() -> None:
    """Pairs of a fifth and a tenth less light than the last ones; the second time, it is what there is."""
    assert isinstance(PLAN.code, GrayCode)
    code = FirstCode(PLAN, PLAN.code, SHOTS, RASTER, Noise(SENSOR), "RGGB", True)
    dim = dict(zip(SHOTS, (0.8, 0.8, 0.9, 0.9, 0.99, 0.99), strict=False))

    def found(shot: Shot) -> Finding:
        return code.add(shot, seen(shot, 2000.0 * dim.get(shot, 1.0)), None)

    *before, last = [found(shot) for shot in SHOTS]
    assert not any(each.is_wrong for each in before)
    assert last.again == tuple(SHOTS[:6])
    assert last.verdict is Verdict.EXPOSURE
    assert "0.8" in last.detail
    assert code.lit is None
    assert code.settled == pytest.approx(0.8, abs=0.01)
    assert not any(found(shot).is_wrong for shot in SHOTS[:6])
    assert code.lit is not None


def test_light_that_had_not_settled_is_known_from_why_the_first_picture_was_taken_again() -> None:
    """Of a resumed scan, no frame shows it any more."""
    code = first_code(False)
    assert not any(code.add(shot, seen(shot, 2000.0), None).is_wrong for shot in SHOTS)
    why = "its brightness is wrong (0.80 times that of the last ones)"
    code.recall(SHOTS[2], why)
    assert [code.settled] == [1]
    code.recall(SHOTS[0], why)
    assert [code.settled] == [0.8]


@pytest.mark.parametrize(("blue", "settled"), [(0.5, 2.0), (0.1, 1.0), (0.9, 1.0)])
def test_light_that_changed_just_after_the_very_first_picture_is_known(blue: float, settled: float) -> None:
    """Of night mode, no frame shows how it was before; a tenth is a picture that was not there at all."""
    code = first_code()
    night = 2000.0 * np.where(bayer_channels("RGGB", 18, 32) == 2, blue, 1.0)
    told = [code.add(SHOTS[0], seen(SHOTS[0]), None)]
    told += [code.add(shot, seen(shot, night), None) for shot in SHOTS[1:4]]
    assert told[-1].is_wrong == (blue < 0.9)
    assert not any(code.add(shot, seen(shot, night), None).is_wrong for shot in (*told[-1].again, *SHOTS[4:]))
    assert code.settled == pytest.approx(settled, abs=0.01)


@pytest.mark.parametrize("at_the_end", [False, True])
def test_light_that_changed_at_once_in_the_code_is_kept_and_known(at_the_end: bool) -> None:
    code = first_code(at_the_end)
    told = [code.add(shot, seen(shot, 2000.0 * (0.9 if shot.index < 4 else 1.0)), None) for shot in SHOTS]
    assert not any(found.is_wrong for found in told)
    assert code.light == pytest.approx({0: 0.9, 1: 0.9}, abs=0.01)
    assert code.settled == 1


def test_light_that_fails_for_good_between_the_first_two_pairs_is_told_however_often_they_are_taken() -> None:
    for light, verdict in ((0.0, Verdict.DARK), (1000.0, Verdict.EXPOSURE)):
        code = first_code()
        told = [code.add(shot, seen(shot, light if shot.index > 1 else 2000.0), None) for shot in SHOTS[:4]]
        assert set(told[-1].again) == set(SHOTS[:4])
        for _ in range(3):
            again = [code.add(shot, seen(shot, light), None) for shot in SHOTS[:4]]
            assert [found.is_wrong for found in again] == [False, False, False, True]
            assert again[-1].verdict is verdict
            assert set(again[-1].again) == set(SHOTS[:4])
        assert code.lacking[:2] == (0, 1)
        healed = [code.add(shot, seen(shot), None) for shot in SHOTS[:4]]
        assert not any(found.is_wrong for found in healed)


def test_pairs_are_judged_by_those_before_from_the_second_on() -> None:
    code = first_code()
    verdicts = [code.add(shot, seen(shot), None).verdict for shot in SHOTS[:6]]
    assert verdicts == [Verdict.UNTOLD] * 3 + [Verdict.RIGHT] + [Verdict.UNTOLD, Verdict.RIGHT]
    # A pair that breaks the sum; of two nobody knows which is wrong, of three the last is.
    for before, again in ((2, SHOTS[:4]), (4, SHOTS[4:6])):
        code = first_code()
        for shot in SHOTS[:before]:
            code.add(shot, seen(shot), None)
        code.add(SHOTS[before], seen(SHOTS[before]), None)
        found = code.add(SHOTS[before + 1], seen(SHOTS[before]), None)
        assert found.verdict is Verdict.REPEATED
        assert found.again == tuple(again)
        assert before // 2 in code.lacking


def test_a_pattern_and_its_inverse_may_come_in_either_order_and_again() -> None:
    code = first_code()
    code.add(SHOTS[1], seen(SHOTS[1]), None)
    assert 0 in code.lacking
    code.add(SHOTS[0], seen(SHOTS[0]), None)
    assert 0 not in code.lacking
    assert code._pairs.pairs[0][0].tolist() == seen(SHOTS[0]).tolist()
    code.add(SHOTS[0], seen(SHOTS[0]), None)
    assert 0 in code.lacking, "a pair is taken again as a whole"
    code.substitute(0, (seen(SHOTS[0]), seen(SHOTS[1])))
    assert 0 not in code.lacking


@pytest.mark.parametrize(("share", "is_located"), [(0.13, True), (0.11, False)])
def test_a_pixel_is_located_where_all_pairs_differ_by_an_eighth_of_its_contrast(
    share: float, is_located: bool
) -> None:
    code = first_code(at_the_end=True)
    faint = np.flatnonzero(np.tile(np.arange(32) == 7, RASTER.shape[0]))
    for shot in SHOTS:
        picture = seen(shot).astype(float)
        if shot.role == "code" and shot.pattern < 2:
            # Pattern and inverse still add up to white and black.
            middle = SENSOR.black_level_dn + 1000
            picture[faint] = middle + (picture[faint] - middle) * share
        code.add(shot, picture.astype(np.uint16), None)
    assert code.lit is not None
    assert bool(np.isin(faint, code.lit.index).all()) == is_located
    assert bool(np.isin(faint, code.lit.index).any()) == is_located
    assert bool(code._margins()[faint].all()) == is_located


@pytest.mark.parametrize(("more", "enough"), [(6, True), (5, False)])
def test_sixty_pixels_have_to_be_lit(more: int, enough: bool) -> None:
    light = np.zeros((18, 32))
    light[:, :3], light[:more, 3] = 2000.0, 2000.0  # three columns of 18
    assert (judged(light)[0].lit is not None) == enough


def displaced_since(first: int) -> tuple[Finding, list[Finding]]:
    """What the whole of a code of 512 columns shows that is two columns lower from frame ``first`` on.

    And what the frames that are asked for again show in their place.
    """
    sizes = {"camera_size_px": (512, 64), "projector_size_px": (512, 64)}
    plan = PLAN.model_copy(update=sizes)
    assert isinstance(plan.code, GrayCode)
    shots = [shot for shot in plan.shots() if shot.role in ("code", "white", "black")]
    raster = Raster(plan.camera_size_px)
    code = FirstCode(plan, plan.code, shots, raster, Noise(SENSOR), "RGGB", True)

    def shown(shot: Shot, columns: int) -> Finding:
        image = np.roll(pattern_image(plan, shot)[..., 1], columns, 1)
        picture = (SENSOR.black_level_dn + 2000.0 * (image / 255.0)).astype(np.uint16)
        return code.add(shot, raster.take(picture), None)

    found = [shown(shot, -2 * (shot.index >= first)) for shot in shots][-1]
    return found, [shown(shot, 0) for shot in found.again]


@pytest.mark.parametrize("first", [4, 8, 12])
def test_a_code_that_is_displaced_from_some_pair_on_is_taken_again_from_there(first: int) -> None:
    found, again = displaced_since(first)
    assert found.verdict is Verdict.DISPLACED
    assert [shot.pattern for shot in found.again] == list(range(first, 18))
    assert "(at least 2 columns towards lower columns)" in found.sentence
    assert not any(each.is_wrong for each in again)


def test_pairs_that_are_displaced_when_they_are_taken_again_are_told_however_often() -> None:
    code = first_code()
    shots = SHOTS[:4]

    def moved(shot: Shot) -> Counts:
        return RASTER.take(np.roll(seen(shot).reshape(18, 32), 1, 1))

    told = [code.add(shot, moved(shot) if shot.index == 3 else seen(shot), None) for shot in shots]
    assert told[-1].again == tuple(shots)
    for _ in range(2):
        again = [code.add(shot, moved(shot), None) for shot in shots]
        assert [found.is_wrong for found in again] == [False, False, False, True]
        assert again[-1].verdict is Verdict.DISPLACED
        assert again[-1].again == tuple(shots)
    assert not any(code.add(shot, seen(shot), None).is_wrong for shot in shots)


def test_a_code_all_of_which_is_displaced_fits_itself() -> None:
    assert not displaced_since(0)[0].is_wrong


@pytest.mark.parametrize("number", [0, 1, 3])
def test_the_other_half_of_a_forgotten_picture_is_judged_with_the_next_one(number: int) -> None:
    code, _ = judged()
    inverse = next(shot for shot in SHOTS if shot.role == "code" and shot.pattern == 2 * number + 1)
    code.forget(inverse)
    assert code.lit is None
    assert code.add(inverse, seen(inverse), None).verdict is Verdict.RIGHT
    assert code.lit is not None


@pytest.mark.parametrize("exchanged", [None, 5, 6])
@pytest.mark.parametrize("turn", [1, -1])
def test_an_exchanged_pair_is_told_where_pixels_see_several_columns(exchanged: int | None, turn: int) -> None:
    """Pixels at its edges see both sides, and without them no neighbours of a fine pair span one."""
    plan = PLAN.model_copy(update={"camera_size_px": (80, 48), "projector_size_px": (256, 18)})
    shots = [shot for shot in plan.shots() if shot.role in ("code", "white", "black")]
    raster, edges = Raster(plan.camera_size_px), np.linspace(0, 256, 81)
    assert isinstance(plan.code, GrayCode)
    code = FirstCode(plan, plan.code, shots, raster, Noise(SENSOR), "RGGB", None)
    wrong = []
    for shot in shots:
        is_of_pair = shot.role == "code" and shot.pattern // 2 == exchanged
        shown = shots[shot.index + 1 - 2 * (shot.pattern % 2)] if is_of_pair else shot
        row = np.r_[0.0, np.cumsum(pattern_image(plan, shown)[0, :, 1] / 255.0)]
        light = np.diff(np.interp(edges, np.arange(257), row))[::turn] / 3.2
        picture = np.tile(SENSOR.black_level_dn + 2000.0 * light, (48, 1)).astype(np.uint16)
        found = code.add(shot, raster.take(picture), None)
        wrong += [found] if found.is_wrong else []
    names = {each.pattern // 2 for found in wrong for each in found.again}
    assert names == (set() if exchanged is None else {exchanged})
