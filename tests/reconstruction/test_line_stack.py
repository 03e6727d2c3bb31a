"""Deviations of line frames in as few bits as hold them."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting
from dsl_core.reconstruction.hdr import setting_gains_ms
from dsl_core.reconstruction.rows.bands import bands_of
from dsl_core.reconstruction.rows.frames import ScanFrames
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
    bands = bands_of(plan)
    stack = ScanFrames(MemoryScan(plan, frames), published_rig(), bands).lines(bands[0])
    gain_ms = setting_gains_ms(plan.settings, published_rig().projector_response)[0]
    std = stack.std
    assert std.dtype.itemsize * 8 == bits
    noise_dn = np.sqrt(sensor.read_noise_dn**2 + 1 / 12 + 1000 / sensor.electrons_per_dn)
    assert stack.radiance * gain_ms == pytest.approx(1000, rel=1e-3)
    assert std.astype(float) * gain_ms == pytest.approx(noise_dn, rel=1e-3)
