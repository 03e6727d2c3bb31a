"""Pairs of a code tell what moves while it is captured, and are not misled by its light."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from dsl_core.capture.pair_watch import PairWatch
from dsl_core.capture.sentinels import movement_of
from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, NoSpectral, Setting, Shot
from dsl_core.model.rig import Sensor
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.published_rig import published_rig
from tests.cases.changing_rig import Change, changing, shifted
from tests.cases.memory_sink import MemorySink
from tests.cases.rendered_rig import RenderedScene, token_image

SIZE = (96, 64)
FLICKER = 1 + 0.1 * np.random.default_rng(5).uniform(-1, 1, 64)


@pytest.fixture(scope="module")
def scene() -> RenderedScene:
    """A textured plane that faces the camera: column x of the picture sees column x of the projector."""
    plan = CapturePlan(
        camera_size_px=SIZE,
        projector_size_px=SIZE,
        code=GrayCode(rows=False),
        spectral=NoSpectral(),
        settings=(Setting(exposure_ms=100, level=0.5), Setting(exposure_ms=200, level=0.5)),
    )
    texture = 1.5 + 4 * gaussian_filter(np.random.default_rng(4).normal(size=SIZE[::-1]), 1.5)
    rates: dict[bytes, np.ndarray] = {}
    for shot in plan.shots():
        image = pattern_image(plan, shot)[..., 1] / 255.0
        light = 20 * gaussian_filter(image, 0.7) * texture.clip(0.3) + 0.05
        rates[token_image(plan, shot).tobytes()] = light.astype(np.float32)
    return RenderedScene(plan, published_rig(), rates)


def partly(scene: RenderedScene, x_px: int) -> RenderedScene:
    """The scene with something in columns 32-63, rows 16-47 moved."""
    part = np.s_[16:48, 32:64]

    def moved(rate: np.ndarray) -> np.ndarray:
        new = rate.copy()
        new[part] = np.roll(rate, x_px, 1)[part]
        return new

    return replace(scene, rates={key: moved(rate) for key, rate in scene.rates.items()})


def scan(scenes: list[RenderedScene], change: Change) -> MemorySink:
    rig, sink = changing(scenes, change, 3), MemorySink(scenes[0].plan)
    for shot in scenes[0].plan.shots():
        rig.projector.show(token_image(sink.plan, shot))
        rig.camera.configure(shot.exposure_ms)
        rig.camera.prepare(shot.index)
        sink.write(shot, rig.camera.snap())
    return sink


@pytest.mark.parametrize(
    "change",
    [
        Change(),
        Change(light=lambda shot: float(FLICKER[shot])),
        Change(light=lambda shot: 1 - 0.01 * shot),
        Change(room=lambda shot: 1.0 + (shot > 4)),
    ],
)
def test_light_is_no_movement(scene: RenderedScene, change: Change) -> None:
    assert movement_of(scan([scene], change), scene.calibration.sensor) is None


@pytest.mark.parametrize("at", [4, 7, 11])
def test_a_motion_within_the_code_is_told_with_pixels_and_frames(scene: RenderedScene, at: int) -> None:
    sink = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(shot >= at)))
    found = movement_of(sink, scene.calibration.sensor)
    assert found is not None
    assert found.after is not None
    assert found.before is not None
    assert found.after <= at <= found.before <= found.after + 3
    assert found.shift_px == pytest.approx(2.0, abs=0.15)
    assert found.columns is None
    assert not found.is_pattern


def test_a_part_that_moves_is_told_with_its_place(scene: RenderedScene) -> None:
    sink = scan([scene, partly(scene, 2)], Change(scene=lambda shot: int(shot >= 6)))
    found = movement_of(sink, scene.calibration.sensor)
    assert found is not None
    assert found.shift_px == pytest.approx(2.0, abs=0.2)
    assert found.columns == (32, 64)
    assert found.rows == (16, 48)
    assert found.sentence.startswith("Something moved by 2.0")


def test_one_odd_pair_is_no_movement(scene: RenderedScene) -> None:
    sink = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(shot in (6, 7))))
    assert movement_of(sink, scene.calibration.sensor) is None


def test_a_motion_between_the_codes_of_two_settings_is_told(scene: RenderedScene) -> None:
    at = scene.plan.shot_count // 2
    sink = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(shot >= at)))
    found = movement_of(sink, scene.calibration.sensor)
    assert found is not None
    assert found.shift_px == pytest.approx(2.0, abs=0.15)


def test_a_pattern_that_moves_on_a_still_scene_is_told(scene: RenderedScene) -> None:
    """The stripes of a second setting are a column aside, as if the projector had been pushed."""
    sink = scan([scene], Change())
    at, texture = scene.plan.shot_count // 2, scene.rates[token_image(scene.plan, _white(scene)).tobytes()]
    for shot in scene.plan.shots():
        if shot.index >= at and shot.role == "code":
            rate = scene.rates[token_image(scene.plan, shot).tobytes()]
            aside = np.roll(rate / texture, 1, 1) * texture
            pixels = (scene.calibration.sensor.black_level_dn + shot.exposure_ms * aside).astype(np.uint16)
            sink.frames[shot.index] = replace(sink.frames[shot.index], pixels=pixels)
    found = movement_of(sink, scene.calibration.sensor)
    assert found is not None
    assert found.is_pattern
    assert found.shift_px == pytest.approx(1.0, abs=0.2)


def _white(scene: RenderedScene) -> Shot:
    return next(shot for shot in scene.plan.shots() if shot.role == "white")


def test_plans_without_a_code_of_ours_are_not_watched() -> None:
    assert PairWatch(CapturePlan(code=NoCode()), Sensor()).wanted == frozenset()


def test_a_first_pair_that_was_captured_again_counts_as_taken_last(scene: RenderedScene) -> None:
    sink, watch = scan([scene], Change()), PairWatch(scene.plan, scene.calibration.sensor)
    shots = [shot for shot in scene.plan.shots() if shot.role == "code"][:8]
    wrong = [np.roll(sink.read(shot), 8, 1) for shot in shots[:2]]
    assert [watch.add(*each) for each in zip(shots[:2], wrong, strict=True)] == [None, None]
    assert [watch.add(shot, sink.read(shot)) for shot in shots] == [None] * 8
