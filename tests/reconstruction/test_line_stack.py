"""Deviations of line frames in as few bits as hold them."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting
from dsl_core.reconstruction.merge import MergedScan, stack_lines
from dsl_core.simulation.published_rig import published_rig
from tests.cases.twin_scan import MemoryScan


@pytest.mark.parametrize(("exposure_ms", "bits"), [(300.0, 16), (1e-5, 32), (1e7, 32)])
def test_deviations_survive_any_exposure(exposure_ms: float, bits: int) -> None:
    plan = CapturePlan(
        camera_size_px=(4, 2),
        code=GrayCode(rows=False),
        spectral=ScanLines(step_px=100),
        settings=(Setting(exposure_ms=exposure_ms, level=1.0),),
        code_settings=(0,),
    )
    sensor = published_rig().sensor
    levels = {"black": sensor.black_level_dn, "spectral": sensor.black_level_dn + 1000}
    frames = tuple(np.full((2, 4), levels.get(shot.role, 0), np.uint16) for shot in plan.shots())
    std = stack_lines(MergedScan(MemoryScan(plan, frames), published_rig())).std
    assert std.dtype.itemsize * 8 == bits
    noise_dn = np.sqrt(sensor.read_noise_dn**2 + 1 / 12 + 1000 / sensor.electrons_per_dn)
    assert std.astype(float) * exposure_ms == pytest.approx(noise_dn, rel=1e-3)
