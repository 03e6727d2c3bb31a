"""Nothing is captured again or said of clean scans, whatever their patterns."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.capture.preflight import fit_plan
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.proof_file import read_proof
from dsl_core.model.frames import Frame
from dsl_core.model.presets import preset_plan
from dsl_core.pipeline import scan
from dsl_core.simulation.sim_devices import open_twin


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["preview", "comb", "coarse"])
def test_every_picture_of_a_white_wall_shows_its_pattern(preset: str, tmp_path: Path) -> None:
    plan = preset_plan(preset)
    assert plan is not None
    rig = open_twin({"size": "48x32", "scene": "plane"})
    status = scan(rig, fit_plan(plan, rig), tmp_path / "scan.dsl")
    assert status.corrected == 0
    assert status.message == f"All {status.total} frames are saved."
    reader = ScanReader(tmp_path / "scan.dsl")
    assert reader.calibration is not None
    found = read_proof(reader, reader.calibration)
    assert found is not None
    assert found.doubts == ()


def test_light_that_no_frame_shows_any_more_is_kept_with_the_scan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(FrameProof, "past", ("The light has settled.",))
    plan = preset_plan("preview")
    assert plan is not None
    rig = open_twin({"size": "48x32", "scene": "plane"})
    status = scan(rig, fit_plan(plan, rig), tmp_path / "scan.dsl")
    assert status.message.endswith(" The light has settled.")
    reader = ScanReader(tmp_path / "scan.dsl")
    assert reader.calibration is not None
    found = read_proof(reader, reader.calibration)
    assert found is not None
    assert found.doubts == ("The light has settled.",)


@pytest.mark.slow
def test_a_small_object_before_nothing_shows_its_patterns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """First orders of one line may reach all of it, so that none of its pixels tells what black is."""
    plan = preset_plan("coarse")
    assert plan is not None
    rig = open_twin({"size": "96x64", "scene": "plane"})
    snap, dark = rig.camera.snap, np.random.default_rng(1)

    def of_a_small_object(timeout_ms: float = 5000.0) -> Frame:
        seen = snap(timeout_ms)
        pixels = np.rint(260.0 + dark.standard_normal(seen.pixels.shape)).astype(np.uint16)
        pixels[20:44, 36:60] = seen.pixels[20:44, 36:60]
        return replace(seen, pixels=pixels)

    monkeypatch.setattr(rig.camera, "snap", of_a_small_object)
    status = scan(rig, fit_plan(plan, rig), tmp_path / "scan.dsl")
    assert status.corrected == 0
    assert status.message == f"All {status.total} frames are saved."


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["preview", "coarse"])
def test_a_camera_with_three_times_the_noise_stated_shows_its_patterns(
    preset: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = preset_plan(preset)
    assert plan is not None
    rig = open_twin({"size": "96x64", "scene": "color-checker"})
    assert rig.calibration is not None
    sensor, snap, random = rig.calibration.sensor, rig.camera.snap, np.random.default_rng(1)

    def with_more_noise(timeout_ms: float = 5000.0) -> Frame:
        seen = snap(timeout_ms)
        dn = seen.pixels.astype(np.float64)
        stated = np.maximum(dn - sensor.black_level_dn, 0) / sensor.electrons_per_dn + sensor.read_noise_dn**2
        more = np.sqrt(8 * stated) * random.standard_normal(dn.shape)
        pixels = np.where(dn < sensor.full_scale_dn, np.rint(dn + more), dn).clip(0, sensor.full_scale_dn)
        return replace(seen, pixels=pixels.astype(np.uint16))

    monkeypatch.setattr(rig.camera, "snap", with_more_noise)
    assert scan(rig, fit_plan(plan, rig), tmp_path / "scan.dsl").corrected == 0
