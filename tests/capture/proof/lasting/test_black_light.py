"""What is as bright in black as in white, where an object fills a small part of the picture."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.lasting.black_light import LitBlack, lit_black, room_light
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.rig import Sensor

SIZE, OBJECT, POINTER = (160, 96), np.s_[20:50, 60:100], np.s_[4:7, 8:11]
RASTER = Raster(SIZE)
CALIBRATED = Sensor(black_level_dn=260.0, read_noise_dn=0.5)


def taken_of(object_dn: float, pointer_dn: float = 0.0, room: float = 5e-4) -> tuple[Counts, Counts]:
    """White and black of an object before nothing, from a camera with a black level of 260 DN."""
    rng = np.random.default_rng(3)

    def taken(light: float) -> Counts:
        scene = np.zeros(SIZE[::-1])
        scene[OBJECT] = light * object_dn
        scene[POINTER] += pointer_dn
        noisy = 260 + scene + rng.standard_normal(scene.shape) * np.sqrt(0.25 + scene / 10)
        return RASTER.take(np.rint(noisy).clip(0, 4095).astype(np.uint16))

    return taken(1.0 + room), taken(room)


def found(object_dn: float, pointer_dn: float = 0.0, sensor: Sensor | None = CALIBRATED) -> LitBlack | None:
    """Of white and black of an object before nothing."""
    ends = taken_of(object_dn, pointer_dn)
    return lit_black(*ends, RASTER.channels("RGGB"), Noise.of(sensor, 12), RASTER, SIZE)


@pytest.mark.parametrize("sensor", [CALIBRATED, None])
@pytest.mark.parametrize("object_dn", [3000.0, 300.0, 30.0, 0.0])
def test_an_object_before_nothing_is_no_pointer(object_dn: float, sensor: Sensor | None) -> None:
    assert found(object_dn, sensor=sensor) is None


@pytest.mark.parametrize("sensor", [CALIBRATED, None])
@pytest.mark.parametrize("pointer_dn", [3000.0, 1e5])
def test_a_pointer_beside_it_is_told_with_its_place(pointer_dn: float, sensor: Sensor | None) -> None:
    seen = found(3000.0, pointer_dn, sensor)
    assert seen is not None
    assert (seen.count, seen.columns, seen.rows) == (9, (8, 11), (4, 7))


@pytest.mark.parametrize("sensor", [CALIBRATED, None])
@pytest.mark.parametrize(
    ("room", "told"), [(0.01, ""), (1.0, ""), (1.9, ""), (8.0, "gives 8 times the light")]
)
def test_a_bright_room_is_no_pointer(room: float, told: str, sensor: Sensor | None) -> None:
    white, black = taken_of(300.0, room=room)
    noise = Noise.of(sensor, 12)
    assert lit_black(white, black, RASTER.channels("RGGB"), noise, RASTER, SIZE) is None
    said = room_light(white, black, 0.2, noise)
    assert (told in said) if told else not said
    lower = room_light(white, black, 0.2, noise, is_highest=False)
    assert lower == said.replace(", or use settings of a higher level", "")


@pytest.mark.parametrize(
    ("beside_dn", "of_rows", "is_told"), [(60.0, 3, True), (0.0, 3, False), (60.0, 96, False)]
)
def test_a_pointer_of_few_pixels_is_told_from_hot_ones_by_its_first_orders(
    beside_dn: float, of_rows: int, is_told: bool
) -> None:
    shape = SIZE[::-1]
    light = np.full(shape, 1000.0)
    dark = np.full(shape, 10.0)
    dark[40 : 40 + of_rows, 50:110] += beside_dn
    dark[41, 80:82] += 4000.0
    rng = np.random.default_rng(4)
    white, black = (
        RASTER.take(np.rint(260 + each + 3 * rng.standard_normal(shape)).clip(0, 4095).astype(np.uint16))
        for each in (light + dark, dark)
    )
    seen = lit_black(white, black, RASTER.channels("RGGB"), Noise.of(CALIBRATED, 12), RASTER, SIZE)
    assert (seen is not None) == is_told
    if seen is not None:
        assert (seen.columns, seen.rows) == ((80, 82), (41, 42))
