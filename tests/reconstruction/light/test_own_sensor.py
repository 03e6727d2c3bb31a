"""Frames that end below full scale, or come in coarse steps, say so; those that do not are left alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, ScanLines, Setting, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import SEEN, bayer_channels, raw_variance, step_of
from dsl_core.reconstruction.light.own_sensor import own_sensor

SHAPE = (48, 64)
SENSOR = Sensor(black_level_dn=250.0, read_noise_dn=1.0)
PLAN = CapturePlan(
    code=GrayCode(rows=False),
    spectral=ScanLines(width_px=5, step_px=4),
    projector_size_px=(64, 20),
    settings=(Setting(exposure_ms=10.0, level=1.0), Setting(exposure_ms=40.0, level=1.0)),
)


@dataclass
class Lit:
    """A plane in three colours, brighter to the right; values end at ``ends_dn`` and are rounded."""

    ends_dn: int = 4095
    step_dn: int = 1
    noisy: bool = True
    colours: tuple[float, float, float] = (0.6, 1.0, 0.8)
    hot: int = 0
    plan: CapturePlan = PLAN

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        light = np.zeros(SHAPE)
        if shot.role != "black":
            light += np.linspace(20, 150, SHAPE[1]) if self.noisy else 70.0
        if shot.role == "code":
            stripe = np.arange(SHAPE[1]) * (shot.pattern // 2 + 2) // SHAPE[1] % 2
            light = light * (stripe == shot.pattern % 2)
        own = np.array(self.colours)[bayer_channels(SENSOR.bayer, *SHAPE)]
        signal = light * own * PLAN.settings[shot.setting].exposure_ms
        rng = np.random.default_rng(shot.index)
        noise = rng.normal(size=SHAPE) * np.sqrt(raw_variance(SENSOR, signal)) * self.noisy
        values = np.rint((SENSOR.black_level_dn + signal + noise) / self.step_dn) * self.step_dn
        values = values.clip(0, self.ends_dn)
        values.flat[: self.hot] = 4095
        return np.asarray(values, np.uint16)


def test_frames_that_end_at_full_scale_are_left_alone() -> None:
    for source in (Lit(), Lit(hot=3), Lit(ends_dn=4090), Lit(noisy=False)):
        assert own_sensor(source, SENSOR) == (SENSOR, ())


def test_values_that_end_earlier_are_saturated_there() -> None:
    for source in (Lit(ends_dn=3000), Lit(ends_dn=3000, hot=3)):
        sensor, (told,) = own_sensor(source, SENSOR)
        assert sensor.full_scale_dn == 3000
        assert sensor.model_copy(update={"saturation_dn": None}) == SENSOR
        assert told.significant
        assert told.value == pytest.approx(1 - 3000 / 4095)
        assert "end at 3000 DN instead of 4095 DN" in told.sentence


def test_one_colour_alone_may_be_a_surface_without_noise() -> None:
    sensor, _ = own_sensor(Lit(ends_dn=3000, colours=(0.1, 1.0, 0.1)), SENSOR)
    assert sensor == SENSOR


def test_steps_are_noise_and_are_told_if_they_are_coarser_than_it() -> None:
    sensor, (told,) = own_sensor(Lit(step_dn=16), SENSOR)
    assert sensor == SENSOR.model_copy(update={"step_dn": 16})
    assert raw_variance(sensor, np.zeros(1)) == pytest.approx(1.0 + 256 / 12)
    assert told.significant
    assert "pictures of 8 bits; the camera has 12" in told.sentence
    fine, (told,) = own_sensor(Lit(step_dn=2), SENSOR)
    assert fine.step_dn == 2
    assert not told.significant
    assert own_sensor(Lit(step_dn=16), sensor) == (sensor, ())


def test_noise_is_that_of_the_frames_where_it_is_more_than_calibrated() -> None:
    calm = SENSOR.model_copy(update={"electrons_per_dn": 90.0, "read_noise_dn": 1 / 3})
    sensor, (told,) = own_sensor(Lit(), calm)
    assert sensor.electrons_per_dn == pytest.approx(SENSOR.electrons_per_dn, rel=0.3)
    assert told.significant
    assert told.part == "noise"
    assert told.value == pytest.approx(np.sqrt(90 / sensor.electrons_per_dn))
    assert "times as noisy as its calibration says" in told.sentence
    assert own_sensor(Lit(plan=PLAN.model_copy(update={"code": NoCode()})), calm) == (calm, ())


def test_a_step_is_that_between_values_that_many_pixels_have() -> None:
    counts = np.zeros(100, np.int64)
    assert step_of(counts) == 1
    counts[10:60:4], counts[11], counts[70:80] = 50, 4, 6
    assert step_of(counts) == 4
    counts[:] = 0
    counts[[3, 40, 80]] = 1000
    assert step_of(counts) == 1, "three values of light without noise"


@pytest.mark.parametrize(("weight", "step"), [(6, 1), (7, 4)])
def test_the_usual_step_is_that_of_half_of_all_pixels(weight: int, step: int) -> None:
    # Fourteen steps of one with seven pixels each, and fifteen of four.
    total = np.zeros(100, np.int64)
    total[:15] = 7
    total[14 : 14 + 4 * 15 : 4] = weight
    total[14 + 4 * 15] = SEEN
    assert step_of(total) == step
