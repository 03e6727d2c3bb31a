"""Light of one setting relative to another one's, from raw counts."""

import numpy as np
import pytest

from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import digitise
from dsl_core.reconstruction.hdr import BlackFrame
from dsl_core.reconstruction.light.setting_ratios import compare_settings

SENSOR, GAINS_MS = Sensor(), (4.0, 100.0)


def mosaics(level: float, share: float = 1.0) -> list[np.ndarray]:
    rng = np.random.default_rng(9)
    light = share * np.linspace(0, 60, 60 * 80, dtype=np.float32).reshape(60, 80)
    return [digitise(SENSOR, light * np.float32(gain), rng) for gain in (GAINS_MS[0] * level, GAINS_MS[1])]


@pytest.mark.parametrize("level", [1.0, 0.9, 1.15])
def test_a_fainter_shot_is_told(level: float) -> None:
    black = BlackFrame(np.full((60, 80), SENSOR.black_level_dn, np.float32), np.zeros((60, 80), np.float32))
    found, own = compare_settings(mosaics(level), [black, black], GAINS_MS, SENSOR)
    assert found is not None
    assert own is not None
    assert abs(found.log - np.log(level)) < 3.5 * found.std
    assert found.std < 0.01
    assert own.log == 0


def test_dark_pictures_say_nothing() -> None:
    black = BlackFrame(np.full((60, 80), SENSOR.black_level_dn, np.float32), np.zeros((60, 80), np.float32))
    assert compare_settings(mosaics(1.0, 0.001), [black, black], GAINS_MS, SENSOR)[0] is None
