"""The gain of a lens found from levels of surfaces, and not from what only looks like it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import relative_gain
from dsl_core.reconstruction.flat_field import (
    FlatFit,
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
