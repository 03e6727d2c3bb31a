"""Gain is in doubt beyond a small target, unless the projector does not light that part of the picture."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.beyond_target import unsure_gain
from dsl_core.calibration.light.spectralon import fit_evenness
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.sensor import gain_at_pixels
from dsl_core.optics.shading import Plane
from dsl_core.simulation.published_rig import published_rig

ROWS, COLUMNS = 72, 112
PLANE = Plane(np.array([0.0, 0.0, 1 / 700.0]))


def _rig() -> Rig:
    rig = published_rig()
    return rig.model_copy(update={"camera": rig.camera.resized(COLUMNS, ROWS)})


def _of_target(share: float, seed: int = 0) -> tuple[float, float]:
    """Stated and true deviation, largest, of a flat field by a target that fills a share of the width."""
    y, x = np.mgrid[-1 : 1 : ROWS * 1j, -1 : 1 : COLUMNS * 1j]
    true = 1 - 0.05 * (x**2 + y**2)
    seen = true * (1 + 0.004 * np.random.default_rng(seed).standard_normal(true.shape))
    usable = (np.abs(x) < share) & (np.abs(y) < share)
    found = fit_evenness(np.where(usable, seen, np.nan), usable)
    gain = gain_at_pixels(found.flat_field, ROWS, COLUMNS)
    level = float((gain / true)[usable].mean())
    off = np.abs(gain / true / level - 1)
    return unsure_gain(_rig(), PLANE, found.flat_field, found.std), float(off.max())


def test_a_target_that_fills_the_picture_leaves_nothing_open() -> None:
    stated, off = _of_target(1.0)
    assert off < 0.01
    assert stated < 0.01


@pytest.mark.parametrize("seed", range(3))
def test_one_that_fills_half_of_it_does(seed: int) -> None:
    stated, off = _of_target(0.5, seed)
    assert stated > 0.02
    assert off < 4 * stated


def test_what_the_projector_does_not_light_does_not_count() -> None:
    rig = _rig()
    flat = fit_evenness(np.ones((ROWS, COLUMNS)), np.ones((ROWS, COLUMNS), bool)).flat_field
    std = np.full((9, 13), 0.001)
    std[:, 0] = 0.5
    doubtful = tuple(map(tuple, std.tolist()))
    left = float(pixel_rays(rig.camera)[0, ROWS // 2, COLUMNS // 12])
    assert unsure_gain(rig, PLANE, flat, doubtful) > 0.1
    # A projector whose picture begins right of the doubtful nodes, as seen on this plane.
    centre = rig.pose.matrix @ np.array([left * 700, 0.0, 700.0]) + rig.pose.vector_mm
    start = rig.projector.fx_px * centre[0] / centre[2]
    narrow = rig.projector.model_copy(update={"cx_px": -float(start) - 60.0, "distortion": (0.0,) * 5})
    narrow_rig = rig.model_copy(update={"projector": narrow})
    assert unsure_gain(narrow_rig, PLANE, flat, doubtful) < 0.01
