"""Light of a scan is measured by the exposures in force, which a camera may have rounded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.devices.base import DeviceRig
from dsl_core.io.scan.as_exposed import as_exposed
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.pipeline import scan
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.workflows.scans import reconstruct_scan
from tests.cases.rounding import Rounding

PLAN = CapturePlan(
    camera_size_px=(24, 16),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=0.4), Setting(exposure_ms=20.0, level=0.8)),
    code_settings=(0,),
)


def reader_of(folder: Path, in_force_ms: Callable[[int, float], float]) -> ScanReader:
    """A scan of `PLAN` whose frames had these exposures, by their shot's index and exposure."""
    with ScanWriter.create(folder, PLAN) as writer:
        for shot in PLAN.shots():
            pixels = np.full((16, 24), shot.index, np.uint16)
            exposure_ms = in_force_ms(shot.index, shot.exposure_ms)
            writer.write(shot, Frame(pixels, exposure_ms, 0.1 * shot.index, shot.index + 1))
    return ScanReader(folder)


def test_a_scan_that_was_exposed_as_planned_stays_as_it_is(tmp_path: Path) -> None:
    reader = reader_of(tmp_path / "a.dsl", lambda index, ms: 1.00005 * ms)
    assert as_exposed(reader) is reader


def test_the_median_of_each_setting_is_in_force(tmp_path: Path) -> None:
    reader = reader_of(tmp_path / "a.dsl", lambda index, ms: 10.4 if ms < 15 and index != 2 else ms)
    exposed = as_exposed(reader)
    assert [each.exposure_ms for each in exposed.plan.settings] == [10.4, 20.0]
    assert [each.level for each in exposed.plan.settings] == [0.4, 0.8]
    assert reader.plan == PLAN, "what was planned stays known"
    last = list(exposed.plan.shots())[-1]
    assert exposed.read(last)[0, 0] == last.index


def rounding_rig(longer: Callable[[float], float]) -> DeviceRig:
    rig = open_twin({"size": "48x32", "scene": "plane"})
    return replace(rig, camera=Rounding(rig.camera, longer))


def test_reflectance_does_not_follow_exposures_that_were_rounded(tmp_path: Path) -> None:
    found = []
    for name, longer in (("a", lambda ms: 1.0), ("b", lambda ms: 1.045)):
        rig = rounding_rig(longer)
        plan = CapturePlan(
            code=GrayCode(rows=False),
            spectral=LineComb(step_px=4, period_px=64),
            settings=(Setting(exposure_ms=1000 / 3, level=0.4),),
            code_settings=(0,),
        )
        scan(rig, plan.sized(rig.camera.info, rig.projector.info), tmp_path / f"{name}.dsl")
        result = reconstruct_scan(tmp_path / f"{name}.dsl")
        found.append(result.reflectance.values)
    assert float(np.nanmedian(found[1] / found[0])) == pytest.approx(1.0, abs=0.01)
