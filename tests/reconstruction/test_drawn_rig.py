"""A rig that is not the published one, whose truth is known: its vignetting does not reach reflectance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.sensor import relative_gain
from dsl_core.simulation.sim_devices import SimCamera, open_twin
from tests.cases.twin_scan import MemoryScan, capture

GRID = WavelengthGrid(step_nm=10.0)
PLAN = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))
REFLECTANCE = 0.6


def scan(vignetting: bool) -> tuple[Rig, MemoryScan]:
    """A grey plane seen by a drawn rig, with or without its vignetting, and that rig."""
    devices = open_twin(
        {"size": "112x72", "scene": "plane", "reflectance": str(REFLECTANCE), "truth": "3", "noise": "off"}
    )
    assert isinstance(devices.camera, SimCamera)
    world = devices.camera.world
    if not vignetting:
        even = world.rig.model_copy(update={"flat_field": None})
        world.setup = replace(world.setup, rig=even)
    return world.rig, capture(devices, PLAN)


def relative_reflectance(rig: Rig, frames: MemoryScan, as_calibrated: bool = False) -> np.ndarray:
    """Mean reflectance of every pixel over the truth; NaN where it is unknown."""
    options = pipeline.Options(grid=GRID, as_calibrated=as_calibrated)
    result = pipeline.reconstruct(frames, rig, options)
    return np.asarray(result["reflectance"].values[3:-3].mean(0) / REFLECTANCE)


@pytest.mark.slow
def test_the_true_calibration_leaves_no_vignetting() -> None:
    rig, frames = scan(vignetting=True)
    known = relative_reflectance(rig, frames)
    unknown = rig.model_copy(update={"flat_field": None})
    blind, found = (relative_reflectance(unknown, frames, left) for left in (True, False))
    even = relative_reflectance(*scan(vignetting=False))
    seen = np.isfinite(known) & np.isfinite(blind) & np.isfinite(even) & np.isfinite(found)
    gain = relative_gain(rig)[seen] - 1
    assert seen.mean() > 0.5
    assert np.ptp(gain) > 0.04
    # Pixels of a camera this coarse differ by more than the gain; beside an even camera only it is left.
    assert abs(np.polyfit(gain, (known / even)[seen], 1)[0]) < 0.05
    assert abs(np.polyfit(gain, (blind / even)[seen], 1)[0] - 1) < 0.05
    # On a plane the scan itself shows what the calibration does not know.
    assert abs(np.polyfit(gain, (found / even)[seen], 1)[0]) < 0.1
    assert abs(np.median(known[seen]) - 1) < 0.01
