"""Sentinels tell what moved during a scan, and when; light that changes is no movement."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from dsl_core.capture.runner import Runner, State
from dsl_core.capture.sentinels import SentinelWatch, movement_of
from dsl_core.capture.sink import WatchedSink
from dsl_core.errors import DriftError
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels, Setting
from dsl_core.model.rig import Sensor
from dsl_core.optics.seen_noise import PAIRS
from dsl_core.optics.sensor import digitise
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.published_rig import published_rig
from tests.cases.changing_rig import Change, changing, from_shot, shifted
from tests.cases.memory_sink import MemorySink
from tests.cases.rendered_rig import RenderedScene, token_image

SIZE = (96, 64)


@pytest.fixture(scope="module")
def scene() -> RenderedScene:
    """A textured plane that faces the camera: column x of the picture sees column x of the projector."""
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
    sink = MemorySink(scenes[0].plan)
    return sink, _runner(scenes, change, sink, waits)


def again(scene: RenderedScene, sink: MemorySink, now: list[RenderedScene]) -> Runner:
    """Another run of a scan, with what is there now."""
    return _runner(now, Change(), sink)


def _runner(scenes: list[RenderedScene], change: Change, sink: MemorySink, waits: bool = False) -> Runner:
    plan = scenes[0].plan
    watch = SentinelWatch(plan, scenes[0].calibration.sensor)
    watch.learn(sink, (shot for shot in plan.shots() if shot.index in sink.frames))
    rig = replace(changing(scenes, change, 3), calibration=None)
    watched = WatchedSink(sink, lambda shot, frame: watch.add(shot, frame.pixels))
    return Runner(rig, plan, watched, token_image, sentinels=watch, waits=waits)


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
    moved = from_shot(30, 0, 1)
    _, runner = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(moved(shot))), waits=True)
    seen = []

    def decide(status) -> None:  # type: ignore[no-untyped-def]
        seen.append(status.state)
        if status.state is State.PAUSED:
            assert "moved by" in status.warning
            runner.resume()

    runner.listen(decide)
    status = runner.run()
    assert status.state is State.FINISHED
    assert "frames after that do not fit" in status.message
    assert seen.count(State.PAUSED) == 1


def test_what_was_put_back_during_a_pause_is_captured_again_from_the_motion_on(scene: RenderedScene) -> None:
    moved, is_back = from_shot(30, 0, 1), list[bool]()
    now = Change(scene=lambda shot: 0 if is_back else int(moved(shot)))
    sink, runner = scan([scene, shifted(scene, 2)], now, waits=True)

    def put_back(status) -> None:  # type: ignore[no-untyped-def]
        if status.state is State.PAUSED:
            assert "Put back what moved" in status.warning
            is_back.append(True)
            runner.resume()

    runner.listen(put_back)
    status = runner.run()
    assert (status.state, status.warning, status.done) == (State.FINISHED, "", scene.plan.shot_count)
    assert movement_of(sink, scene.calibration.sensor) is None


def test_a_scan_whose_rig_never_keeps_still_waits_for_it_five_times(scene: RenderedScene) -> None:
    is_away = [False]
    _, runner = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(is_away[0])), waits=True)
    pauses = list[int]()

    def leave_and_return(status) -> None:  # type: ignore[no-untyped-def]
        if status.state is State.PAUSED:
            pauses.append(status.done)
            is_away[0] = False
            runner.resume()
        else:
            is_away[0] = status.done > 30

    runner.listen(leave_and_return)
    warning = runner.run().warning
    assert len(pauses) == 6
    assert "moved by 2.0 ± 0.1 px" in warning
    assert warning.endswith("frames after that do not fit those before.")


def test_a_scan_that_saw_motion_resumes_once_all_is_back(scene: RenderedScene) -> None:
    at = [shot.index for shot in scene.plan.shots() if shot.role == "sentinel"][4] - 3
    sink, runner = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(shot >= at)))
    with pytest.raises(DriftError, match=r"Put back what moved.* Then resume the scan\."):
        runner.run()
    kept = {index: frame.pixels for index, frame in sink.frames.items()}
    with pytest.raises(DriftError, match=r"Not all is back in its place: .* moved by 2\.\d ± 0\.1 px"):
        again(scene, sink, [shifted(scene, 2)]).run()
    assert sink.frames.keys() == kept.keys()
    status = again(scene, sink, [scene]).run()
    assert (status.state, status.warning) == (State.FINISHED, "")
    assert movement_of(sink, scene.calibration.sensor) is None
    same = {index for index, pixels in kept.items() if sink.frames[index].pixels is pixels}
    assert 0 < max(same) < at
    assert min(kept.keys() - same, default=at) <= at


def test_a_finished_scan_keeps_its_frames_while_not_all_is_back(scene: RenderedScene) -> None:
    last = scene.plan.shot_count - 6
    moved = [scene, shifted(scene, 0, 2)]
    sink, runner = scan(moved, Change(scene=lambda shot: int(shot >= last)))
    runner.run()
    kept = dict(sink.frames)
    assert "moved by" in again(scene, sink, moved[1:]).run().warning
    assert sink.frames == kept
    assert again(scene, sink, [scene]).run().warning == ""
    assert movement_of(sink, scene.calibration.sensor) is None


def test_what_is_damaged_of_the_first_pictures_does_not_say_whether_all_is_back(scene: RenderedScene) -> None:
    sink, runner = scan([scene, shifted(scene, 2)], Change(scene=lambda shot: int(shot >= 30)))
    with pytest.raises(DriftError):
        runner.run()
    sink.withdraw([scene.plan.references()["code"]])
    assert again(scene, sink, [scene]).run().warning == ""


def test_a_scan_without_sentinels_looks_at_its_first_pictures(scene: RenderedScene) -> None:
    alone = scene.plan.model_copy(update={"sentinels": None})
    references = {shot.index for shot in alone.references().values()}
    assert len(references) == 3
    assert SentinelWatch(alone, scene.calibration.sensor).wanted == references
    assert len(SentinelWatch(alone).wanted - references) == 2 * PAIRS, (
        "of an unknown sensor, the code as well"
    )


#: None of these sensors is the one that is assumed of a camera that is not calibrated.
SENSORS = [
    Sensor(),
    Sensor(black_level_dn=64.0, electrons_per_dn=2.5, read_noise_dn=1.0),
    Sensor(black_level_dn=16.0, electrons_per_dn=2.5, read_noise_dn=3.0),
    Sensor(bit_depth=8, black_level_dn=4.0, electrons_per_dn=40.0, read_noise_dn=0.3),
    Sensor(bit_depth=16, black_level_dn=1000.0, electrons_per_dn=0.2, read_noise_dn=16.0),
]


def seen_of(sensor: Sensor, white_dn: float, texture: np.ndarray, shift_px: float) -> str:
    """What is said of a surface in white and stripes, ``white_dn`` of 12 bits, that moves after 40 shots."""
    plan = CapturePlan(
        camera_size_px=texture.shape[::-1],
        projector_size_px=(64, 8),
        code=GrayCode(rows=False),
        spectral=ScanLines(width_px=4, step_px=2),
        settings=(Setting(exposure_ms=100, level=0.5),),
        code_settings=(0,),
        sentinels=Sentinels(every=20),
    )
    rng, watch = np.random.default_rng(0), SentinelWatch(plan, None, sensor.bit_depth)
    column = np.arange(texture.shape[1]) * 64 // texture.shape[1]
    for shot in plan.shots():
        drive = pattern_image(plan, plan.original(shot)).reshape(8, 64, -1).mean((0, 2))
        light = white_dn * 2.0 ** (sensor.bit_depth - 12) * (drive / max(drive.max(), 1))[column] * texture
        if shot.index >= 40:
            light = shift(light, (0, shift_px), order=3, mode="nearest")
        watch.add(shot, digitise(sensor, light.astype(np.float32), rng))
    return "" if watch.found is None else watch.found.sentence


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("white_dn", [67.0, 300.0])
def test_the_noise_of_a_camera_that_is_not_calibrated_is_no_motion(sensor: Sensor, white_dn: float) -> None:
    assert seen_of(sensor, white_dn, np.ones((144, 222)), 0.0) == ""


@pytest.mark.parametrize("sensor", SENSORS)
def test_motion_is_told_by_a_camera_that_is_not_calibrated(sensor: Sensor) -> None:
    texture = 1 + 2 * gaussian_filter(np.random.default_rng(3).normal(size=(144, 222)), 2.0)
    assert "moved by 0.8 ± 0.1 px" in seen_of(sensor, 300.0, texture.clip(0.1), 0.8)
