"""Edges of a code that are brighter than white, which only sharpening makes them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from dsl_core.capture.proof.lasting.sharp_edges import sharp_edges
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import GrayCode
from dsl_core.model.rig import Sensor
from dsl_core.patterns.binary_code import binary_image

SIZE, ROWS = (256, 36), 40
CODE = GrayCode(rows=False)
DEEP = Sensor()
SHALLOW = Sensor(bit_depth=8, black_level_dn=4, electrons_per_dn=40, read_noise_dn=0.5)


def said_of(
    sensor: Sensor, sharpened: float, *, code_light: float = 1.0, shaded: float = 1.0, orders: float = 0.0,
    is_portrait: bool = False,
) -> str:  # fmt: skip
    """Of a camera that sharpens by so much, where the code has other light than white.

    A quarter of white was ``shaded``; the film displaces a share of all light by some ``orders``.
    """
    raster = Raster((ROWS, SIZE[0]) if is_portrait else (SIZE[0], ROWS))
    rng = np.random.default_rng(3)
    surface = 0.5 * sensor.full_scale_dn * rng.uniform(0.6, 1.0, (ROWS, SIZE[0]))

    def seen(light: np.ndarray) -> Counts:
        row = gaussian_filter1d(light, 0.8, mode="nearest")
        row = (1 - 2 * orders) * row + orders * (np.roll(row, 15) + np.roll(row, -15))
        counts = surface * row
        counts += rng.normal(0, np.sqrt(sensor.read_noise_dn**2 + counts / sensor.electrons_per_dn))
        counts += sharpened * (counts - gaussian_filter1d(counts, 1.5, axis=1, mode="nearest"))
        counts = np.rint(sensor.black_level_dn + counts).clip(0, sensor.full_scale_dn)
        taken = counts.astype(np.uint16)
        return raster.take(taken.T if is_portrait else taken)

    pairs = {}
    for number in range(7):
        pattern = (binary_image(CODE, SIZE, 2 * number)[0] > 0).astype(np.float64)
        pairs[number] = seen(code_light * pattern), seen(code_light * (1 - pattern))
    white = np.ones(SIZE[0])
    white[:64] *= shaded
    ends = seen(white), seen(np.zeros(SIZE[0]))
    return sharp_edges(pairs, ends, Noise.of(sensor, sensor.bit_depth), raster)


@pytest.mark.parametrize("sensor", [DEEP, SHALLOW])
@pytest.mark.parametrize("sharpened", [0.5, 1.0])
def test_edges_brighter_than_white_are_sharpened(sensor: Sensor, sharpened: float) -> None:
    assert "sharpens its picture" in said_of(sensor, sharpened)
    assert "sharpens its picture" in said_of(sensor, 2 * sharpened, code_light=0.8)


@pytest.mark.parametrize("sensor", [DEEP, SHALLOW])
def test_edges_of_a_camera_in_portrait_are_looked_at_down_its_picture(sensor: Sensor) -> None:
    assert "sharpens its picture" in said_of(sensor, 0.5, is_portrait=True)
    assert said_of(sensor, 0.0, is_portrait=True) == said_of(sensor, 0.0, orders=0.1, is_portrait=True) == ""


@pytest.mark.parametrize("sensor", [DEEP, SHALLOW])
def test_neither_sound_edges_nor_light_that_changed_are_sharpened(sensor: Sensor) -> None:
    assert said_of(sensor, 0.0) == said_of(sensor, 0.0, orders=0.1) == ""
    assert said_of(sensor, 0.0, code_light=1.2) == said_of(sensor, 0.0, shaded=0.5) == ""
