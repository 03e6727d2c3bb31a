"""The gain of a lens found from levels of surfaces, and not from what only looks like it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import relative_gain
from dsl_core.reconstruction import flat_field
from dsl_core.reconstruction.flat_field import (
    FlatFit,
    _smooth,
    flat_finding,
    own_flat_field,
    unsure_gain,
    with_flat_field,
)
from dsl_core.simulation.sim_devices import open_twin

Floats = NDArray[np.float64]


@pytest.fixture(scope="module")
def rig() -> Rig:
    found = open_twin({"size": "112x72"}).calibration
    assert found is not None
    return found


def scene(rig: Rig, change: Floats | float = 1.0) -> tuple[Floats, Floats]:
    """Levels of a checkered mosaic under uneven light, with noise, and the shading; some are unknown."""
    rng = np.random.default_rng(4)
    rows, columns = np.indices((rig.camera.height_px, rig.camera.width_px))
    shading = 1.2 - 0.003 * columns - 0.001 * rows
    colour = 1 + 0.5 * (rows % 2) + 0.3 * (columns % 2)
    material = rng.uniform(0.1, 0.9, (4, 5))[rows // 20, columns // 25]
    level = shading * colour * material * change * (1 + 0.005 * rng.standard_normal(shading.shape))
    shading[30:33] = np.nan
    return level, shading


def square(rig: Rig) -> Floats:
    rows, columns = np.indices((rig.camera.height_px, rig.camera.width_px))
    found = (rows - rig.camera.cy_px) ** 2 + (columns - rig.camera.cx_px) ** 2
    return np.asarray(found / found.max())


def test_a_lens_that_loses_light_in_the_corners_is_measured_and_followed(rig: Rig) -> None:
    true = 1 - 0.08 * square(rig)
    found = own_flat_field(rig, *scene(rig, true))
    assert found is not None
    assert found.present
    followed = with_flat_field(rig, found)
    assert relative_gain(followed) == pytest.approx(true, abs=0.006)
    assert (np.abs(relative_gain(followed) - true) < 2 * unsure_gain(rig, found) + 0.002).all()
    # Seen with the rig that follows, nothing is left; more of the same comes on top.
    level, shading = scene(rig, true)
    again = own_flat_field(followed, level, shading * relative_gain(followed))
    assert again is not None
    assert not again.present
    assert relative_gain(with_flat_field(followed, found)) == pytest.approx(true**2, abs=0.012)
    assert "-8." in flat_finding(found).sentence or "-7." in flat_finding(found).sentence


def test_noise_of_the_shading_hides_no_gain_and_makes_none(rig: Rig) -> None:
    # Light falls off to the corners as gain does: its noise must not count as an error that goes with it.
    light = 1 - 0.2 * square(rig)
    for loss in (0.0, 0.08):
        level, shading = scene(rig, light * (1 - loss * square(rig)))
        rough = shading * light * (1 + 0.02 * np.random.default_rng(8).standard_normal(shading.shape))
        found = own_flat_field(rig, level, rough)
        assert found is not None
        assert found.present == (loss > 0)
        for corner in (found.corner, found.beside_shading[0]):
            assert corner == pytest.approx(np.log(1 - loss), abs=0.02)


def test_a_ball_with_noisy_normals_in_the_middle_is_no_lens_that_loses_light(rig: Rig) -> None:
    ball = np.sqrt(1 - 0.9 * square(rig))
    level, shading = scene(rig, ball)
    noise = 1 + 0.1 * np.random.default_rng(9).standard_normal(shading.shape)
    found = own_flat_field(rig, level, shading * ball * noise)
    assert found is not None
    assert not found.present
    assert abs(found.corner) < 0.02


def test_an_even_camera_and_light_from_one_side_are_left_alone(rig: Rig) -> None:
    columns = np.linspace(-1, 1, rig.camera.width_px)[None]
    for change in (1.0, 1 + 0.06 * columns, 1 - 0.08 * np.where(columns > 0, columns, 0) ** 2):
        found = own_flat_field(rig, *scene(rig, change))
        assert found is not None
        assert not found.present


def test_a_wrong_shading_is_no_gain() -> None:
    def beside(left: float, std: float) -> bool:
        return FlatFit(-0.08, 0.002, (-0.08, -0.081, -0.079, -0.08), (left, std)).present

    assert beside(-0.085, 0.004)
    assert not beside(-0.01, 0.004)
    assert not beside(-0.08, 0.06)
    assert not FlatFit(-0.08, 0.002, (-0.16, -0.15, 0.01, -0.02), (-0.08, 0.004)).present


def test_too_few_pixels_say_nothing(rig: Rig) -> None:
    level, shading = scene(rig)
    shading[:, 40:] = np.nan
    assert own_flat_field(rig, level, shading) is None


@pytest.mark.parametrize(("pairs", "stride"), [(30_000, 1), (800, 3)])
def test_pixels_a_nineteenth_of_the_width_apart_are_compared(
    rig: Rig, pairs: int, stride: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flat_field, "PAIRS", pairs)
    level, shading = scene(rig)
    height, width = shading.shape
    assert (height, width) == (72, 112)
    far, look = square(rig), np.log(level / shading)
    smooth = flat_field._smooth(np.log(shading), 6)
    wanted = []
    for down, across in ((0, 6), (6, 0)):
        for y in range(0, height - down, stride):
            for x in range(0, width - across, stride):
                here, there = (y, x), (y + down, x + across)
                step, light = look[there] - look[here], np.log(shading[there] / shading[here])
                if abs(step) < 0.06 and abs(light) < 0.1:
                    quarter, light = (
                        2 * (y + down / 2 > 36) + (x + across / 2 > 56),
                        smooth[there] - smooth[here],
                    )
                    wanted.append((step, far[there] - far[here], light, quarter))
    found = flat_field._pairs(rig, level, shading)
    assert len(wanted) > 500
    for got, values in zip(found, zip(*wanted, strict=True), strict=True):
        assert got == pytest.approx(np.array(values), abs=1e-12)


FOUND = FlatFit(-0.08, 0.002, (-0.08, -0.081, -0.079, -0.08), (-0.08, 0.004))


@pytest.mark.parametrize(
    ("change", "present"),
    [
        ({}, True), ({"corner_std": 0.0134}, False), ({"corner_std": 0.0132}, True),
        ({"quarters": (-0.1, -0.1, -0.0605, -0.0605)}, True),
        ({"quarters": (-0.1, -0.1, -0.059, -0.059)}, False),
        ({"beside_shading": (-0.041, 0.004)}, True), ({"beside_shading": (-0.039, 0.004)}, False),
        ({"beside_shading": (-0.08, 0.026)}, True), ({"beside_shading": (-0.08, 0.027)}, False),
    ],
)  # fmt: skip
def test_a_gain_is_one_that_all_quarters_and_shading_agree_about(
    change: dict[str, Any], present: bool
) -> None:
    assert replace(FOUND, **change).present == present


def test_a_gain_matters_from_one_and_a_half_per_cent_on() -> None:
    for corner, present in ((-0.0151, True), (0.0151, True), (-0.0149, False)):
        assert FlatFit(corner, 1e-4, (corner,) * 4, (corner, 1e-4)).present == present
    finding = flat_finding(FOUND)
    assert finding.value == pytest.approx(np.exp(-0.08) - 1)
    assert (finding.std, finding.limit, finding.significant) == (0.002, 0.015, True)


def test_the_gain_falls_with_the_square_of_the_distance_and_is_unsure_by_its_form(rig: Rig) -> None:
    assert unsure_gain(rig, FOUND) == pytest.approx(square(rig) * np.hypot(0.002, 0.15 * 0.08))
    field = with_flat_field(rig, FOUND).flat_field
    assert field is not None
    assert (len(field.rows_px), len(field.columns_px)) == (17, 25)
    assert (field.rows_px[0], field.rows_px[-1], field.columns_px[-1]) == (0.0, 71.0, 111.0)
    assert np.min(field.gain) == pytest.approx(np.exp(-0.08))


@pytest.mark.parametrize(("pixels", "told"), [(200, True), (199, False)])
def test_two_hundred_pairs_tell_a_slope(pixels: int, told: bool) -> None:
    rng = np.random.default_rng(1)
    cause, other = rng.normal(size=(2, pixels))
    level = 0.3 * cause - 0.2 * other + 0.001 * rng.normal(size=pixels)
    found = flat_field._slope(level, cause, other)
    assert (found is not None) == told
    if found is not None:
        assert found[0] == pytest.approx(0.3, abs=5 * found[1])
        assert found[1] == pytest.approx(0.001 / np.sqrt(pixels), rel=0.3)


def test_pixels_that_nobody_knows_do_not_darken_those_around_them() -> None:
    values = np.full((9, 11), 0.8)
    values[2:5, 3:7] = np.nan
    smooth = _smooth(values, 4)
    np.testing.assert_allclose(smooth[np.isfinite(values)], 0.8)
    assert np.isnan(smooth[np.isnan(values)]).all()
