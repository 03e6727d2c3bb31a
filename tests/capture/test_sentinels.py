"""Sentinels tell what moved during a scan, and when; light that changes is no movement."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from dsl_core.capture.runner import Runner, State
from dsl_core.capture.sentinels import SentinelWatch, movement_of
from dsl_core.errors import DriftError
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels
from dsl_core.simulation.published_rig import published_rig
from tests.cases.changing_rig import Change, changing, shifted
from tests.cases.memory_sink import MemorySink
from tests.cases.rendered_rig import RenderedScene, token_image

SIZE = (96, 64)


@pytest.fixture(scope="module")
def scene() -> RenderedScene:
    """A textured plane that faces the camera: column x of the picture sees column x of the projector."""
    from dsl_core.patterns.images import pattern_image

    plan = CapturePlan(
        camera_size_px=SIZE,
        projector_size_px=SIZE,
        code=GrayCode(rows=False),
        spectral=ScanLines(step_px=5),
        sentinels=Sentinels(every=20),
    )
    texture = 1.5 + 4 * gaussian_filter(np.random.default_rng(4).normal(size=SIZE[::-1]), 1.5)
    rates: dict[bytes, np.ndarray] = {}
    for shot in plan.shots():
        image = pattern_image(plan, shot)[..., 1] / 255.0
        light = 40 * gaussian_filter(image, 0.7) ** 2 * texture.clip(0.3) + 0.05
        rates[token_image(plan, shot).tobytes()] = light.astype(np.float32)
    return RenderedScene(plan, published_rig(), rates)


def scan(scenes: list[RenderedScene], change: Change, waits: bool = False) -> tuple[MemorySink, Runner]:
    plan = scenes[0].plan
    sink, watch = MemorySink(plan), SentinelWatch(plan, scenes[0].calibration.sensor)
    keep = sink.write

    def write(shot, frame):  # type: ignore[no-untyped-def]
        keep(shot, frame)
        watch.add(shot, frame.pixels)

    sink.write = write  # type: ignore[method-assign]
    rig = replace(changing(scenes, change, 3), calibration=None)
    return sink, Runner(rig, plan, sink, token_image, sentinels=watch, waits=waits)


@pytest.mark.parametrize(
    "change",
    [
        Change(),
        Change(light=lambda shot: 1 - 0.002 * shot),
        Change(light=lambda shot: 1 + 0.1 * np.sin(7.0 * shot * shot)),
        Change(room=lambda shot: 1.0 + (shot > 40)),
    ],
)
def test_nothing_is_said_of_a_scan_in_which_nothing_moves(scene: RenderedScene, change: Change) -> None:
    sink, runner = scan([scene], change)
    assert runner.run().warning == ""
    assert movement_of(sink, scene.calibration.sensor) is None


def test_a_camera_that_moves_ends_the_scan_where_it_is_seen(scene: RenderedScene) -> None:
    rounds = [shot.index for shot in scene.plan.shots() if shot.role == "sentinel"]
    at = rounds[4] - 3
    sink, runner = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(shot >= at)))
    with pytest.raises(DriftError, match=r"moved by 2\.\d ± 0\.1 px, between frame \d+ and frame \d+"):
        runner.run()
    found = movement_of(sink, scene.calibration.sensor, (s.index for s in sink.missing()))
    assert found is not None
    assert found.after is not None
    assert found.before is not None
    assert found.after < at <= found.before
    assert runner.status.state is State.FAILED


def test_a_scan_with_all_its_frames_ends_with_a_warning(scene: RenderedScene) -> None:
    last = scene.plan.shot_count - 6
    _, runner = scan([scene, shifted(scene, 0, 2)], Change(scene=lambda shot: int(shot >= last)))
    status = runner.run()
    assert status.state is State.FINISHED
    assert "The camera or the scene moved by" in status.warning
    assert status.warning in status.message


def test_a_scan_that_waits_pauses_until_somebody_decides(scene: RenderedScene) -> None:
    _, runner = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(shot >= 30)), waits=True)
    seen = []

    def decide(status) -> None:  # type: ignore[no-untyped-def]
        seen.append(status.state)
        if status.state is State.PAUSED:
            assert "moved by" in status.warning
            runner.resume()

    runner.listen(decide)
    assert runner.run().state is State.FINISHED
    assert seen.count(State.PAUSED) == 1
