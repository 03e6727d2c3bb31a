"""The camera's noise is what is stated; its gain is bilinear, and divided out of what is measured."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from dsl_core.model.rig import FlatField, Rig, Sensor
from dsl_core.optics.sensor import (
    EVEN,
    as_if_exposed,
    digitise,
    end_near_full,
    gain_at_pixels,
    raw_variance,
    relative_gain,
)
from dsl_core.reconstruction.surface import reconstruct_surface
from dsl_core.simulation.published_rig import published_rig

SIZE = (45, 31)
FIELD = FlatField(rows_px=(5.0, 25.0), columns_px=(0.0, 20.0, 44.0), gain=((0.8, 1.0, 0.9), (1.0, 1.2, 0.7)))


def rig(field: FlatField | None) -> Rig:
    full = published_rig()
    return full.model_copy(update={"camera": full.camera.resized(*SIZE), "flat_field": field})


@pytest.mark.parametrize("signal_dn", [0.0, 40.0, 2000.0])
def test_raw_values_have_the_stated_mean_and_variance(signal_dn: float) -> None:
    sensor = published_rig().sensor
    expected = np.full(200_000, signal_dn, np.float32)
    values = digitise(sensor, expected, np.random.default_rng(0)).astype(float)
    assert values.mean() == pytest.approx(sensor.black_level_dn + signal_dn, abs=0.5)
    # A deviation of 0.3 % is what so many samples leave.
    assert values.var() == pytest.approx(float(raw_variance(sensor, np.array(signal_dn))), rel=0.015)


@pytest.mark.parametrize("step_dn", [16, 64])
def test_sensors_with_steps_have_no_values_between_and_the_stated_variance(step_dn: int) -> None:
    sensor = Sensor(bit_depth=16, black_level_dn=4160, step_dn=step_dn, electrons_per_dn=1, read_noise_dn=30)
    values = digitise(sensor, np.full(200_000, 2010, np.float32), np.random.default_rng(0))
    assert not (values % step_dn).any()
    assert values.var() == pytest.approx(float(raw_variance(sensor, np.array(2010.0))), rel=0.015)
    assert digitise(sensor, np.array([1e5], np.float32), None) == sensor.full_scale_dn


def test_values_without_noise_are_rounded_and_end_at_full_scale() -> None:
    sensor = published_rig().sensor
    black, full = sensor.black_level_dn, sensor.full_scale_dn
    signal = np.array([-2 * black, 0.4, 0.6, 2 * full], np.float32)
    assert digitise(sensor, signal, None).tolist() == [0, black, black + 1, full]


def test_gain_is_bilinear_between_nodes_and_constant_outside() -> None:
    gain = relative_gain(rig(FIELD))
    assert gain.shape == SIZE[::-1]
    assert gain[5, 20] == pytest.approx(1.0)
    assert gain[25, 44] == pytest.approx(0.7)
    assert gain[15, 10] == pytest.approx((0.8 + 1.0 + 1.0 + 1.2) / 4)
    assert gain[0, 0] == pytest.approx(gain[5, 0])
    assert gain[30, 32] == pytest.approx(gain[25, 32])
    assert not gain.flags.writeable


def test_a_rig_without_flat_field_sees_evenly() -> None:
    assert np.broadcast_to(relative_gain(rig(None)), SIZE).min() == 1.0


def test_gain_belongs_to_the_shading_of_a_surface() -> None:
    depth = np.full(SIZE[::-1], 700.0)
    even, uneven = (reconstruct_surface(rig(f), depth, np.full_like(depth, 0.1)) for f in (None, FIELD))
    ratio = uneven.shading / even.shading
    assert np.isfinite(ratio).mean() > 0.9
    assert np.nanmax(np.abs(ratio - relative_gain(rig(FIELD)))) < 1e-12
    assert uneven.shading_rel_std == pytest.approx(even.shading_rel_std, nan_ok=True)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"gain": ((1.0, 1.0, 1.0),)}, "2 rows of 3"),
        ({"gain": ((1.0, 1.0, 1.0), (1.0, 0.0, 1.0))}, "above zero"),
        ({"rows_px": (5.0, 5.0)}, "rise strictly"),
        ({"columns_px": ()}, "at least one"),
    ],
)
def test_impossible_flat_fields_are_refused(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        FlatField.model_validate(FIELD.model_dump() | changed)


def test_a_rig_with_flat_field_survives_json() -> None:
    there = rig(FIELD)
    assert Rig.model_validate_json(there.model_dump_json()) == there


def test_gain_is_bilinear_between_nodes_and_cannot_be_written_to() -> None:
    field = FlatField(rows_px=(0.0, 4.0), columns_px=(0.0, 2.0, 8.0), gain=((1.0, 1.2, 0.8), (1.4, 1.0, 0.6)))
    gain = gain_at_pixels(field, 5, 9)
    assert gain.shape == (5, 9)
    assert not gain.flags.writeable
    assert gain[0, [0, 1, 2, 5, 8]] == pytest.approx([1.0, 1.1, 1.2, 1.0, 0.8])
    assert gain[:, 2] == pytest.approx([1.2, 1.15, 1.1, 1.05, 1.0])
    assert gain[1, 5] == pytest.approx(0.75 * 1.0 + 0.25 * 0.8)


def test_shot_noise_starts_at_black() -> None:
    sensor = Sensor(read_noise_dn=2.0, electrons_per_dn=8.0)
    found = raw_variance(sensor, np.array([-50.0, 0.0, 16.0]))
    assert found == pytest.approx([4 + 1 / 12, 4 + 1 / 12, 6 + 1 / 12])


@pytest.mark.parametrize(
    ("step_dn", "read_noise_dn", "rounds"),
    [(1, 0.5, False), (1, 0.1, True), (16, 0.5, True), (16, 4.5, True), (16, 4.7, False)],
)
def test_light_is_rounded_where_noise_is_smaller_than_that_of_steps(
    step_dn: int, read_noise_dn: float, rounds: bool
) -> None:
    assert Sensor(step_dn=step_dn, read_noise_dn=read_noise_dn).rounds_light == rounds


@pytest.mark.parametrize(
    ("bits", "ends_dn"), [(8, 250), (12, 4094), (12, 4080), (12, 3700), (14, 16380), (16, 65520)]
)
def test_values_end_where_bright_pixels_pile_up_just_below_full_scale(bits: int, ends_dn: int) -> None:
    full_dn = 2**bits - 1
    sensor = Sensor(
        bit_depth=bits,
        black_level_dn=20.0,
        electrons_per_dn=10 * 2.0 ** (12 - bits),
        saturation_dn=ends_dn,
    )
    light = np.tile(np.linspace(0.0, 1.3 * full_dn, 200, dtype=np.float32), (50, 1))
    values = digitise(sensor, light, np.random.default_rng(0))
    assert end_near_full(values, full_dn, np.zeros_like(values)) == ends_dn
    values[0, :2] = full_dn
    assert end_near_full(values, full_dn, np.zeros_like(values)) == ends_dn, "hot pixels are no light"


@pytest.mark.parametrize(("light", "ends_dn"), [(0.97, 4095), (1.5, 4095), (1.5, 3000)])
def test_neither_noise_nor_full_scale_nor_what_cuts_values_off_is_such_an_end(
    light: float, ends_dn: int
) -> None:
    sensor = Sensor(black_level_dn=0.0, saturation_dn=ends_dn)
    values = digitise(sensor, np.full((60, 90), light * 4095, np.float32), np.random.default_rng(0))
    assert end_near_full(values, 4095, np.zeros_like(values)) == 4095


@pytest.mark.parametrize("share", [0.95, 1.05])
@pytest.mark.parametrize("ends_dn", [4095, 4080])
def test_light_follows_the_exposure_and_values_end_where_they_did(share: float, ends_dn: int) -> None:
    sensor, rng = Sensor(black_level_dn=100.0), np.random.default_rng(0)
    light = np.linspace(0.0, 6000.0, 40_000).reshape(200, 200)
    pixels = np.clip(100 + light + rng.normal(0, 5, light.shape), 0, ends_dn).round().astype(np.uint16)
    found = as_if_exposed(pixels, share, sensor)
    assert found.dtype == np.uint16
    assert np.all(found[pixels == ends_dn] == ends_dn)
    assert found.max() == ends_dn
    below = light < 0.94 * (ends_dn - 100)
    np.testing.assert_allclose(found[below], 100 + share * (pixels[below] - 100.0), atol=0.51)
    assert as_if_exposed(pixels, 1 + 0.9 * EVEN * np.sign(share - 1), sensor) is pixels
