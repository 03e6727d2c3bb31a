"""Lenses and pose that moved show as smooth residuals; rounding and noise do not."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.calibration.common.plane import TargetPlane
from dsl_core.calibration.drift.geometry import LIMIT_PX, geometry_drift, smooth_part
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig

KNOWN = np.ones((104, 160), bool)
ROW, COLUMN = (axis.ravel() for axis in np.mgrid[:104, :160])


def test_the_smooth_part_is_what_a_quadratic_explains() -> None:
    x, y = 2 * COLUMN / 160 - 1, 2 * ROW / 104 - 1
    bend = 0.2 + 0.1 * x - 0.15 * x * y + 0.3 * y**2
    noise = 0.3 * np.random.default_rng(1).standard_normal(bend.size)
    rms, std = smooth_part(bend + noise, KNOWN)
    assert rms == pytest.approx(np.sqrt(np.mean(bend**2)), rel=0.03)
    assert std < 0.01


def test_noise_alone_leaves_no_more_than_its_deviation() -> None:
    rng, left = np.random.default_rng(2), []
    for _ in range(20):
        rms, std = smooth_part(0.3 * rng.standard_normal(KNOWN.size), KNOWN)
        # Six terms of so many pixels hold this much of the noise.
        assert std == pytest.approx(0.3 * np.sqrt(6 / KNOWN.size), rel=0.15)
        left.append(rms / std)
    assert np.mean(np.array(left) < 1) > 0.7


@pytest.mark.parametrize(
    ("off", "name"), [((0.0, 0.4), "row drift"), ((0.4, 0.0), "column drift on a plane")]
)
def test_each_direction_has_a_figure(off: tuple[float, float], name: str) -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(160, 104)})
    plane = Plane(np.array([0.05, 0.1, 1.0]) / 720.0)
    depth = plane.depth_mm(rig)
    column, row = (
        part.numpy().reshape(depth.shape)
        for part in zero_order(rig, torch.arange(depth.size), torch.as_tensor(depth.ravel()))
    )
    figures = geometry_drift(rig, column + off[0], row + off[1], depth, TargetPlane(plane, KNOWN, 0.1))
    by_name = {figure.name: figure for figure in figures}
    assert by_name.pop(name).value == pytest.approx(0.4, abs=1e-6)
    assert all(figure.passed and figure.value < 1e-6 for figure in by_name.values())
    assert all(figure.high == LIMIT_PX and figure.advice for figure in figures)
