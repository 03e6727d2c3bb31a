"""A shot taken again tells whether the scene moved or the light faded, and noise passes for neither."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.movement import (
    MovementReport,
    _blocks,
    check_movement,
    pick_dark_shots,
    pick_reference_shots,
)
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.replay import replay_rig
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.model.rig import Sensor
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.published_rig import published_rig
from tests.cases.memory_sink import MemorySink

PLAN = CapturePlan(
    camera_size_px=(64, 48),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=0.4),),
    code_settings=(0,),
)
Change = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def _scan(seed: int, change: Change = lambda scene: scene) -> MemorySink:
    """A scan of a bright blob; read noise 5 DN."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:48, :64]
    scene = 100.0 + 2000.0 * np.exp(-((x - 30.0) ** 2 + (y - 20.0) ** 2) / 200.0)
    sink = MemorySink(PLAN)
    for shot in PLAN.shots():
        noisy = change(scene) + rng.normal(0, 5, scene.shape)
        sink.write(shot, Frame(np.round(noisy).clip(0, 4095).astype(np.uint16), shot.exposure_ms))
    return sink


def _rig(change: Change) -> DeviceRig:
    return replay_rig(_scan(2, change))


def test_reference_shots_are_white_and_the_finest_code() -> None:
    chosen = pick_reference_shots(PLAN.shots())
    assert [(shot.role, shot.pattern) for shot in chosen] == [("code", PLAN.code_count - 1), ("white", 0)]
    first_two = list(PLAN.shots())[:2]
    assert pick_reference_shots(first_two) == [first_two[1]]


def test_noise_is_not_movement() -> None:
    shots = pick_reference_shots(PLAN.shots())
    report = check_movement(_rig(lambda scene: scene), _scan(1), shots, pattern_image)
    assert report.is_stable
    assert report.shots == tuple(shot.index for shot in shots)
    assert "Nothing moved" in report.message


@pytest.mark.parametrize(
    ("change", "brightness_ratio"),
    [(lambda scene: 0.9 * scene, 0.9), (lambda scene: np.roll(scene, 2, axis=1), 1.0)],
)
def test_fading_and_motion_are_found(change: Change, brightness_ratio: float) -> None:
    report = check_movement(_rig(change), _scan(1), pick_reference_shots(PLAN.shots()), pattern_image)
    assert not report.is_stable
    assert report.brightness_ratio == pytest.approx(brightness_ratio, abs=0.01)
    assert "Start a new scan" in report.message


def test_a_report_states_both_changes_in_percent() -> None:
    moved = MovementReport((7,), brightness_ratio=0.9, change=0.25).message
    assert "brightness changed by -10.0 %, structure by 25.0 %, allowed 3.0 %" in moved
    still = MovementReport((7,), brightness_ratio=1.01, change=0.004).message
    assert "brightness changed by +1.0 %, structure by 0.4 %" in still


def test_the_black_level_is_no_light() -> None:
    """A tenth of the light is a tenth of what is above black, however high that is."""
    black = 260.0

    def above(light: float) -> Change:
        return lambda scene: light * scene + black

    rig = replace(_rig(above(0.9)), calibration=published_rig())
    assert published_rig().sensor.black_level_dn == black
    report = check_movement(rig, _scan(1, above(1.0)), pick_reference_shots(PLAN.shots()), pattern_image)
    assert report.brightness_ratio == pytest.approx(0.9, abs=0.005)


def _patterns(seed: int, white_dn: float, light: float = 1.0) -> MemorySink:
    """A scan of a wall by a camera with a black level of 260 DN and read noise of 3 DN."""
    rng, sink = np.random.default_rng(seed), MemorySink(PLAN)
    for shot in PLAN.shots():
        image = np.kron(pattern_image(PLAN, shot)[..., 1] > 0, np.ones((2, 2)))
        scene = np.zeros((48, 64))
        scene[6:42] = light * white_dn * image
        noisy = 260 + scene + rng.normal(0, 3, scene.shape)
        sink.write(shot, Frame(np.round(noisy).clip(0, 4095).astype(np.uint16), shot.exposure_ms))
    return sink


@pytest.mark.parametrize("count", [2, 6, 12])
@pytest.mark.parametrize("light", [0.8, 1.0, 1.2])
def test_the_light_of_a_camera_that_is_not_calibrated_is_what_exceeds_its_dark_pictures(
    light: float, count: int
) -> None:
    done = list(PLAN.shots())[:count]
    rig = replace(replay_rig(_patterns(2, 200.0, light)), calibration=None)
    shots, dark = pick_reference_shots(done), pick_dark_shots(done)
    report = check_movement(rig, _patterns(1, 200.0), shots, pattern_image, dark)
    assert report.brightness_ratio == pytest.approx(light, abs=0.02)
    assert report.is_stable == (light == 1)


@pytest.mark.parametrize("exposures_ms", [(10.0, 200.0), (200.0, 10.0)])
@pytest.mark.parametrize("light", [0.9, 1.0])
@pytest.mark.parametrize(
    ("code_settings", "stopped_after"), [((0, 1), 14), ((0, 1), 17), ((0, 1), 28), ((0,), 18), ((1,), 16)]
)
def test_light_of_the_room_is_that_of_the_setting(
    exposures_ms: tuple[float, float], light: float, code_settings: tuple[int, ...], stopped_after: int
) -> None:
    """Each setting of a camera that is not calibrated sees the room as brightly as it exposes for."""
    settings = tuple(Setting(exposure_ms=ms, level=0.4) for ms in exposures_ms)
    plan = PLAN.model_copy(update={"settings": settings, "code_settings": code_settings})

    def taken(seed: int, light: float) -> MemorySink:
        rng, sink = np.random.default_rng(seed), MemorySink(plan)
        for shot in plan.shots():
            image = np.kron(pattern_image(plan, shot)[..., 1] > 0, np.ones((2, 2)))
            scene = np.pad(500.0 * light * image, ((6, 6), (0, 0))) + 2.0 * shot.exposure_ms
            noisy = 260 + scene + rng.normal(0, 3, scene.shape)
            sink.write(shot, Frame(np.round(noisy).clip(0, 4095).astype(np.uint16), shot.exposure_ms))
        return sink

    done = list(plan.shots())[:stopped_after]
    rig = replace(replay_rig(taken(2, light)), calibration=None)
    report = check_movement(
        rig, taken(1, 1.0), pick_reference_shots(done), pattern_image, pick_dark_shots(done)
    )
    assert report.brightness_ratio == pytest.approx(light, abs=0.01)
    assert report.is_stable == (light == 1)


def test_an_exposure_that_is_rounded_otherwise_is_no_change_of_light() -> None:
    """The frames say how long they were exposed: 10 ms before, and 10.4 ms now."""
    black = 260.0
    longer = PLAN.model_copy(update={"settings": (Setting(exposure_ms=10.4, level=0.4),)})
    now = MemorySink(longer)
    now.frames = dict(_scan(2, lambda scene: 1.04 * scene + black).frames)
    rig = replace(replay_rig(_scan(2), exposed=now), calibration=published_rig())
    shots = pick_reference_shots(PLAN.shots())
    report = check_movement(rig, _scan(1, lambda scene: scene + black), shots, pattern_image)
    assert report.brightness_ratio == pytest.approx(1.0, abs=0.003)
    assert report.is_stable


def test_black_is_dark_and_so_is_a_pair_of_the_code_but_no_single_picture() -> None:
    shots = list(PLAN.shots())
    assert [shot.role for shot in pick_dark_shots(shots)] == ["black"]
    assert pick_dark_shots(shots[:3]) == shots[:2]
    assert pick_dark_shots(shots[:1]) == []
    assert pick_reference_shots(shots[:1]) == shots[:1]


def test_the_noise_of_dim_pictures_is_no_change_of_structure() -> None:
    done = list(PLAN.shots())
    known = published_rig()
    known = known.model_copy(update={"sensor": known.sensor.model_copy(update={"read_noise_dn": 3.0})})
    rig = replace(replay_rig(_patterns(2, 12.0)), calibration=known)
    report = check_movement(rig, _patterns(1, 12.0), pick_reference_shots(done), pattern_image)
    assert report.change < 0.02


def test_without_shots_there_is_nothing_to_compare() -> None:
    with pytest.raises(ValueError, match="at least one shot"):
        check_movement(_rig(lambda scene: scene), _scan(1), [], pattern_image)


def test_blocks_are_means_of_eight_by_eight_pixels() -> None:
    pixels = np.arange(17 * 27, dtype=np.uint16).reshape(17, 27)
    wanted = [[pixels[8 * r : 8 * r + 8, 8 * c : 8 * c + 8].mean() for c in range(3)] for r in range(2)]
    assert _blocks(pixels).tolist() == wanted
    assert _blocks(pixels[:4, :8]).tolist() == [[pixels[:4, :4].mean(), pixels[:4, 4:8].mean()]]


def test_a_change_is_the_largest_of_all_shots_after_scaling() -> None:
    shots = list(PLAN.shots())[:2]

    def frames(*pictures: list[float]) -> MemorySink:
        sink = MemorySink(PLAN)
        for shot, (left, right) in zip(shots, pictures, strict=True):
            pixels = np.repeat([left, right], 32).astype(np.uint16) * np.ones((48, 1), np.uint16)
            sink.write(shot, Frame(pixels, shot.exposure_ms))
        return sink

    old, new = frames([100, 300], [200, 200]), frames([60, 140], [100, 100])
    # Noise is taken off; this sensor has that of rounding alone.
    silent = Sensor(black_level_dn=0.0, read_noise_dn=0.0, electrons_per_dn=1e9)
    rig = replace(replay_rig(new), calibration=published_rig().model_copy(update={"sensor": silent}))
    report = check_movement(rig, old, shots, pattern_image)
    assert report.brightness_ratio == pytest.approx(0.5)
    assert report.change == pytest.approx(10 / np.sqrt((50**2 + 150**2) / 2), rel=1e-4)
    assert report.shots == (0, 1)


@pytest.mark.parametrize("level", [0, 1])
def test_old_pictures_without_light_are_no_measure(level: int) -> None:
    shot = next(PLAN.shots())
    dark, new = MemorySink(PLAN), _scan(2)
    dark.write(shot, Frame(np.full((48, 64), level, np.uint16), shot.exposure_ms))
    report = check_movement(replay_rig(new), dark, [shot], pattern_image)
    assert np.isfinite(report.brightness_ratio) == bool(level)
    assert np.isfinite(report.change) == bool(level)


def test_the_projector_is_dark_afterwards() -> None:
    rig = _rig(lambda scene: scene)
    shown: list[bool] = []

    class Noted(type(rig.projector)):  # type: ignore[misc]
        def show(self, image: NDArray[np.uint8]) -> None:
            shown.append(bool(image.any()))
            super().show(image)

    rig.projector.__class__ = Noted
    check_movement(rig, _scan(1), list(PLAN.shots())[:1], pattern_image)
    assert shown[-1] is False


def test_a_scan_allows_three_percent_of_either() -> None:
    assert MovementReport((1,), brightness_ratio=0.971, change=0.029).is_stable
    assert not MovementReport((1,), brightness_ratio=0.969, change=0.0).is_stable
    assert not MovementReport((1,), brightness_ratio=1.0, change=0.031).is_stable


def test_the_last_white_and_the_last_of_the_code_are_compared() -> None:
    plan = PLAN.model_copy(update={"settings": PLAN.settings * 2, "code_settings": (0, 1)})
    shots = list(plan.shots())
    chosen = pick_reference_shots(shots)
    assert [shot.role for shot in chosen] == ["code", "white"]
    assert [shot.index for shot in chosen] == [
        max(shot.index for shot in shots if shot.role == role) for role in ("code", "white")
    ]
    lines = [shot for shot in shots if shot.role == "spectral"]
    assert pick_reference_shots(lines) == lines[-2:]
