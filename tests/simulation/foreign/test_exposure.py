"""Frames of foreign twins over time and from pixel to pixel."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.simulation.foreign.exposure import (
    DRIFT_S,
    DRIFT_SHARE,
    GAIN_STD,
    HOT_SHARE,
    LAMPS_DN_PER_MS,
    exposed,
    lamps,
    light_level,
    uneven_pixels,
)
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.sim_devices import SimCamera, open_twin


def of(*names: str) -> Foreign:
    return Foreign(frozenset(names))


def test_light_falls_slowly_by_three_percent_and_comes_back() -> None:
    drift = of("light-drift")
    assert light_level(drift, 0.0) == 1
    assert light_level(drift, DRIFT_S) == pytest.approx(1 - DRIFT_SHARE)
    assert light_level(drift, 2 * DRIFT_S) == pytest.approx(1)
    levels = [light_level(drift, t) for t in np.arange(0, DRIFT_S, 0.4)]
    assert np.abs(np.diff(levels)).max() < 1e-4
    assert light_level(of("prnu"), 100.0) == 1


def test_ambient_light_does_not_drift_and_lamps_flicker_by_a_tenth() -> None:
    light = np.full((2, 2), 5.0, np.float32)
    assert exposed(of("light-drift"), light, 5.0, DRIFT_S, 100.0) == pytest.approx(light)
    seen = np.array([lamps(of("flicker"), t, 333.3) for t in np.arange(0, 60, 0.383)])
    assert seen.mean() == pytest.approx(LAMPS_DN_PER_MS, rel=0.05)
    assert 0.03 < seen.std() / seen.mean() < 0.12
    assert lamps(of("blur"), 3.0, 100.0) == 0
    # Long exposures average the flicker away.
    long = np.array([lamps(of("flicker"), t, 30_000.0) for t in np.arange(0, 60, 3.1)])
    assert long.std() < 0.1 * seen.std()


def test_pixels_differ_by_a_percent_and_a_few_are_hot() -> None:
    gain, hot = uneven_pixels(3, 300, 400)
    assert gain.std() == pytest.approx(GAIN_STD, rel=0.02)
    assert (hot > 0).mean() == pytest.approx(HOT_SHARE, rel=0.5)
    other = uneven_pixels(4, 300, 400)
    assert abs(np.corrcoef(gain.ravel(), other[0].ravel())[0, 1]) < 0.02
    light = np.full((300, 400), 2.0, np.float32)
    seen = exposed(Foreign(frozenset({"prnu"}), 3), light, 0.0, 0.0, 100.0)
    assert seen == pytest.approx(2 * gain + hot)


@pytest.mark.slow
def test_frames_have_the_gain_and_the_dark_current() -> None:
    """The same shot without noise, with and without uneven pixels."""

    def frame(foreign: str) -> np.ndarray:
        camera = open_twin({"foreign": foreign, "size": "96x64", "noise": "off"}).camera
        assert isinstance(camera, SimCamera)
        camera.world.show(np.full((360, 640, 3), 255, np.uint8))
        return camera.world.expose(50.0, 1).astype(float) - camera.world.rig.sensor.black_level_dn

    usual, uneven = frame("plain"), frame("prnu")
    gain, hot = uneven_pixels(0, 64, 96)
    bright = (usual > 300) & (usual < 3500)
    assert bright.sum() > 500
    expected = gain[bright] + 50 * hot[bright] / usual[bright]
    assert uneven[bright] / usual[bright] == pytest.approx(expected, abs=0.005)
