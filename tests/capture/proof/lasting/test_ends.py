"""White and black of a scan tell what was wrong from its first picture on, and nothing of a sound one."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.lasting.black_values import filled_rows, low_black
from dsl_core.capture.proof.lasting.ends import sentences_of_ends
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.plan import Shot
from dsl_core.model.rig import Sensor
from tests.cases.rendered_rig import RenderedScene, token_image

Mosaic = NDArray[np.float64]
#: What white and black become, given both above the black level, DN.
Fault = Callable[[Mosaic, Mosaic], tuple[Mosaic, Mosaic]]


def said(scene: RenderedScene, fault: Fault, with_colours: bool = True) -> list[str]:
    """Of the darkest setting of a scan with this fault."""
    plan, rig = scene.plan, scene.open(3)
    setting = min(range(len(plan.settings)), key=lambda n: plan.settings[n].level)

    def taken(shot: Shot) -> Mosaic:
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(token_image(plan, shot))
        return np.asarray(rig.camera.snap().pixels - scene.calibration.sensor.black_level_dn, np.float64)

    own = {shot.role: shot for shot in plan.shots() if shot.setting == setting}
    sensor, raster = scene.calibration.sensor, Raster(plan.camera_size_px)
    ends = fault(taken(own["white"]), taken(own["black"]))
    counts = [np.clip(np.rint(each + sensor.black_level_dn), 0, sensor.full_scale_dn) for each in ends]
    white, black = (raster.take(each.astype(np.uint16)) for each in counts)
    rest = raster.channels("RGGB"), Noise.of(sensor, 12), raster, with_colours
    return sentences_of_ends(white, black, plan, setting, scene.calibration, *rest)


def of_colour(row: int, column: int, share: float) -> Fault:
    """So much of the light of one place in the cells of the mosaic."""

    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        changed = [each.copy() for each in (white, black)]
        for each in changed:
            each[row::2, column::2] *= share
        return changed[0], changed[1]

    return fault


def rows_of_white(*first: int) -> Fault:
    """Black that has these rows of every four from white."""

    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        mixed = black.copy()
        for row in first:
            mixed[row::4] = white[row::4]
        return white, mixed

    return fault


def pointer(light_dn: float, rows: int = 3) -> Fault:
    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        pointed = [each.copy() for each in (white, black)]
        for each in pointed:
            each[20 : 20 + rows, 30:33] = light_dn
        return pointed[0], pointed[1]

    return fault


def glow(*shares: float) -> Fault:
    """Black that has these shares of white in red, green and blue, besides its own."""

    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        more = white * shares[1]
        more[::2, ::2], more[1::2, 1::2] = white[::2, ::2] * shares[0], white[1::2, 1::2] * shares[2]
        return white + more, black + more

    return fault


def test_a_sound_scan_says_nothing(scene: RenderedScene) -> None:
    assert said(scene, lambda white, black: (white, black)) == []


def test_levels_that_are_limited_show_as_a_grey_black(scene: RenderedScene) -> None:
    (sentence,) = said(scene, glow(0.053, 0.053, 0.053))
    assert "use limited levels (16-235)" in sentence
    assert "has 0.20% of the projector's full light, and 0.05% by its calibration" in sentence


@pytest.mark.parametrize(
    "fault",
    [
        glow(0.04, 0.053, 0.07),
        lambda white, black: (white + 60.0, black + 60.0),
        lambda white, black: (white, black + 0.2 * white * np.linspace(0, 1, white.shape[1])),
        glow(0.01, 0.01, 0.01),
    ],
)
def test_light_of_the_room_and_a_little_more_black_are_no_levels(scene: RenderedScene, fault: Fault) -> None:
    assert said(scene, fault) == []


@pytest.mark.parametrize("light_dn", [1500.0, 1e5])
def test_a_pointer_is_told_with_its_place_whether_it_saturates_or_not(
    scene: RenderedScene, light_dn: float
) -> None:
    (sentence,) = said(scene, pointer(light_dn))
    assert sentence.startswith(
        "Black is as bright as white at 9 pixels in columns 30-33, rows 20-23: something is in the projected"
    )


def test_black_below_the_level_of_the_sensor_is_told(scene: RenderedScene) -> None:
    level_dn = scene.calibration.sensor.black_level_dn

    def quarter(*counts: Mosaic) -> tuple[Mosaic, Mosaic]:
        white, black = ((each + level_dn) / 4 - level_dn for each in counts)
        return white, black

    assert said(scene, quarter)[0].startswith("Black is at 6")
    assert said(scene, lambda white, black: (white - 10.0, black - 10.0)) == [], "a level drifts"


@pytest.mark.parametrize(("rows", "which"), [(np.s_[-2:], "last"), (np.s_[:2], "first")])
def test_rows_that_a_driver_fills_up_are_told(scene: RenderedScene, rows: slice, which: str) -> None:
    def filled(*counts: Mosaic) -> tuple[Mosaic, Mosaic]:
        white, black = (each.copy() for each in counts)
        white[rows] = black[rows] = 0.0
        return white, black

    assert said(scene, filled)[0].startswith(f"The {which} rows of black all have the value 260 DN")


def test_rows_without_any_counts_are_those_of_a_camera_without_an_offset() -> None:
    raster, black = Raster((32, 32)), np.random.default_rng(1).integers(0, 3, (32, 32)).astype(np.uint16)
    black[-4:] = 0
    noise = Noise(Sensor(black_level_dn=0.0))
    assert filled_rows(raster.take(black), noise, raster) == ""
    assert low_black(raster.take(black), noise) == ""


def test_hot_pixels_are_no_pointer(scene: RenderedScene) -> None:
    def hot(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        at = np.random.default_rng(1).random(white.shape) < 0.003
        return np.where(at, 1e5, white), np.where(at, 1e5, black)

    assert said(scene, hot) == []


@pytest.mark.parametrize("rows", [(0, 1), (2, 3), (1, 3), (0, 2)])
def test_rows_that_show_the_picture_before_are_told(scene: RenderedScene, rows: tuple[int, int]) -> None:
    (sentence,) = said(scene, rows_of_white(*rows))
    assert sentence.startswith("In alternate rows of the picture, black is as bright as white")


def test_a_dead_channel_is_told_unless_a_filter_may_explain_it(scene: RenderedScene) -> None:
    (sentence,) = said(scene, of_colour(1, 1, 0.0))
    assert sentence.startswith("White has no blue light anywhere")
    assert said(scene, of_colour(1, 1, 0.0), with_colours=False) == []


def test_an_led_that_is_out_leaves_its_colour_what_others_give_it(scene: RenderedScene) -> None:
    (sentence,) = said(scene, of_colour(0, 0, 0.2))
    assert sentence.startswith("White has hardly any light of the red LED in most of the picture")
    assert said(scene, of_colour(0, 0, 0.35)) == []


@pytest.mark.parametrize(("colours", "is_told"), [(1.0, False), (3.0, True)])
def test_among_many_colours_an_led_is_out_though_others_give_its_colour_more(
    scene: RenderedScene, colours: float, is_told: bool
) -> None:
    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        changed = of_colour(0, 0, 0.33)(white, black)[0]
        patches = np.indices(white.shape).sum(0) // 8 % 2 == 0  # green beside others
        blue = np.where(patches, 1.0, 1 / colours)
        changed[1::2, 1::2] *= blue[1::2, 1::2]
        return changed, black

    assert any("light of the red LED" in sentence for sentence in said(scene, fault)) == is_told


@pytest.mark.parametrize(("rows", "is_told"), [(32, False), (16, True)])
def test_surfaces_that_most_of_the_picture_outshines_tell_of_no_led(
    scene: RenderedScene, rows: int, is_told: bool
) -> None:
    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        changed = of_colour(0, 0, 0.2)(white, black)[0]
        changed[:rows] = 1e5
        return changed, black

    assert any("light of the red LED" in sentence for sentence in said(scene, fault)) == is_told


@pytest.mark.parametrize(("share", "is_told"), [(0.1, True), (0.4, False)])
def test_a_few_surfaces_of_another_colour_are_no_light_of_an_led(
    scene: RenderedScene, share: float, is_told: bool
) -> None:
    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        changed, seen = of_colour(0, 0, 0.2)(white, black)
        rows = round(share * len(white) / 2) * 2
        changed[:rows] = white[:rows]
        return changed, seen

    assert bool(said(scene, fault)) == is_told


@pytest.mark.parametrize(("step_dn", "gain", "word"), [(6.0, 1.08, "higher"), (-6.0, 1.0, "lower")])
def test_halves_of_a_sensor_that_differ_are_told_with_their_column(
    scene: RenderedScene, step_dn: float, gain: float, word: str
) -> None:
    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        right = np.arange(white.shape[1]) >= 32
        changed = [np.where(right, step_dn + gain * each, each) for each in (white, black)]
        return changed[0], changed[1]

    (sentence,) = said(scene, fault)
    told = re.match(r"From column (\d+) of the picture on, black is (\d) DN (\w+), in all rows", sentence)
    assert told is not None
    assert (int(told[1]), told[3]) == (32, word)
    assert int(told[2]) == pytest.approx(6, abs=1)


def test_a_shadow_of_the_room_that_is_slanted_or_soft_or_ends_is_no_step(scene: RenderedScene) -> None:
    def slanted(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        down, across = np.mgrid[: white.shape[0], : white.shape[1]]
        room = 20.0 * (across > 20 + down / 2)
        return white + room, black + room

    def soft(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        room = 20.0 / (1 + np.exp((32 - np.arange(white.shape[1])) / 6))
        return white + room, black + room

    def in_most_rows(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        down, across = np.mgrid[: white.shape[0], : white.shape[1]]
        room = 10.0 * ((across >= 32) & (down > 0.3 * white.shape[0]))
        return white + room, black + room

    assert said(scene, slanted) == []
    assert said(scene, soft) == []
    assert said(scene, in_most_rows) == []


@pytest.mark.parametrize("columns", [slice(10, 20), slice(0, 64)])
def test_parts_of_a_sensor_are_looked_for_where_white_does_not_saturate(
    scene: RenderedScene, columns: slice
) -> None:
    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        step = 6.0 * (np.arange(white.shape[1]) >= 32)
        bright = white + step
        bright[:, columns] = 1e5
        return bright, black + step

    assert any("in all rows" in sentence for sentence in said(scene, fault)) == (columns.stop < 32)


def numbers(row: int, count: int, full_dn: float = 3800.0) -> Fault:
    """Numbers in the first pixels of a row, other ones in each picture."""

    def fault(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        changed = [each.copy() for each in (white, black)]
        for seed, each in enumerate(changed):
            each[row, :count] = np.random.default_rng(seed).integers(0, int(full_dn), count)
        return changed[0], changed[1]

    return fault


def test_numbers_that_a_camera_writes_into_its_first_row_are_no_light(scene: RenderedScene) -> None:
    (sentence,) = said(scene, numbers(0, 20))
    told = re.match(r"The first row of black holds numbers up to column (\d+), which no light", sentence)
    assert told is not None
    assert 18 <= int(told[1]) <= 21


def test_light_at_the_upper_edge_and_a_few_hot_pixels_are_no_numbers(scene: RenderedScene) -> None:
    def lamp(white: Mosaic, black: Mosaic) -> tuple[Mosaic, Mosaic]:
        down, across = np.mgrid[: white.shape[0], : white.shape[1]]
        room = 2000.0 * np.exp(-(down**2) / 2 - ((across - 20) / 12) ** 2)
        return white + room, black + room

    assert not any("numbers" in each for each in said(scene, lamp))
    assert not any("numbers" in each for each in said(scene, numbers(0, 1)))
    assert not any("numbers" in each for each in said(scene, numbers(1, 20)))
