from __future__ import annotations

import numpy as np
import pytest

from dsl_core.patterns.trial_pictures import trial_picture
from dsl_core.simulation.led_cycle import led_weights
from dsl_core.simulation.sim_devices import open_twin


@pytest.mark.parametrize("start_ms", [0.0, 3.3, 1e6 + 0.7])
@pytest.mark.parametrize("exposure_ms", [500 / 3, 166.6666667, 60_000 + 50 / 3])
def test_whole_periods_catch_all_leds_alike(start_ms: float, exposure_ms: float) -> None:
    # Also where the exposure is written with ten digits, or is long.
    assert led_weights(start_ms, exposure_ms, 1000 / 60).tolist() == [1, 1, 1]


def test_a_third_of_a_period_catches_one_led() -> None:
    assert led_weights(0.0, 5.0, 15.0) == pytest.approx([3, 0, 0])
    assert led_weights(5.0, 5.0, 15.0) == pytest.approx([0, 3, 0])
    assert led_weights(12.5, 5.0, 15.0) == pytest.approx([1.5, 0, 1.5])


def test_the_mean_over_all_starts_is_steady_light() -> None:
    weights = [led_weights(start, 7.0, 15.0) for start in np.arange(0, 15, 0.01)]
    assert np.mean(weights, axis=0) == pytest.approx([1, 1, 1], abs=1e-3)


def test_the_twin_beats_unless_exposures_are_whole_cycles() -> None:
    rig = open_twin({"scene": "plane", "size": "64x48", "noise": "off", "led_cycle_hz": "50"})
    rig.projector.show(trial_picture("white", (640, 360), 0.2))
    spread = {}
    for exposure_ms in (500 / 3, 160.0):
        rig.camera.configure(exposure_ms)
        means = []
        for _ in range(6):
            means.append(float(rig.camera.snap().pixels[::2, ::2].mean()) - 260)
            assert rig.sleep is not None
            rig.sleep(0.0037)
        spread[exposure_ms] = np.std(means) / np.mean(means)
    assert spread[160.0] < 1e-3
    assert spread[500 / 3] > 0.01


def test_steady_and_flashing_light_agree_over_whole_cycles() -> None:
    frames = []
    for options in ({}, {"led_cycle_hz": "60"}):
        rig = open_twin({"scene": "plane", "size": "64x48", "noise": "off", **options})
        rig.projector.show(trial_picture("white", (640, 360), 0.2))
        rig.camera.configure(500 / 3)
        frames.append(rig.camera.snap().pixels)
    assert np.array_equal(frames[0], frames[1])
