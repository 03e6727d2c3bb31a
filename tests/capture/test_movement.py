"""A shot taken again tells whether the scene moved or the light faded, and noise passes for neither."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.movement import MovementReport, check_movement, pick_reference_shots
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.replay import replay_rig
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
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


def test_without_shots_there_is_nothing_to_compare() -> None:
    with pytest.raises(ValueError, match="at least one shot"):
        check_movement(_rig(lambda scene: scene), _scan(1), [], pattern_image)
