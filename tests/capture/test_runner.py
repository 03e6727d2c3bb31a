"""The runner takes every missing shot, survives what devices do, and always leaves the projector dark."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsl_core.capture.exposure import RetryPolicy
from dsl_core.capture.runner import Runner, State, Status, _Pace
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import Cancelled, DeviceError, PlanError, StoreError
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Setting, Shot
from dsl_core.progress import CallbackProgress, CancelToken
from tests.cases.memory_sink import MemorySink

Pattern = Callable[..., Any]


def _is_dark(bench: Any) -> bool:
    return not bench.shown[-1].any()


def test_every_shot_is_taken_with_its_pattern_and_exposure(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    sink = MemorySink(plan)
    status = Runner(rig, plan, sink, pattern).run()
    shots = list(plan.shots())
    assert status.state is State.FINISHED
    assert (status.done, status.total) == (len(shots), len(shots))
    assert status.remaining_s == 0.0
    assert [int(image.max()) for image in bench.shown] == [shot.index + 1 for shot in shots] + [0]
    assert [sink.frames[shot.index].exposure_ms for shot in shots] == [shot.exposure_ms for shot in shots]
    assert bench.exposures_ms == [10.0, 20.0], "an exposure is sent only when it changes"


def test_patterns_are_sent_only_when_they_change(rig: DeviceRig, bench: Any, pattern: Pattern) -> None:
    plan = CapturePlan(
        camera_size_px=(24, 16),
        projector_size_px=(32, 18),
        settings=(Setting(exposure_ms=10.0, level=0.5), Setting(exposure_ms=20.0, level=0.5)),
        code_settings=(0,),
    )
    lines = plan.spectral_count
    assert lines > 1
    single = plan.model_copy(update={"spectral": plan.spectral.model_copy(update={"width_px": 32})})
    assert single.spectral_count == 1
    # Setting 0 ends with the only line; setting 1 takes black and then that line again.
    Runner(rig, single, MemorySink(single), pattern).run()
    assert len(bench.shown) == single.shot_count + 1
    bench.shown.clear()
    bench.before_snap = lambda shot, attempt: (
        _raise(DeviceError("lost")) if attempt == 0 and shot == 3 else None
    )
    Runner(rig, single, MemorySink(single), pattern).run()
    assert len(bench.shown) == single.shot_count + 2, "after a fault the pattern is sent again"


def _raise(error: BaseException) -> None:
    raise error


def test_preflight_tells_all_obstacles_at_once(rig: DeviceRig, bench: Any, pattern: Pattern) -> None:
    plan = CapturePlan(
        camera_size_px=(25, 16),
        projector_size_px=(32, 19),
        settings=(Setting(exposure_ms=0.5, level=1.0), Setting(exposure_ms=500.0, level=1.0)),
    )
    runner = Runner(rig, plan, MemorySink(plan), pattern)
    with pytest.raises(PlanError) as caught:
        runner.run()
    for part in ("25 x 16", "32 x 19", "0.5 ms", "500 ms"):
        assert part in str(caught.value)
    assert runner.status.state is State.FAILED
    assert bench.snapped == []


def test_a_lost_frame_is_retried(rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern) -> None:
    bench.before_snap = lambda shot, attempt: (
        _raise(DeviceError("lost")) if shot == 4 and attempt < 2 else None
    )
    sink = MemorySink(plan)
    Runner(rig, plan, sink, pattern, policy=RetryPolicy(attempts=3, wait_ms=70)).run()
    assert [a for s, a in bench.snapped if s == 4] == [0, 1, 2]
    assert sink.frames[4].attempts == 3
    assert sink.frames[5].attempts == 1
    assert bench.slept_s == [0.07, 0.07]


def test_a_shot_that_never_comes_ends_the_scan_clearly(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    bench.before_snap = lambda shot, attempt: _raise(DeviceError("No light.")) if shot == 4 else None
    sink = MemorySink(plan)
    runner = Runner(rig, plan, sink, pattern, policy=RetryPolicy(attempts=3))
    with pytest.raises(
        DeviceError, match=r"Frame 5 \(code pattern 5, setting 1\) failed 3 times: No light\."
    ):
        runner.run()
    assert runner.status.state is State.FAILED
    assert sorted(sink.frames) == [0, 1, 2, 3]
    assert _is_dark(bench)


@pytest.mark.parametrize("same", [("frame_id",), ("timestamp_s", "pixels")])
def test_an_old_frame_is_taken_again(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern, same: tuple[str, ...]
) -> None:
    sink = MemorySink(plan)
    fresh = Frame(np.arange(24 * 16, dtype=np.uint16).reshape(16, 24), 10.0, 0.45, 1000)

    def stale(shot: int, attempt: int) -> Frame | None:
        if (shot, attempt) != (4, 0):
            return None
        return replace(fresh, **{what: getattr(sink.frames[3], what) for what in same})

    bench.before_snap = stale
    Runner(rig, plan, sink, pattern).run()
    assert [a for s, a in bench.snapped if s == 4] == [0, 1]
    assert not any(np.array_equal(sink.frames[4].pixels, old.pixels) for old in (fresh, sink.frames[3]))


def test_an_old_picture_under_a_new_number_is_taken_again(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    sink = MemorySink(plan)

    def late(shot: int, attempt: int) -> Frame | None:
        before = sink.frames.get(3)
        if before is None or (shot, attempt) != (4, 0):
            return None
        return replace(before, frame_id=before.frame_id + 1, timestamp_s=before.timestamp_s + 1e-3)

    bench.before_snap = late
    # The fake counts only its own pictures, so its next number repeats once and is refused once more.
    Runner(rig, plan, sink, pattern).run()
    assert not np.array_equal(sink.frames[4].pixels, sink.frames[3].pixels)
    assert sink.frames[4].attempts > 1


def test_a_camera_without_noise_is_believed(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    picture = np.arange(24 * 16, dtype=np.uint16).reshape(16, 24)
    count = iter(range(1, 1000))

    def same(shot: int, attempt: int) -> Frame:
        number = next(count)
        return Frame(picture, bench.exposures_ms[-1], float(number), number)

    bench.before_snap = same
    sink = MemorySink(plan)
    Runner(rig, plan, sink, pattern).run()
    assert [sink.frames[i].attempts for i in range(4)] == [1, 4, 2, 2]


def test_a_frame_of_another_size_is_a_device_error(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    bench.before_snap = lambda shot, attempt: Frame(np.zeros((16, 12), np.uint16), 10.0, 1.0, 1)
    with pytest.raises(DeviceError, match="a picture of 12 × 16 px instead of 24 × 16 px"):
        Runner(rig, plan, MemorySink(plan), pattern).run()


def test_cancel_acts_between_shots_and_keeps_what_is_stored(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    sink = MemorySink(plan)
    runner = Runner(rig, plan, sink, pattern)
    states: list[State] = []
    runner.listen(lambda status: states.append(status.state))

    def cancel_at(shot: int, attempt: int) -> None:
        if shot == 5:
            runner.cancel()

    bench.before_snap = cancel_at
    with pytest.raises(Cancelled, match=f"after 6 of {plan.shot_count} frames"):
        runner.run()
    assert sorted(sink.frames) == [0, 1, 2, 3, 4, 5], "the shot under way is finished"
    assert states[-2:] == [State.CANCELLING, State.CANCELLED]
    assert f"after 6 of {plan.shot_count} frames" in runner.status.message
    assert _is_dark(bench)
    Runner(rig, plan, sink, pattern).run()
    assert len(sink.frames) == plan.shot_count


def test_cancel_leaves_a_camera_that_hangs_within_two_seconds(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited_ms: list[float] = []
    runner = Runner(rig, plan, MemorySink(plan), pattern)

    def hang(timeout_ms: float = 5000.0) -> Frame:
        waited_ms.append(timeout_ms)
        runner.cancel()
        raise DeviceError("No frame arrived.")

    monkeypatch.setattr(rig.camera, "snap", hang)
    with pytest.raises(Cancelled):
        runner.run()
    assert len(waited_ms) == 1
    assert waited_ms[0] + 1000 * sum(bench.slept_s) < 2000


def test_pause_waits_before_the_next_shot(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    runner = Runner(rig, plan, MemorySink(plan), pattern)
    paused = threading.Event()
    runner.listen(lambda status: paused.set() if status.state is State.PAUSED else None)

    def pause_at(shot: int, attempt: int) -> None:
        if shot == 3:
            runner.pause()

    bench.before_snap = pause_at
    thread = threading.Thread(target=runner.run)
    thread.start()
    assert paused.wait(10)
    held = runner.status
    assert (held.state, held.done) == (State.PAUSED, 4)
    assert bench.snapped[-1][0] == 3
    runner.resume()
    thread.join(10)
    assert runner.status.state is State.FINISHED


def test_cancel_ends_a_pause(rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern) -> None:
    runner = Runner(rig, plan, MemorySink(plan), pattern)
    runner.pause()
    runner.listen(lambda status: runner.cancel() if status.state is State.PAUSED else None)
    with pytest.raises(Cancelled):
        runner.run()
    assert bench.snapped == []


def test_time_is_counted_without_pauses_and_estimated(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    now_s = [0.0]

    def tick(shot: int, attempt: int) -> None:
        # Twice as long as exposure and latency together.
        now_s[0] += 2 * (plan.settings[0 if shot < 16 else 1].exposure_ms + 5.0) / 1000.0

    shots = list(plan.shots())
    assert shots[15].setting == 0
    assert shots[16].setting == 1
    bench.before_snap = tick
    runner = Runner(rig, plan, MemorySink(plan), pattern, clock=lambda: now_s[0])
    seen: list[Status] = []

    def look(status: Status) -> None:
        seen.append(status)
        if status.state is State.PAUSED:
            now_s[0] += 1000.0
            runner.resume()
        elif status.done == 3:
            runner.pause()

    runner.listen(look)
    runner.run()
    total_s = 2 * plan.duration_s(latency_ms=5.0)
    assert State.PAUSED in [status.state for status in seen]
    assert seen[-1].elapsed_s == pytest.approx(total_s)
    halfway = next(status for status in seen if status.done == 10)
    assert halfway.elapsed_s + halfway.remaining_s == pytest.approx(total_s, abs=2e-3)


def test_before_the_first_frame_the_plan_says_how_long_a_scan_takes(
    rig: DeviceRig, plan: CapturePlan, pattern: Pattern
) -> None:
    runner = Runner(rig, plan, MemorySink(plan), pattern, clock=lambda: 0.0)
    seen: list[Status] = []
    runner.listen(seen.append)
    runner.run()
    first = next(status for status in seen if status.state is State.RUNNING)
    assert first.remaining_s == pytest.approx(plan.duration_s(latency_ms=5.0), abs=2e-3)


def test_a_paused_scan_sleeps_until_anybody_cancels_it(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also a token that is cancelled without telling the runner, as a signal handler does."""
    token = CancelToken()
    runner = Runner(rig, plan, MemorySink(plan), pattern, token=token)
    asked, must_wait, ended = list[bool](), runner._must_wait, threading.Event()

    def count() -> bool:
        asked.append(True)
        return must_wait()

    def run() -> None:
        with pytest.raises(Cancelled):
            runner.run()
        ended.set()

    monkeypatch.setattr(runner, "_must_wait", count)
    runner.pause()
    threading.Thread(target=run, daemon=True).start()
    assert not ended.wait(0.35)
    token.cancel()
    assert ended.wait(10)
    assert 0 < len(asked) < 20
    assert bench.snapped == []


def test_a_broken_listener_or_progress_never_stops_a_scan(
    rig: DeviceRig, plan: CapturePlan, pattern: Pattern, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("a window went away")

    runner = Runner(rig, plan, MemorySink(plan), pattern, progress=CallbackProgress(broken))
    runner.listen(broken)
    with caplog.at_level(logging.ERROR):
        assert runner.run().state is State.FINISHED
    assert "a listener failed" in caplog.text
    assert "the progress display failed" in caplog.text


def test_progress_reports_and_may_cancel(rig: DeviceRig, plan: CapturePlan, pattern: Pattern) -> None:
    reports: list[tuple[str, int, int]] = []
    progress = CallbackProgress(lambda *report: reports.append(report))
    runner = Runner(rig, plan, MemorySink(plan), pattern, progress=progress)
    runner.listen(lambda status: progress.token.cancel() if status.done == 4 else None)
    with pytest.raises(Cancelled):
        runner.run()
    assert reports == [("scan", done, plan.shot_count) for done in (1, 2, 3)]


def test_a_dead_projector_does_not_hide_the_reason(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    def dead() -> None:
        if len(bench.shown) >= 4:
            raise DeviceError("The projector is unplugged.")

    bench.before_show = dead
    runner = Runner(rig, plan, MemorySink(plan), pattern)
    with pytest.raises(DeviceError, match=r"Frame 5 .* failed 4 times: The projector is unplugged"):
        runner.run()
    assert "could not be turned dark" in runner.status.message


@pytest.mark.parametrize("where", ["snap", "show", "write"])
def test_ctrl_c_leaves_a_resumable_session(
    tmp_path: Path, rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern, where: str
) -> None:
    folder = tmp_path / "scan.dsl"
    with ScanWriter.create(folder, plan, rig) as sink:
        if where == "snap":
            bench.before_snap = lambda shot, attempt: _raise(KeyboardInterrupt()) if shot == 7 else None
        elif where == "show":
            bench.before_show = lambda: _raise(KeyboardInterrupt()) if len(bench.shown) == 7 else None
        else:
            store = sink.write

            def write(shot: Shot, frame: Frame) -> None:
                if shot.index == 7:
                    raise KeyboardInterrupt
                store(shot, frame)

            sink.write = write  # type: ignore[method-assign]
        runner = Runner(rig, plan, sink, pattern)
        with pytest.raises(KeyboardInterrupt):
            runner.run()
        assert runner.status.state is State.CANCELLED
        assert runner.status.message == "Interrupted; saved frames are kept. Resume the scan."
    bench.before_snap, bench.before_show = lambda shot, attempt: None, lambda: None
    with ScanWriter.resume(folder, plan, rig) as sink:
        assert next(sink.missing()).index == 7
        status = Runner(rig, plan, sink, pattern).run()
    assert (status.earlier, status.done) == (7, plan.shot_count)
    whole = MemorySink(plan)
    Runner(rig, plan, whole, pattern).run()
    reader = ScanReader(folder)
    for shot in plan.shots():
        np.testing.assert_array_equal(reader.read(shot), whole.read(shot))


def test_a_full_disk_fails_the_scan_with_its_sentence(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    class FullSink(MemorySink):
        def write(self, shot: Shot, frame: Frame) -> None:
            raise StoreError("The disk is full.")

    runner = Runner(rig, plan, FullSink(plan), pattern)
    with pytest.raises(StoreError, match="The disk is full"):
        runner.run()
    assert runner.status.message == "The disk is full."
    assert _is_dark(bench)


def test_a_runner_runs_once(rig: DeviceRig, plan: CapturePlan, pattern: Pattern) -> None:
    runner = Runner(rig, plan, MemorySink(plan), pattern)
    runner.run()
    with pytest.raises(RuntimeError, match="runs once"):
        runner.run()


def test_a_frame_not_taken_is_named(plan: CapturePlan) -> None:
    with pytest.raises(StoreError, match=r"Frame 1 .* has not been captured"):
        MemorySink(plan).read(next(plan.shots()))


def test_cancelling_a_silent_camera_spares_the_other_attempts(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern
) -> None:
    sink = MemorySink(plan)
    runner = Runner(rig, plan, sink, pattern)

    def silent(shot: int, attempt: int) -> None:
        if shot == 4:
            runner.cancel()
            raise DeviceError("No light.")

    bench.before_snap = silent
    with pytest.raises(Cancelled, match="No light"):
        runner.run()
    assert [attempt for shot, attempt in bench.snapped if shot == 4] == [0]
    assert runner.status.state is State.CANCELLED
    assert len(sink.frames) == 4


class LossySink(MemorySink):
    """Loses frame 5 the first ``times`` that it is written."""

    def __init__(self, plan: CapturePlan, times: int) -> None:
        super().__init__(plan)
        self.times = times

    def read_back(self) -> list[Shot]:
        if self.times:
            self.times -= 1
            del self.frames[5]
        return super().read_back()


def test_frames_lost_after_they_were_saved_are_taken_again(
    rig: DeviceRig, bench: Any, plan: CapturePlan, pattern: Pattern, caplog: pytest.LogCaptureFixture
) -> None:
    sink = LossySink(plan, times=2)
    status = Runner(rig, plan, sink, pattern).run()
    assert (status.state, status.done) == (State.FINISHED, plan.shot_count)
    assert sorted(sink.frames) == list(range(plan.shot_count))
    assert [shot for shot, _ in bench.snapped].count(5) > 2
    assert "frames were lost or damaged on the disk after they were saved" in caplog.text


def test_a_disk_that_keeps_losing_frames_does_not_finish_a_scan(
    rig: DeviceRig, plan: CapturePlan, pattern: Pattern
) -> None:
    runner = Runner(rig, plan, LossySink(plan, times=9), pattern)
    with pytest.raises(StoreError, match=r"1 of \d+ frames are lost or damaged whenever they are read back"):
        runner.run()
    assert runner.status.state is State.FAILED


def test_seconds_of_a_pause_are_no_seconds_of_the_scan() -> None:
    now = [0.0]
    pace, shots = _Pace(lambda: now[0], 500.0), [Shot(n, "white", 0, 0, 500.0, 1.0) for n in range(4)]
    pace.start(shots)
    now[0] = 2.0
    pace.passed(shots[0])
    assert pace.times() == (2.0, 6.0)
    pace.hold()
    now[0] = 60.0
    assert pace.times() == (2.0, 6.0)
    pace.restart()
    now[0] = 61.0
    assert pace.times() == (3.0, 9.0)
