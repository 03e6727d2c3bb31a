"""Stripes of a code that are softer than projector and pixels make them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from dsl_core.capture.proof.lasting.soft_stripes import SoftStripes, soft_stripes, usual_blur
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.plan import GrayCode
from dsl_core.model.rig import Rig, Sensor
from dsl_core.patterns.binary_code import binary_image
from dsl_core.simulation.published_rig import published_rig

SENSOR = Sensor()
CODE, ROWS = GrayCode(rows=False), 40


@pytest.fixture(scope="module")
def rig() -> Rig:
    return published_rig()


def found(
    rig: Rig, blur: float, *, own: float = 1.0, soft: float = 0.0, level: float = 1500.0
) -> SoftStripes | None:
    """With a blur of so many columns; ``own`` of the light is not spread widely.

    A ``soft`` share of the picture has ten times the blur.
    """
    size = rig.projector.width_px, rig.projector.height_px
    raster, rng = Raster((size[0], ROWS)), np.random.default_rng(2)
    surface = level * rng.uniform(0.5, 1.0, (ROWS, size[0]))
    black = SENSOR.black_level_dn * np.ones_like(surface)

    def seen(light: np.ndarray) -> np.ndarray:
        picture = black + surface * light + rng.normal(0, 3, surface.shape)
        return raster.take(np.rint(np.maximum(picture, 0)).astype(np.uint16))

    def blurred(row: np.ndarray) -> np.ndarray:
        sharp, wide = (gaussian_filter1d(row, width, mode="nearest") for width in (blur, 10 * blur))
        rows = np.tile(own * sharp + (1 - own) * row.mean(), (ROWS, 1))
        rows[:, : int(soft * size[0])] = wide[: int(soft * size[0])]
        return rows

    pairs = {}
    for number in range(10):
        pattern = (binary_image(CODE, size, 2 * number)[0] > 0).astype(np.float64)
        pairs[number] = seen(blurred(pattern)), seen(blurred(1 - pattern))
    ends = seen(np.ones_like(surface)), seen(np.zeros_like(surface))
    return soft_stripes(CODE, pairs, ends, rig, Noise.of(SENSOR, SENSOR.bit_depth), raster)


@pytest.mark.parametrize("blur", [2.0, 4.0, 8.0])
def test_a_lens_out_of_focus_is_told_with_the_width_of_its_blur(rig: Rig, blur: float) -> None:
    said = found(rig, blur)
    assert said is not None
    assert said.blur == pytest.approx(blur, rel=0.2)
    assert f"blurred by about {said.blur:.1f} columns" in said.sentence
    assert f"{usual_blur(rig):.1f} are usual" in said.sentence


def test_what_projector_and_pixels_blur_is_usual(rig: Rig) -> None:
    assert found(rig, usual_blur(rig)) is None
    # Orders of the film, and surfaces that light each other, spread a share of all stripes alike.
    assert found(rig, usual_blur(rig), own=0.7) is None
    # Half of what is in view is translucent.
    assert found(rig, usual_blur(rig), soft=0.5) is None


def test_what_is_hardly_lit_says_nothing(rig: Rig) -> None:
    assert found(rig, 12.0, level=20.0) is None
