"""Exposures of a plan follow the brightness of the scene: measured once, scaled alike, told in a sentence."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.metering import FILL, FILL_IN_DARK, MOST_LONGER, Metered
from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.errors import DeviceError, PlanError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, ScanLines, Setting
from dsl_core.model.rig import ProjectorResponse
from dsl_core.pipeline import meter
from tests.cases.small_rig import small_rig

PERIOD_MS = 10.0
FULL_DN, BLACK_DN = 4095, 260.0
#: Brightness of white in the red, two green and blue pixels of a cell, relative to the brightest.
COLOURS = np.array([[0.5, 1.0], [1.0, 0.8]])


@dataclass
class Bench(Camera, Projector):
    """Both devices: white at full drive adds ``dn_per_ms`` to the brightest colour; a share is brighter."""

    dn_per_ms: float
    range_ms: tuple[float, float] = (1.0, 2000.0)
    highlights: float = 0.0
    exposures_ms: list[float] = field(default_factory=list)
    shown: list[int] = field(default_factory=list)
    frames: int = 0
    colours: NDArray[np.float64] = field(default_factory=COLOURS.copy)
    #: What the projector makes of levels 0..1, and the light of the room relative to the brightest white.
    curve: Callable[[float], float] = lambda level: level
    room: float = 0.0
    #: How many pixels of the first row hold numbers.
    numbers: int = 0
    #: Where values end.
    ends_dn: int = FULL_DN

    @property
    def info(self) -> CameraInfo:  # type: ignore[override]
        return CameraInfo("bench", "1", 40, 20, "RGGB", 12, self.range_ms)

    def configure(self, exposure_ms: float) -> float:
        if not self.range_ms[0] <= exposure_ms <= self.range_ms[1]:
            raise DeviceError(f"cannot expose for {exposure_ms} ms")
        self.exposures_ms.append(exposure_ms)
        return exposure_ms

    def show(self, image: NDArray[np.uint8]) -> None:
        self.shown.append(int(image.max()))

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        light = (self.curve(self.shown[-1] / 255) ** 2.2 + self.room) * self.exposures_ms[-1] * self.dn_per_ms
        signal = light * np.tile(self.colours, (10, 20))
        signal[:, : round(40 * self.highlights)] *= 50
        pixels = np.clip(signal + BLACK_DN, 0, self.ends_dn).astype(np.uint16)
        self.frames += 1
        written = np.random.default_rng(self.frames).integers(0, FULL_DN + 1, self.numbers)
        pixels[0, : self.numbers] = written
        return Frame(pixels, self.exposures_ms[-1], 0.1 * self.frames, self.frames)


class Screen(Projector):
    def __init__(self, bench: Bench) -> None:
        self.bench = bench

    @property
    def info(self) -> ProjectorInfo:
        return ProjectorInfo("bench", "1", 32, 8, 0.0, PERIOD_MS)

    def show(self, image: NDArray[np.uint8]) -> None:
        self.bench.show(image)


def rig_of(bench: Bench, nominal_bits: int = 12, nominal_dn: float = BLACK_DN) -> DeviceRig:
    update = {"black_level_dn": nominal_dn, "bit_depth": nominal_bits}
    sensor = small_rig().sensor.model_copy(update=update)
    nominal = small_rig().model_copy(update={"sensor": sensor, "frame_period_ms": PERIOD_MS})
    return DeviceRig("bench", bench, Screen(bench), nominal=nominal, sleep=lambda seconds: None)


def plan_of(*settings: tuple[float, float]) -> CapturePlan:
    return CapturePlan(
        camera_size_px=(40, 20),
        projector_size_px=(32, 8),
        code=GrayCode(rows=False),
        spectral=ScanLines(step_px=5),
        settings=tuple(Setting(exposure_ms=ms, level=level) for ms, level in settings),
        code_settings=tuple(range(len(settings))),
    )


def exposures(found: Metered) -> list[float]:
    return [setting.exposure_ms for setting in found.plan.settings]


def light_for(share: float, exposure_ms: float, level: float = 1.0) -> float:
    """DN a millisecond of a scene whose white reaches this share in its dimmest colour."""
    return float(share * (FULL_DN - BLACK_DN) / (COLOURS.min() * exposure_ms * level**2.2))


def test_white_that_saturates_in_every_colour_shortens_all_exposures_alike() -> None:
    bench = Bench(light_for(2.4, 200.0))
    found = meter(rig_of(bench), plan_of((200.0, 1.0), (400.0, 1.0)))
    assert exposures(found) == [90.0, 180.0], f"{FILL} of full scale, in whole cycles"
    assert "reaches 240% of full scale" in found.sentence
    assert "shortened from 200 and 400 to 90 and 180 ms." in found.sentence
    assert found.is_told
    assert found.notes == {"exposures": found.sentence}
    assert bench.exposures_ms == [200.0, 20.0], "one frame, and one more as that one was saturated"
    assert bench.shown[-1] == 0, "the projector is dark afterwards"


def test_the_black_level_of_another_bit_depth_is_not_believed() -> None:
    plan = plan_of((200.0, 1.0))
    found = meter(rig_of(Bench(light_for(0.9, 200.0)), 16, 16 * BLACK_DN), plan)
    assert found.plan == plan
    assert not found.is_told


def test_one_colour_without_noise_just_below_full_scale_is_no_end() -> None:
    brightest = (0.95 * FULL_DN - BLACK_DN) / (FULL_DN - BLACK_DN)
    found = meter(rig_of(Bench(light_for(COLOURS.min() * brightest, 200.0))), plan_of((200.0, 1.0)))
    assert f"reaches {COLOURS.min() * brightest:.0%} of full scale" in found.sentence


@pytest.mark.parametrize("ends_dn", [4094, 4080])
def test_white_that_ends_below_full_scale_is_saturated_there(ends_dn: int) -> None:
    bench = Bench(light_for(2.4, 200.0), ends_dn=ends_dn)
    assert exposures(meter(rig_of(bench), plan_of((200.0, 1.0), (400.0, 1.0)))) == [90.0, 180.0]


@pytest.mark.parametrize("share", [0.25, 1.2])
def test_white_that_fits_keeps_the_plan_and_is_not_told(share: float) -> None:
    plan = plan_of((200.0, 1.0))
    found = meter(rig_of(Bench(light_for(share, 200.0))), plan)
    assert found.plan == plan
    assert not found.is_told
    assert "as planned" in found.notes["exposures"]


@pytest.mark.parametrize(
    ("colours", "named"),
    [
        ([[0.5, 1.0], [1.0, 0.008]], "no blue light"),
        ([[0.0, 1.0], [1.0, 0.0]], "no red and blue light"),
        ([[0.5, 0.0], [0.0, 0.8]], "no green light"),
    ],
)
def test_a_colour_that_is_missing_is_told_before_the_scan(colours: list[list[float]], named: str) -> None:
    found = meter(rig_of(Bench(18.0, colours=np.array(colours))), plan_of((200.0, 1.0)))
    assert found.is_told
    assert named in found.sentence
    assert "as planned" in found.sentence


def test_a_colour_that_is_weak_is_no_missing_one_nor_is_that_of_a_monochrome_camera(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rig = rig_of(Bench(18.0, colours=np.array([[0.5, 1.0], [1.0, 0.013]])))
    assert "no blue" not in meter(rig, plan_of((200.0, 1.0))).sentence
    # In a dark picture the black level, which is not known so well, looks like light or its absence.
    dark = rig_of(Bench(0.5, colours=np.array([[0.5, 1.0], [1.0, 0.0]])))
    assert "no blue" not in meter(dark, plan_of((200.0, 1.0))).sentence
    grey = CameraInfo("bench", "1", 40, 20, "MONO", 12, (1.0, 2000.0))
    monkeypatch.setattr(Bench, "info", property(lambda bench: grey))
    found = meter(rig_of(Bench(18.0, colours=np.ones((2, 2)))), plan_of((200.0, 1.0)))
    assert found.sentence.startswith("White reaches")


def test_the_darkest_setting_counts_by_its_light_not_by_its_level() -> None:
    # At level .5 and 200 ms there is .44 of the light of level 1 and 100 ms.
    bench = Bench(light_for(0.5, 100.0))
    plan = plan_of((100.0, 1.0), (200.0, 0.5))
    assert meter(rig_of(bench), plan).plan == plan
    assert bench.exposures_ms == [200.0]


def test_highlights_do_not_shorten_exposures() -> None:
    few = Bench(light_for(0.5, 200.0), highlights=0.1)
    assert not meter(rig_of(few), plan_of((200.0, 1.0))).is_told
    many = Bench(light_for(0.5, 200.0), highlights=0.15)
    assert exposures(meter(rig_of(many), plan_of((200.0, 1.0))))[0] < 200.0


def test_a_dark_scene_lengthens_exposures_up_to_the_limit_and_says_what_is_left() -> None:
    brightest = light_for(0.125, 200.0)  # a quarter of full scale in its brightest colour
    found = meter(rig_of(Bench(brightest)), plan_of((100.0, 1.0), (200.0, 1.0)))
    assert exposures(found) == [340.0, 680.0], f"{FILL_IN_DARK} of full scale in the brightest setting"
    assert "The scene is dark, white reaches 25.0% of full scale" in found.sentence
    assert "Open the aperture" not in found.sentence
    darker = meter(rig_of(Bench(brightest / 20)), plan_of((200.0, 1.0)))
    assert exposures(darker) == [200.0 * MOST_LONGER]
    assert "reaches 4.9%. Open the aperture" in darker.sentence
    within = meter(rig_of(Bench(brightest / 20, range_ms=(1.0, 400.0))), plan_of((100.0, 1.0), (200.0, 1.0)))
    assert exposures(within) == [200.0, 400.0], "the ratio of the settings stays"
    short = meter(rig_of(Bench(brightest / 20, range_ms=(1.0, 200.0))), plan_of((200.0, 1.0)))
    assert exposures(short) == [200.0]
    assert short.is_told


def test_light_that_is_too_much_for_the_shortest_exposure_is_told() -> None:
    bench = Bench(light_for(40.0, 200.0), range_ms=(15.0, 1000.0))
    found = meter(rig_of(bench), plan_of((200.0, 1.0)))
    assert exposures(found) == [20.0]
    assert "saturates even at 20 ms, the shortest possible: close the aperture" in found.sentence


def test_a_plan_that_is_as_short_as_possible_is_still_told_to_saturate() -> None:
    found = meter(rig_of(Bench(light_for(3.0, 20.0), range_ms=(15.0, 1000.0))), plan_of((20.0, 1.0)))
    assert exposures(found) == [20.0]
    assert found.is_told
    assert "shortened" not in found.sentence


def test_what_cannot_be_measured_keeps_its_plan() -> None:
    bench = Bench(light_for(5.0, 200.0))
    no_code = plan_of((200.0, 1.0)).model_copy(update={"code": NoCode()})
    assert meter(rig_of(bench), no_code) == Metered(no_code)
    replayed = replace(rig_of(bench), only_repeats=True)
    assert meter(replayed, plan_of((200.0, 1.0))) == Metered(plan_of((200.0, 1.0)))
    assert bench.shown == []


def test_an_impossible_plan_is_refused_before_anything_is_shown() -> None:
    bench = Bench(1.0)
    with pytest.raises(PlanError, match="setting 0 exposes for 3000 ms"):
        meter(rig_of(bench), plan_of((3000.0, 1.0)))
    assert bench.shown == []


def test_the_projector_is_dark_after_a_camera_that_failed() -> None:
    bench = Bench(1.0)
    bench.snap = lambda timeout_ms=0.0: (_ for _ in ()).throw(DeviceError("no frame"))  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match=r"before the scan: no frame Nothing is saved yet\."):
        meter(rig_of(bench), plan_of((200.0, 1.0)))
    assert bench.shown[-1] == 0


def doubt_of(bench: Bench, level: float = 0.5) -> str:
    """Of a calibrated rig, at a drive level."""
    rig = rig_of(bench)
    response = ProjectorResponse(gamma=2.2, black_fraction=0.0)
    assert rig.nominal is not None
    camera, screen = rig.camera.info, rig.projector.info
    known = rig.nominal
    rig.calibration = known.model_copy(
        update={
            "projector_response": response,
            "camera": known.camera.model_copy(
                update={"width_px": camera.width_px, "height_px": camera.height_px}
            ),
            "projector": known.projector.model_copy(
                update={"width_px": screen.width_px, "height_px": screen.height_px}
            ),
        }
    )
    found = meter(rig, plan_of((200.0, level)))
    assert found.is_told or not found.doubt
    assert found.notes.get("white_in_doubt", "") == found.doubt
    assert found.sentence.startswith(found.doubt)
    return found.doubt


@pytest.mark.parametrize("room", [0.0, 0.05])
@pytest.mark.parametrize("level", [0.25, 0.5, 1.0])
def test_white_that_follows_its_level_is_not_doubted(level: float, room: float) -> None:
    bench = Bench(light_for(0.5, 200.0, level), room=room * level**2.2)
    assert doubt_of(bench, level) == ""
    drive = round(255 * level)
    assert bench.shown == [drive, 0, round(255 * level / 2), 0]


@pytest.mark.parametrize(
    ("curve", "share"),
    [
        (lambda level: level**0.8, 1.36),
        (lambda level: (16 + 219 * level) / 255, 1.27),
        (lambda level: level + 0.5 * level * (1 - level) * (2 * level - 1), 0.63),
    ],
    ids=["gamma", "limited", "vivid"],
)
@pytest.mark.parametrize(("brightness", "colours"), [(0.2, 3), (0.6, 2)])  # green saturates
def test_levels_that_are_changed_on_their_way_are_doubted(
    curve: Callable[[float], float], share: float, brightness: float, colours: int
) -> None:
    doubt = doubt_of(Bench(light_for(brightness, 200.0, 0.5) / curve(0.5) ** 2.2 * 0.5**2.2, curve=curve))
    assert doubt.startswith("At half the drive level, white has another share of its light")
    told = [float(each) for each in re.findall(r"(\d\.\d\d) in (?:red|green|blue)", doubt)]
    assert told == pytest.approx([share] * len(told), abs=0.02)
    assert len(told) == colours


def test_colours_that_end_below_full_scale_say_nothing_of_their_level() -> None:
    colours = np.array([[0.2, 1.3], [1.3, 1.1]])
    assert doubt_of(Bench(light_for(1.0, 200.0, 0.5), colours=colours, ends_dn=4090)) == ""


def test_faint_light_says_nothing_of_its_level() -> None:
    assert doubt_of(Bench(light_for(0.002, 200.0, 0.5), curve=lambda level: level**0.8)) == ""


def test_numbers_in_the_first_row_are_told_before_the_scan() -> None:
    assert "first row of black holds numbers" in doubt_of(Bench(light_for(0.5, 200.0, 0.5), numbers=20))


@pytest.mark.parametrize("range_ms", [(0.05, 500.0), (0.05, 8.0)])
def test_exposures_below_a_cycle_are_shortened_within_the_range_of_the_camera(
    range_ms: tuple[float, float],
) -> None:
    """Whole cycles would make them longer, and longer than the camera can."""
    bench = Bench(light_for(2.2, 4.0), range_ms=range_ms)
    found = meter(rig_of(bench), plan_of((4.0, 1.0)))
    assert exposures(found) == [pytest.approx(2.0, rel=0.01)]
    assert "exposures are shortened from 4 to 2.001 ms." in found.sentence


@pytest.mark.parametrize("planned_ms", [9.99, 9.96, 9.6])
def test_a_cycle_that_was_rounded_is_not_cut(planned_ms: float) -> None:
    """Less than a cycle of a projector lacks colours; a plan of 16.67 ms met one of 59.94 Hz."""
    found = meter(rig_of(Bench(light_for(3.0, planned_ms))), plan_of((planned_ms, 1.0)))
    assert exposures(found) == [planned_ms]
    assert f"It saturates even at {planned_ms:.4g} ms" in found.sentence


def test_a_bracket_that_is_shortened_to_few_cycles_stays_one() -> None:
    found = meter(rig_of(Bench(light_for(4.0, 30.0))), plan_of((30.0, 1.0), (50.0, 1.0)))
    assert exposures(found) == [10.0, 20.0]


def test_a_dark_scene_whose_exposure_is_the_longest_is_told_so_once() -> None:
    found = meter(rig_of(Bench(light_for(0.01, 10.0), range_ms=(1.0, 12.0))), plan_of((10.0, 1.0)))
    assert exposures(found) == [10.0]
    assert found.sentence.endswith("in the brightest setting. Open the aperture, or choose longer exposures.")
