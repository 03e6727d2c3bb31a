"""The twin passes the suites for drivers; with faults built in, scans end as they should."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.exposure import RetryPolicy
from dsl_core.capture.runner import Runner
from dsl_core.devices.base import Camera, DeviceRig, Projector
from dsl_core.devices.conformance import CameraConformance, ProjectorConformance
from dsl_core.devices.replay import replay_rig
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.patterns.images import pattern_image
from tests.cases.faults import FaultPlan, with_faults
from tests.cases.memory_sink import MemorySink

PLAN = CapturePlan(
    camera_size_px=(12, 8),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=1, period_px=32),
    settings=(Setting(exposure_ms=10.0, level=0.4),),
    code_settings=(0,),
)
PATIENT = RetryPolicy(attempts=12)


def _source() -> MemorySink:
    rng = np.random.default_rng(3)
    source = MemorySink(PLAN)
    for shot in PLAN.shots():
        source.write(shot, Frame(rng.integers(0, 4096, (8, 12)).astype(np.uint16), shot.exposure_ms))
    return source


def _scan(faults: FaultPlan) -> MemorySink:
    sink = MemorySink(PLAN)
    Runner(with_faults(replay_rig(_source()), faults), PLAN, sink, pattern_image, policy=PATIENT).run()
    return sink


class TestWithoutFaults(CameraConformance, ProjectorConformance):
    def open_rig(self) -> DeviceRig:
        return with_faults(replay_rig(_source()), FaultPlan())

    def open_camera(self) -> Camera:
        return self.open_rig().camera

    def open_projector(self) -> Projector:
        return self.open_rig().projector


@pytest.mark.parametrize(
    "faults", [FaultPlan(lost=0.3), FaultPlan(repeated=0.3), FaultPlan(lost=0.1, repeated=0.1, late=0.2)]
)
def test_a_scan_gets_through_and_keeps_the_right_frames(faults: FaultPlan) -> None:
    sink, truth = _scan(faults), _source()
    for shot in PLAN.shots():
        np.testing.assert_array_equal(sink.read(shot), truth.read(shot))
    assert any(frame.attempts > 1 for frame in sink.frames.values())


def test_faults_depend_on_seed_and_shot_only() -> None:
    def attempts(seed: int) -> list[int]:
        return [frame.attempts for frame in _scan(FaultPlan(seed=seed, lost=0.3)).frames.values()]

    assert attempts(1) == attempts(1)
    assert attempts(1) != attempts(2)


def test_an_unplugged_camera_ends_the_scan_at_its_shot() -> None:
    sink = MemorySink(PLAN)
    rig = with_faults(replay_rig(_source()), FaultPlan(camera_gone_at=5))
    with pytest.raises(DeviceError, match=r"Frame 6 .* does not answer"):
        Runner(rig, PLAN, sink, pattern_image).run()
    assert len(sink.frames) == 5


def test_an_unplugged_projector_ends_the_scan_at_its_pattern() -> None:
    sink = MemorySink(PLAN)
    rig = with_faults(replay_rig(_source()), FaultPlan(projector_gone_at=4))
    with pytest.raises(DeviceError, match=r"Frame 5 .* projector .* does not answer"):
        Runner(rig, PLAN, sink, pattern_image).run()
    assert len(sink.frames) == 4


def test_a_slow_link_only_takes_time() -> None:
    waited_s: list[float] = []
    rig = replay_rig(_source())
    rig.sleep = waited_s.append
    Runner(with_faults(rig, FaultPlan(slow_s=0.5)), PLAN, MemorySink(PLAN), pattern_image).run()
    assert sum(waited_s) == 0.5 * PLAN.shot_count
