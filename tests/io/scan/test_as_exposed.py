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
from dsl_core.model.frames import Frame, read_rows
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.model.presets import preset_plan
from dsl_core.model.rig import Sensor
from dsl_core.pipeline import fit_plan, scan
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.workflows.scans import known_doubts, reconstruct_scan, resume
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


def test_frames_that_were_exposed_otherwise_are_read_with_the_light_of_the_others(tmp_path: Path) -> None:
    reader = reader_of(tmp_path / "a.dsl", lambda index, ms: 1.03 * ms if index in (18, 19) else ms)
    exposed = as_exposed(reader, Sensor(black_level_dn=0.0, bit_depth=8))
    assert exposed.plan == PLAN
    for shot in PLAN.shots():
        wanted = round(shot.index / 1.03) if shot.index in (18, 19) else shot.index
        out = np.empty((16, 24), np.uint16)
        assert exposed.read(shot, out) is out
        assert {*out.ravel(), *read_rows(exposed, shot, slice(2, 4)).ravel()} == {wanted}
    assert as_exposed(reader) is reader, "black is not known"


class Uneven(Rounding):
    """Exposes each frame for another time, and says so."""

    def configure(self, exposure_ms: float) -> float:
        self.wanted_ms = exposure_ms
        return exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        self.camera.configure(self.longer(self.wanted_ms) * self.wanted_ms)
        return self.camera.snap(timeout_ms)


def test_exposures_that_differ_from_frame_to_frame_are_no_light_that_does(tmp_path: Path) -> None:
    shares = np.random.default_rng(1).uniform(0.955, 1.045, 1000).tolist()
    rig = open_twin({"size": "48x32", "scene": "plane", "noise": "on"})
    rig = replace(rig, camera=Uneven(rig.camera, lambda ms: shares.pop()))
    plan = preset_plan("quick")
    assert plan is not None
    status = scan(rig, fit_plan(plan, rig), tmp_path / "a.dsl")
    assert status.corrected == 0
    assert known_doubts(tmp_path / "a.dsl") == []


def test_a_scan_is_resumed_by_a_camera_that_rounds_exposures_otherwise(tmp_path: Path) -> None:
    rig, plan, left = (
        open_twin({"size": "48x32", "noise": "on", "brightness": "0.3"}),
        preset_plan("quick"),
        20,
    )
    assert plan is not None

    def first(wanted_ms: float) -> float:
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt
        return 1.0

    with pytest.raises(KeyboardInterrupt):
        scan(replace(rig, camera=Uneven(rig.camera, first)), fit_plan(plan, rig), tmp_path / "a.dsl")
    assert 0 < len(ScanReader(tmp_path / "a.dsl").missing()) < plan.shot_count
    status = resume(replace(rig, camera=Uneven(rig.camera, lambda ms: 1.04)), tmp_path / "a.dsl")
    assert status.corrected == 0
    assert known_doubts(tmp_path / "a.dsl") == []


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
