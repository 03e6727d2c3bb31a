"""Frames that end below full scale, unlike all others, say so, and their last value counts as saturated."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, NoCode, ScanLines, Setting, Shot
from dsl_core.model.rig import Sensor
from dsl_core.optics.sensor import bayer_channels, raw_variance
from dsl_core.reconstruction.light.early_ends import PILE, EarlyEnds, end_of_values

SHAPE = (48, 64)
SENSOR = Sensor(black_level_dn=250.0, read_noise_dn=1.0)
PLAN = CapturePlan(
    code=NoCode(),
    spectral=ScanLines(width_px=5, step_px=4),
    projector_size_px=(64, 20),
    settings=(Setting(exposure_ms=10.0, level=1.0),),
    code_settings=(0,),
)
SHOTS = tuple(PLAN.shots())


def picture(
    *, ends_dn: int = 4095, step_dn: int = 1, noisy: bool = True, colours: tuple[float, ...] = (0.6, 1.0, 0.8)
) -> NDArray[np.uint16]:
    """A plane in three colours, brighter to the right, whose values end there and come in steps."""
    own = np.array(colours)[bayer_channels(SENSOR.bayer, *SHAPE)]
    signal = np.linspace(400, 3700, SHAPE[1]) * own
    noise = np.random.default_rng(3).normal(size=SHAPE) * np.sqrt(raw_variance(SENSOR, signal)) * noisy
    values = np.rint((SENSOR.black_level_dn + signal + noise) / step_dn) * step_dn
    return np.asarray(values.clip(0, ends_dn), np.uint16)


@dataclass
class Cut:
    """Frames of which some end earlier than others."""

    cut: dict[int, int] = field(default_factory=dict)
    plan: CapturePlan = PLAN

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        return picture(ends_dn=self.cut.get(shot.index, 4095))


@pytest.mark.parametrize(
    "sound",
    [
        picture(),
        picture(ends_dn=4050),
        picture(step_dn=16),
        picture(step_dn=32, noisy=False),
        picture(noisy=False),
        picture(ends_dn=1000) // 2,
        picture(ends_dn=3000, colours=(0.1, 1.0, 0.1)),
        np.zeros(SHAPE, np.uint16),
    ],
)
def test_frames_that_do_not_end_early_are_left_alone(sound: NDArray[np.uint16]) -> None:
    assert end_of_values(sound, SENSOR) is None


def test_the_end_is_the_value_that_many_pixels_of_several_colours_have() -> None:
    cut = picture(ends_dn=3000)
    assert end_of_values(cut, SENSOR) == 3000
    cut[0, 0] = 4095
    assert end_of_values(cut, SENSOR) == 3000, "a hot pixel"
    assert end_of_values(cut[1:], SENSOR, 1) == 3000
    few = picture()
    few[few >= 2500] = 2400
    few.flat[: PILE - 1] = 2600
    assert end_of_values(few, SENSOR) != 2600


def test_pixels_at_the_end_of_such_a_frame_are_saturated_and_no_others() -> None:
    source = Cut({3: 3000, 5: 2900})
    ends = EarlyEnds(source, SENSOR)
    for shot in SHOTS[:7]:
        raw, seen = source.read(shot), ends.read(shot)
        limit = source.cut.get(shot.index)
        expected = raw if limit is None else np.where(raw >= limit, SENSOR.full_scale_dn, raw)
        assert (seen == expected).all()
        assert (ends.read_rows(shot, slice(7, 40)) == expected[7:40]).all()
    (told,) = ends.findings
    assert told.significant
    assert told.sentence.startswith("Values of frame 4, and of 1 other frame, end at 2900 DN or more")


def test_rows_tell_it_by_themselves_where_no_whole_frame_was_read() -> None:
    ends = EarlyEnds(Cut({3: 3000}), SENSOR)
    assert int(ends.read_rows(SHOTS[3], slice(5, 47)).max()) == SENSOR.full_scale_dn
    assert ends.findings == ()


def test_nothing_is_said_of_a_scan_without_such_frames() -> None:
    ends = EarlyEnds(Cut(), SENSOR)
    assert (ends.read(SHOTS[3]) == picture()).all()
    assert ends.findings == ()
