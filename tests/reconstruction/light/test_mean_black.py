"""Black frames tell the light of the projector's black and of the room, in every colour of a mosaic."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot
from dsl_core.model.result import BLACK_ATTRIBUTE
from dsl_core.model.rig import BayerPattern, Sensor
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.light.mean_black import mean_black
from tests.cases.twin_scan import twin_scan

SETTINGS = (Setting(exposure_ms=20, level=0.2), Setting(exposure_ms=200, level=0.8))
SIZE = (40, 60)


class Blacks:
    """Frames of light (rows, columns) in DN per ms."""

    def __init__(self, sensor: Sensor, light: NDArray[np.float64]) -> None:
        self.plan, self._sensor, self._light = CapturePlan(settings=SETTINGS), sensor, light

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """What the sensor reads."""
        raw = self._sensor.black_level_dn + self._light * shot.exposure_ms
        return np.asarray(raw.round().clip(0, self._sensor.full_scale_dn), np.uint16)


@pytest.mark.parametrize(
    ("bayer", "wanted"), [("RGGB", (1.0, 2.0, 4.0)), ("GBRG", (1.0, 2.0, 4.0)), ("MONO", (0.0, 2.0, 0.0))]
)
def test_every_colour_has_its_own_light_where_something_is_seen(
    bayer: BayerPattern, wanted: tuple[float, ...]
) -> None:
    sensor = Sensor(bayer=bayer)
    light = np.array([1.0, 2.0, 4.0])[bayer_channels(bayer, *SIZE)]
    seen = np.ones(SIZE, bool)
    light[:, :30], seen[:, :30] = 9.0, False
    assert mean_black(Blacks(sensor, light), sensor, seen) == pytest.approx(wanted)


def test_an_exposure_that_the_room_saturates_tells_nothing() -> None:
    sensor = Sensor(bayer="MONO")
    light = np.full(SIZE, sensor.full_scale_dn / 100)
    assert mean_black(Blacks(sensor, light), sensor, light > 0)[1] == pytest.approx(light[0, 0], rel=0.01)


def test_a_result_keeps_the_light_of_its_room() -> None:
    plan = CapturePlan(
        code=GrayCode(rows=False),
        spectral=LineComb(width_px=6, step_px=4, period_px=64),
        settings=SETTINGS,
        code_settings=(0, 1),
    )
    black = []
    for room_dn_per_ms in ("0", "0.7"):
        devices, scan = twin_scan(plan, size="64x42", scene="plane", ambient_dn_per_ms=room_dn_per_ms)
        assert devices.calibration is not None
        result = pipeline.reconstruct(scan, devices.calibration, pipeline.Options(spectra=False))
        black.append(json.loads(result.attrs[BLACK_ATTRIBUTE]))
    assert np.subtract(*reversed(black)) == pytest.approx(0.7, abs=0.01), "besides the projector's own"
