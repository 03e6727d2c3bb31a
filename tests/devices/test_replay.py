"""A finished scan, played back, passes for a rig and gives the same frames again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.capture.runner import Runner
from dsl_core.devices.base import Camera, DeviceRig, Projector
from dsl_core.devices.conformance import CameraConformance, ProjectorConformance, RigConformance
from dsl_core.devices.registry import open_rig
from dsl_core.devices.replay import replay_rig
from dsl_core.errors import DeviceError, StoreError
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.model.rig import BayerPattern
from dsl_core.patterns.images import pattern_image
from tests.cases.memory_sink import MemorySink

PLAN = CapturePlan(
    camera_size_px=(12, 8),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=0.4),),
    code_settings=(0,),
)


def _scan() -> MemorySink:
    rng = np.random.default_rng(3)
    sink = MemorySink(PLAN)
    for shot in PLAN.shots():
        sink.write(shot, Frame(rng.integers(0, 4096, (8, 12)).astype(np.uint16), shot.exposure_ms))
    return sink


class TestReplay(CameraConformance, ProjectorConformance, RigConformance):
    sees_projector = False

    def open_rig(self) -> DeviceRig:
        return replay_rig(_scan())

    def open_camera(self) -> Camera:
        return self.open_rig().camera

    def open_projector(self) -> Projector:
        return self.open_rig().projector


def test_a_stored_scan_is_replayed_by_name(tmp_path: Path) -> None:
    original = _scan()
    folder = tmp_path / "scan.dsl"
    with ScanWriter.create(folder, PLAN) as writer:
        Runner(replay_rig(original), PLAN, writer, pattern_image).run()
    again = MemorySink(PLAN)
    with open_rig("replay", {"scan": str(folder)}) as rig:
        Runner(rig, PLAN, again, pattern_image).run()
    open_rig("replay", {"session": str(folder)}).close()  # as notes of earlier scans have it
    reader = ScanReader(folder)
    for shot in PLAN.shots():
        np.testing.assert_array_equal(again.read(shot), original.read(shot))
        np.testing.assert_array_equal(reader.read(shot), original.read(shot))


def test_frames_keep_the_exposures_in_force_and_the_plan_its_own(tmp_path: Path) -> None:
    original, again = _scan(), MemorySink(PLAN)
    with ScanWriter.create(tmp_path / "scan.dsl", PLAN) as writer:
        for shot in PLAN.shots():
            writer.write(shot, Frame(original.read(shot), 10.4, 0.1 * shot.index, shot.index + 1))
    with open_rig("replay", {"scan": str(tmp_path / "scan.dsl")}) as rig:
        Runner(rig, PLAN, again, pattern_image).run()
        assert rig.camera.snap().exposure_ms == 10.4


@pytest.mark.parametrize(("bayer", "bits"), [("MONO", 8), ("GBRG", 14), ("RGGB", 12)])
def test_a_scan_without_calibration_is_replayed_as_its_camera_took_it(
    tmp_path: Path, bayer: BayerPattern, bits: int
) -> None:
    taken = replay_rig(_scan())
    taken.camera._info = replace(taken.camera.info, bayer=bayer, bit_depth=bits)  # type: ignore[attr-defined]
    taken.projector._info = replace(taken.projector.info, frame_period_ms=8.0)  # type: ignore[attr-defined]
    ScanWriter.create(tmp_path / "scan.dsl", PLAN, taken).close()
    with open_rig("replay", {"scan": str(tmp_path / "scan.dsl")}) as rig:
        assert (rig.camera.info.bayer, rig.camera.info.bit_depth) == (bayer, bits)
        assert rig.projector.info.frame_period_ms == 8.0


def test_replay_says_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"takes one option, scan=NAME.dsl; given: none"):
        open_rig("replay")
    with pytest.raises(StoreError, match="is not a scan"):
        open_rig("replay", {"scan": str(tmp_path)})
    with pytest.raises(DeviceError, match="shot 99 is not one of them"):
        replay_rig(_scan()).camera.prepare(99)
