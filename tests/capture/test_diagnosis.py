"""What stops a scan is named by pictures taken again: the room's light, the exposure, a motion."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from dsl_core.capture.diagnosis import Diagnosis, Explanation, References, what_changed
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.runner import Runner
from dsl_core.capture.sentinels import SensorWatch
from dsl_core.errors import DeviceError
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, ScanLines, Shot
from dsl_core.model.rig import Sensor
from tests.cases.changing_rig import Change, changing, from_shot, shifted
from tests.cases.memory_sink import MemorySink
from tests.cases.rendered_rig import RenderedScene, render, token_image

SENSOR = Sensor()


def pictures(
    *,
    light: float = 1.0,
    room_dn: float = 60.0,
    shift_px: int = 0,
    pattern_px: int = 0,
    blur_px: float = 0.7,
) -> References:
    rng = np.random.default_rng(2)
    texture = 1.5 + 4 * gaussian_filter(np.random.default_rng(4).normal(size=(64, 96)), 1.5)
    stripes = gaussian_filter((np.arange(96) // 6 % 2).astype(float), blur_px)

    def picture(pattern: np.ndarray | float) -> np.ndarray:
        lit = 600 * light * np.roll(texture.clip(0.3) * pattern, shift_px, 1)
        return (SENSOR.black_level_dn + room_dn + lit + rng.normal(0, 3, lit.shape)).clip(0).astype(np.uint16)

    return References(picture(1.0), picture(0.0), picture(np.roll(stripes, pattern_px)))


def test_nothing_is_said_of_pictures_that_differ_by_noise() -> None:
    assert what_changed(pictures(), pictures(), SENSOR).sentence == ""
    assert what_changed(pictures(), pictures(light=1.03), SENSOR).sentence == ""


@pytest.mark.parametrize(
    ("later", "said", "not_said"),
    [
        (pictures(light=0.5, room_dn=30), "exposure or gain of the camera is 0.50 times", "room"),
        (pictures(light=1.4), "light of the projector or the exposure is 1.40 times", "room"),
        (pictures(light=0.0), "White and black now look the same: the projector gives no light", "times"),
        (pictures(room_dn=140), "at 140 DN above its black level, and was at 60 DN", "times"),
        (pictures(shift_px=2), r"The camera or the scene moved by (1\.9|2\.\d) ± 0\.\d px, since", "times"),
        (
            pictures(pattern_px=2),
            r"The pattern moved by (1\.9|2\.\d) ± 0\.\d px on the scene, since the scan",
            "room",
        ),
        (pictures(blur_px=1.6), "Stripes of the code are softer than when the scan began", "moved"),
    ],
)
def test_the_cause_is_named(later: References, said: str, not_said: str) -> None:
    found = what_changed(pictures(), later, SENSOR).sentence
    assert re.search(said, found), found
    assert not_said not in found


@pytest.mark.parametrize(
    ("later", "of_all"),
    [
        (pictures(), False),
        (pictures(light=1.4), True),
        (pictures(shift_px=2), False),
        (pictures(light=1.4, shift_px=2), False),
    ],
)
def test_all_of_the_picture_has_changed_where_light_has_and_nothing_moved(
    later: References, of_all: bool
) -> None:
    found = what_changed(pictures(), later, SENSOR)
    assert found.is_of_all is of_all
    if of_all:
        assert not found.has_moved


def test_colours_that_changed_unevenly_are_named_and_are_no_motion() -> None:
    rng, before = np.random.default_rng(1), pictures()
    gain = np.where(np.indices(before.white.shape)[0] % 2, 1.0, 0.6) * np.where(
        rng.random((64, 96)) < 0.5, 1, 0.98
    )
    later = (before.black + gain * (before.white.astype(float) - before.black)).round().astype(np.uint16)
    found = what_changed(before, References(later, before.black, before.code), SENSOR)
    assert re.search(r"0\.59 times .* in red, 0\.79 times in green and 0\.99 times in blue", found.sentence)
    assert "moved" not in found.sentence
    assert not found.is_as_at_first
    assert what_changed(before, before, SENSOR).is_as_at_first


def test_what_came_into_the_projected_picture_is_named() -> None:
    before, later = pictures(), pictures()
    for each in later.pictures:
        each[40:52, 60:84] = 2400
    found = what_changed(before, later, SENSOR)
    assert "black has become as bright as white in columns 60-84, rows 40-52" in found.sentence
    assert not found.is_of_all
    assert what_changed(later, later, SENSOR).sentence == "", "it was there when the scan began"


def test_a_part_of_white_that_gained_light_is_named_and_no_colour_of_it() -> None:
    before, later = pictures(), pictures()
    later.white[32:48:2, 64:80] += 1500
    found = what_changed(before, later, SENSOR).sentence
    assert found.startswith("White has gained light in columns 64-80, rows 32-48 of the picture")
    assert "colours" not in found


@pytest.mark.parametrize("moved_px", [0.5, 1.0])
def test_bright_edges_that_move_into_dark_tiles_are_a_motion(moved_px: float) -> None:
    """Beside a patch that saturates, a part of a tile is left that tells much more light, or less."""

    def seen(light: float, shift_px: float) -> np.ndarray:
        texture = 0.6 + 0.5 * gaussian_filter(np.random.default_rng(4).normal(size=(64, 96)), 1.5).clip(0)
        texture[30:50, :58] = 8.0
        moved = shift(gaussian_filter(texture, 1.0), (0, shift_px), order=1, mode="nearest")
        noise = np.random.default_rng(int(8 * (light + shift_px))).normal(0, 3, moved.shape)
        counts = SENSOR.black_level_dn + 20 + 1200 * light * moved + noise
        return np.rint(counts).clip(0, SENSOR.full_scale_dn).astype(np.uint16)

    before, later = (References(seen(1.0, px), seen(0.0, px), seen(0.5, px)) for px in (0.0, moved_px))
    found = what_changed(before, later, SENSOR)
    assert found.has_moved
    assert re.match(rf"[A-Z][^.]* moved by {moved_px} ± 0.1 px", found.sentence), found.sentence
    assert "came into" not in found.sentence
    assert "exposure" not in found.sentence


def test_a_plan_without_a_code_has_no_references() -> None:
    plan = CapturePlan(code=NoCode(), spectral=ScanLines())
    assert plan.references() == {}

    def never(shot: Shot) -> np.ndarray:
        raise AssertionError

    assert Diagnosis(plan, SensorWatch(plan, SENSOR, 12)).explain(never) == Explanation()


@pytest.mark.parametrize(("bits_lost", "is_low"), [(0, False), (2, True), (4, True)])
def test_a_picture_below_the_black_level_says_that_the_pixel_format_is_another(
    bits_lost: int, is_low: bool
) -> None:
    plan = CapturePlan(code=NoCode(), spectral=ScanLines())
    picture = (pictures().code >> bits_lost).astype(np.uint16)
    found = Diagnosis(plan, SensorWatch(plan, SENSOR, 12)).explain_picture(picture)
    assert ("below the camera's black level of 260 DN" in found.sentence) is is_low
    assert found.is_of_all


@pytest.fixture(scope="module")
def scene() -> RenderedScene:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=5), code_settings=(0,))
    return render(plan, scene="plane", size="64x48")


def later(at: int) -> Callable[[int], int]:
    moved = from_shot(at, 0, 1)
    return lambda shot: int(moved(shot))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (Change(exposure=from_shot(60, 1.0, 0.5)), "times what it was when the scan began"),
        (Change(scene=later(60)), "moved by"),
        (Change(scene=later(9)), "moved by"),
        (Change(exposure=from_shot(9, 1.0, 0.5)), "times what it was when the scan began"),
        (Change(room=from_shot(60, 1.0, 40.0)), "The light of the room has changed"),
    ],
)
def test_a_scan_that_stops_says_why(scene: RenderedScene, change: Change, said: str) -> None:
    rig = changing([scene, shifted(scene, 4)], change, 1)
    proof = FrameProof(scene.plan, scene.calibration)
    with pytest.raises(DeviceError, match=said):
        Runner(rig, scene.plan, MemorySink(scene.plan), token_image, proof=proof).run()


def test_a_scan_of_a_camera_that_is_not_calibrated_says_why(scene: RenderedScene) -> None:
    """Its full scale and black level are not those of the published camera."""
    share = 16.0
    sensor = Sensor(bit_depth=16, black_level_dn=4160.0, electrons_per_dn=0.6, read_noise_dn=share)
    rig = scene.calibration.model_copy(update={"sensor": sensor})
    other = RenderedScene(
        scene.plan, rig, {key: rate * np.float32(share) for key, rate in scene.rates.items()}
    )
    camera = replace(changing([other], Change(exposure=from_shot(60, 1.0, 0.5)), 1), calibration=None)
    proof = FrameProof(scene.plan, None, 16)
    with pytest.raises(DeviceError, match=r"is 0\.50 times what it was when the scan began"):
        Runner(camera, scene.plan, MemorySink(scene.plan), token_image, proof=proof).run()


def test_pictures_without_light_tell_nothing() -> None:
    """A projector that was off when the scan began has no motion."""
    rng = np.random.default_rng(7)
    before, later = (
        References(*(rng.normal(SENSOR.black_level_dn, 3, (64, 96)).round().astype(np.uint16) for _ in "wbc"))
        for _ in "12"
    )
    noisy = SENSOR.model_copy(update={"read_noise_dn": 3.0})
    assert what_changed(before, later, noisy) == Explanation()


def even(white: np.ndarray | float, room_dn: np.ndarray | float) -> References:
    """Pictures without noise or detail of a scene, ``white`` DN above the light of the room."""
    black = np.full((48, 72), SENSOR.black_level_dn + room_dn)
    # Fractions of counts as their share of the pixels.
    spread = np.resize(np.arange(10) / 10, black.shape)
    lit, dark = (np.floor(part + spread).astype(np.uint16) for part in (black + white, black))
    return References(lit, dark, lit)


@pytest.mark.parametrize(
    ("light", "room_dn", "said"),
    [
        (1.04, 20, ""), (1.06, 20, "is 1.06 times what it was"),
        (0.96, 20, ""), (0.94, 20, "is 0.94 times what it was"),
        (1.0, 23.9, ""), (1.0, 24.1, "or the black level of the camera, has changed: without the projector"),
        (1.0, 49, "or the black level"), (1.0, 51, "at 51 DN above its black level, and was at 20 DN"),
        (0.5, 10.8, "exposure or gain of the camera is 0.50"),
        (0.5, 11.2, "light of the projector or the exposure is 0.50"),
        (0.5, 9.2, "exposure or gain of the camera is 0.50"),
        (0.5, 8.8, "light of the projector or the exposure is 0.50"),
    ],
)  # fmt: skip
def test_changes_matter_from_a_share_of_the_light_on(light: float, room_dn: float, said: str) -> None:
    found = what_changed(even(1000.0, 20.0), even(1000.0 * light, room_dn), SENSOR).sentence
    assert (said in found) if said else (found == "")


@pytest.mark.parametrize(("room_dn", "is_told"), [(1.8, False), (2.4, True)])
def test_black_tells_the_exposure_from_two_counts_on(room_dn: float, is_told: bool) -> None:
    found = what_changed(even(1000.0, room_dn), even(500.0, room_dn / 2), SENSOR).sentence
    assert ("exposure or gain" in found) == is_told


@pytest.mark.parametrize(("added", "is_told"), [(21, False), (24, True)])
def test_the_rooms_light_counts_against_the_lit_part_of_the_picture(added: int, is_told: bool) -> None:
    white = np.full((48, 72), 1000.0)
    white[:, 36:58], white[:, 58:] = 300.0, 100.0
    found = what_changed(even(white, 20.0), even(white, 20.0 + added), SENSOR)
    assert ("at 44 DN above its black level" in found.sentence) == is_told
    assert found.is_slight != is_told


def test_a_lamp_of_the_room_is_told_from_a_black_level_by_what_surfaces_reflect() -> None:
    surfaces = np.full((48, 72), 1000.0)
    surfaces[:, 36:] = 300.0
    lamp = even(surfaces, 20.0 + 0.01 * surfaces)
    found = what_changed(even(surfaces, 20.0), lamp, SENSOR)
    assert found.sentence.startswith("The light of the room has changed: without the projector")
    assert found.is_slight
    assert not found.is_as_at_first


def test_saturated_pixels_tell_nothing() -> None:
    white = np.full((48, 72), 1000.0)
    glint = white.copy()
    glint[:, :24] = 0.99 * SENSOR.full_scale_dn - SENSOR.black_level_dn
    assert what_changed(even(glint, 0.0), even(white, 0.0), SENSOR).sentence == ""
    assert what_changed(even(white, 0.0), even(glint, 0.0), SENSOR).sentence == ""


@pytest.mark.parametrize(("lit", "is_told"), [(11, False), (12, True)])
def test_a_dozen_lit_pixels_are_needed(lit: int, is_told: bool) -> None:
    white = np.zeros((48, 72))
    white[0, :lit] = 2000.0
    assert bool(what_changed(even(white, 20.0), even(white * 0.5, 20.0), SENSOR).sentence) == is_told


def shaded(share: float, columns: slice = slice(0, 30)) -> References:
    """Pictures whose white, and black, have this share of their light in some columns."""
    sound = pictures()
    made = []
    for picture in sound.pictures:
        light = picture.astype(float) - SENSOR.black_level_dn
        light[:, columns] *= share
        made.append(np.rint(light + SENSOR.black_level_dn).clip(0).astype(np.uint16))
    return References(*made)


def test_a_part_of_the_picture_that_lost_light_is_no_other_exposure() -> None:
    found = what_changed(pictures(), shaded(0.4), SENSOR)
    assert (
        "White has lost light in columns 0-32, rows 0-64 of the picture, and not elsewhere" in found.sentence
    )
    assert "times" not in found.sentence
    assert not found.is_of_all


def test_all_of_the_picture_that_lost_light_is_in_the_way_of_nobody() -> None:
    found = what_changed(pictures(), shaded(0.4, slice(None)), SENSOR)
    assert "is 0.40 times" in found.sentence
    assert found.is_of_all


def test_light_that_changed_by_place_is_no_other_exposure() -> None:
    before, share = pictures(), np.linspace(0.6, 0.9, 64)[:, None]
    later = (
        (each.astype(float) - before.black) * share + before.black for each in (before.white, before.code)
    )
    white, code = (each.round().astype(np.uint16) for each in later)
    found = what_changed(before, References(white, before.black, code), SENSOR)
    assert "is 0.64 times what it was when the scan began in some parts" in found.sentence
    assert "exposure" not in found.sentence
    assert not found.is_of_all


def test_a_colour_that_failed_is_no_white_balance() -> None:
    before = pictures()
    red = np.tile([[0.1, 1.0], [1.0, 1.0]], (32, 48))
    later = (before.black + red * (before.white.astype(float) - before.black)).round().astype(np.uint16)
    found = what_changed(before, References(later, before.black, before.code), SENSOR)
    assert "Look whether the projector still shines in red" in found.sentence
    assert "white balance" not in found.sentence
    assert found.is_of_all


def test_another_pattern_is_no_scene_as_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    # As for most patterns that are far from their place, where no part of the picture follows them.
    monkeypatch.setattr("dsl_core.capture.diagnosis.moved_between", lambda *pictures, **rest: None)
    before = pictures()
    inverse = before.black + (before.white - before.code)
    found = what_changed(before, References(before.white, before.black, inverse), SENSOR)
    assert "White and black look as they did, and a frame of the code does not" in found.sentence
    assert found.has_moved
    assert not found.is_as_at_first


def test_white_that_is_gone_is_no_coarse_picture() -> None:
    before = pictures()
    dark = np.full_like(before.white, before.black[0, 0])
    assert (
        "White and black now look the same"
        in what_changed(before, References(dark, dark, dark), SENSOR).sentence
    )


@pytest.mark.parametrize(("share", "is_told"), [(0.4, False), (0.6, True)])
def test_black_that_saturates_is_told(share: float, is_told: bool) -> None:
    before = pictures()
    full = np.where(np.arange(96) < 96 * share, int(SENSOR.full_scale_dn), before.black).astype(np.uint16)
    found = what_changed(before, References(np.maximum(before.white, full), full, full), SENSOR).sentence
    assert ("Black saturates in most" in found) == is_told


def test_a_picture_that_ends_below_full_scale_says_so_where_white_does_not(
    scene: RenderedScene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As white of a dimmer setting, which is below the limit."""
    monkeypatch.setattr(Diagnosis, "explain", lambda diagnosis, take: Explanation())
    rig = changing([scene], Change(most_dn=from_shot(9, 65535, 1200)), 1)
    proof = FrameProof(scene.plan, scene.calibration)
    with pytest.raises(DeviceError, match=r"No pixel of it has more than 1200 DN, and .* have just that"):
        Runner(rig, scene.plan, MemorySink(scene.plan), token_image, proof=proof).run()
