"""One shot: what is sent and awaited, which pictures are taken again, and how often."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dsl_core.capture.exposure import RetryPolicy, ShotTaker
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import Cancelled, DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.progress import CancelToken

Pattern = Callable[..., Any]
Taker = Callable[..., ShotTaker]


@pytest.fixture
def taker(rig: DeviceRig, plan: CapturePlan, pattern: Pattern) -> Taker:
    def build(attempts: int = 4, **parts: Any) -> ShotTaker:
        return ShotTaker(rig, plan, pattern, RetryPolicy(attempts=attempts), **parts)

    return build


@pytest.fixture
def shots(plan: CapturePlan) -> list[Shot]:
    return list(plan.shots())


def lost(*numbers: tuple[int, int]) -> Callable[[int, int], None]:
    """A camera that loses these (shot, attempt)."""

    def snap(shot: int, attempt: int) -> None:
        if (shot, attempt) in numbers:
            raise DeviceError("No frame came.")

    return snap


def test_four_attempts_wait_a_fifth_of_a_second_and_frames_have_a_second_and_a_half() -> None:
    assert RetryPolicy() == RetryPolicy(attempts=4, wait_ms=200.0, timeout_ms=1500.0)


def test_a_lost_frame_is_awaited_and_everything_sent_again(
    taker: Taker, shots: list[Shot], bench: Any
) -> None:
    bench.before_snap = lost((0, 0))
    frame = taker(attempts=2, now=iter([7.0, 8.0]).__next__).take(shots[0])
    assert bench.slept_s == [0.2]
    assert len(bench.shown) == 2
    assert bench.exposures_ms == [10.0, 10.0]
    assert (frame.attempts, frame.shown_s) == (2, 8.0)


def test_the_projector_settles_before_each_exposure(taker: Taker, shots: list[Shot], bench: Any) -> None:
    one = taker()
    one.take(shots[0], settle_ms=30.0)
    assert bench.slept_s == [0.03]
    one.take(shots[1], settle_ms=30.0, twice=True)
    assert bench.slept_s == [0.03] * 3
    assert len(bench.shown) == 3
    assert [shot for shot, _ in bench.snapped] == [0, 1, 1], "sent and exposed twice"
    one.take(shots[1])
    assert len(bench.shown) == 3, "what is shown is not sent again"


def test_earlier_rounds_count_and_send_the_pattern_again(taker: Taker, shots: list[Shot], bench: Any) -> None:
    one = taker()
    one.take(shots[0])
    frame = one.take(shots[0], earlier_rounds=2)
    assert bench.snapped == [(0, 0), (0, 8)]
    assert frame.attempts == 9
    assert len(bench.shown) == 2


def test_a_frame_may_take_its_exposure_and_the_patience(
    taker: Taker, shots: list[Shot], rig: DeviceRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, snap = [], rig.camera.snap

    def noted(timeout_ms: float) -> Frame:
        asked.append(timeout_ms)
        return snap(timeout_ms)

    monkeypatch.setattr(rig.camera, "snap", noted)
    taker().take(shots[0])
    assert asked == [1510.0]


def test_an_exposure_that_the_camera_does_not_keep_is_an_error(
    taker: Taker, shots: list[Shot], rig: DeviceRig, bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    configure = rig.camera.configure
    monkeypatch.setattr(rig.camera, "configure", lambda ms: 2 * configure(ms))
    with pytest.raises(DeviceError, match="failed 1 times"):
        taker(attempts=1).take(shots[0])
    assert bench.snapped == []


def test_a_gap_in_the_numbers_after_a_failure_is_not_told(
    taker: Taker, shots: list[Shot], rig: DeviceRig, bench: Any, caplog: pytest.LogCaptureFixture
) -> None:
    one = taker()
    for shot in shots[:10]:
        one.take(shot)

    def skipping(shot: int, attempt: int) -> None:
        if attempt == 0:
            rig.camera.count += 1  # type: ignore[attr-defined]
            raise DeviceError("No frame came.")

    bench.before_snap = skipping
    one.take(shots[10])
    assert "the camera lost" not in caplog.text


def still(bench: Any) -> None:
    """A camera whose pictures are all the same, under new numbers."""
    numbers = iter(range(1, 100))

    def snap(shot: int, attempt: int) -> Frame:
        number = next(numbers)
        return Frame(np.arange(16 * 24, dtype=np.uint16).reshape(16, 24), 10.0, 0.1 * number, number)

    bench.before_snap = snap


def test_a_camera_without_noise_is_believed_after_two_pictures_and_told_once(
    taker: Taker, shots: list[Shot], bench: Any, caplog: pytest.LogCaptureFixture
) -> None:
    still(bench)
    one = taker(attempts=3)
    frames = [one.take(shot) for shot in shots[:3]]
    assert [frame.attempts for frame in frames] == [1, 3, 2]
    assert caplog.text.count("assumed to be free of noise") == 1


@pytest.mark.parametrize(("attempts", "is_believed"), [(1, False), (2, True)])
def test_one_picture_that_repeats_is_late(
    taker: Taker, shots: list[Shot], bench: Any, attempts: int, is_believed: bool
) -> None:
    still(bench)
    one = taker(attempts=attempts)
    one.take(shots[0])
    if is_believed:
        assert one.take(shots[1]).attempts == 2
    else:
        with pytest.raises(DeviceError, match="picture of the previous shot"):
            one.take(shots[1])


def test_pictures_clipped_throughout_may_repeat(taker: Taker, shots: list[Shot], bench: Any) -> None:
    still(bench)
    snap = bench.before_snap
    bench.before_snap = lambda *at: replace(snap(*at), pixels=np.full((16, 24), 4095, np.uint16))
    one = taker()
    assert [one.take(shot).attempts for shot in shots[:3]] == [1, 1, 1]


def test_whoever_cancels_is_spared_further_attempts(taker: Taker, shots: list[Shot], bench: Any) -> None:
    token = CancelToken()
    token.cancel()
    bench.before_snap = lost((0, 0))
    with pytest.raises(Cancelled, match="No frame came"):
        taker(token=token).take(shots[0])
    assert bench.slept_s == []


def test_black_is_shown_and_the_next_pattern_sent(taker: Taker, shots: list[Shot], bench: Any) -> None:
    one = taker()
    one.take(shots[0])
    one.show_black()
    assert (bench.shown[-1].shape, bench.shown[-1].any()) == ((18, 32), False)
    one.take(shots[0])
    assert len(bench.shown) == 3
