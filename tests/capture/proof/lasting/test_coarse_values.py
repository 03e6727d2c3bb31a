"""Values that come in steps larger than a camera's noise are told, and smaller steps are not."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.lasting.coarse_values import coarse_values
from dsl_core.model.rig import Sensor


@pytest.mark.parametrize(
    ("bits_lost", "noise_dn", "is_told"), [(0, 0.5, False), (4, 1.0, True), (1, 1.0, False)]
)
def test_steps_larger_than_the_noise_hide_light(bits_lost: int, noise_dn: float, is_told: bool) -> None:
    light = np.random.default_rng(2).uniform(200, 3000, 20_000).astype(np.uint16)
    pictures = [(light >> bits_lost << bits_lost).astype(np.uint16)]
    said = coarse_values(pictures, Sensor(read_noise_dn=noise_dn))
    assert said.startswith("Values of the camera come in steps of 16 DN, as in pictures of 8 bits") is is_told
    assert bool(said) is is_told


def test_steps_that_a_calibration_knows_are_none_of_its_changes() -> None:
    light = np.random.default_rng(2).uniform(200, 3000, 20_000).astype(np.uint16)
    assert coarse_values([(light >> 4 << 4).astype(np.uint16)], Sensor(read_noise_dn=1.0, step_dn=16)) == ""


def test_values_beyond_the_bits_of_the_camera_are_counted_as_well() -> None:
    beyond = np.arange(0, 9000, 3, dtype=np.uint16)
    assert coarse_values([np.arange(100, dtype=np.uint16), beyond], Sensor(read_noise_dn=1.0)) == ""
