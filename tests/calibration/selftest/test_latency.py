"""The shortest safe wait, stale frames and dead projectors from readings with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.selftest.latency import check_latency, first_failing, is_right, trials
from dsl_core.calibration.selftest.readings import Readings
from dsl_core.errors import DeviceError
from tests.cases.cycle_readings import table

BLACK_DN = 260.0


def latency_readings(late_ms: float, waits: list[float], stale: tuple[int, ...] = ()) -> Readings:
    """Three trials of black and light at each wait, exposures of 10 ms, ``show`` takes 25 ms."""
    rows = [(0, 1000.0, k) for k in range(3)] + [(1, 1000.0, k) for k in range(3)]
    rows += [(lit, wait, k) for wait in waits for _ in range(3) for lit in (0, 1) for k in (0, 1)]
    drive, gap, since = (np.array(each) for each in zip(*rows, strict=True))
    asked = np.where((since == 0) & (np.arange(len(rows)) >= 6), gap, 0.0)
    open_ms = np.where(
        since == 0, np.clip((late_ms - asked) / 10, 0, 1), np.clip((late_ms - asked) / 10 - 1, 0, 1)
    )
    open_ms[:6] = 0
    open_ms[list(stale)] = 1
    share = np.where(drive > 0, 1 - open_ms, open_ms)
    step = 10 + asked + np.where(since == 0, 25.0, 0.0) + 1.0
    readings = table(
        np.full(len(rows), 10.0), 260 + 1000 * share[:, None] * np.ones(3), np.cumsum(step) / 1000, asked
    )
    return replace(readings, since_show=since.astype(np.int64), drive=np.repeat(drive[:, None] * 200, 3, 1))


def test_latency_is_the_shortest_wait_that_never_fails() -> None:
    found = check_latency(latency_readings(0.0, [400, 100, 25, 0]), 25.0, True, 0.0)
    assert (found.wait_ms.value, found.stale_frames, found.checked) == (0.0, 0, 26)
    assert found.blocking_ms.value == pytest.approx(25.0, abs=0.1)
    found = check_latency(latency_readings(40.0, [400, 100, 50, 45, 25]), 25.0, False, 0.012)
    assert found.wait_ms.value == 45.0
    assert found.wait_ms.std == pytest.approx(20 / np.sqrt(12), rel=0.05)
    assert found.blocking_ms.value == pytest.approx(12.0)


def test_a_stale_frame_is_counted_and_a_dead_projector_named() -> None:
    found = check_latency(latency_readings(0.0, [400, 100, 0], stale=(8,)), 25.0, True, 0.0)
    assert (found.stale_frames, found.wait_ms.value) == (1, 0.0)
    with pytest.raises(DeviceError, match="400 ms after"):
        check_latency(latency_readings(420.0, [400, 100]), 25.0, True, 0.0)
    dark = latency_readings(0.0, [400])
    with pytest.raises(DeviceError, match="black and white still look the same"):
        check_latency(replace(dark, mean_dn=np.full_like(dark.mean_dn, 260.0)), 25.0, True, 0.0)


def test_a_picture_is_right_within_three_percent_of_its_light() -> None:
    readings = latency_readings(0.0, [400, 100])
    mean = readings.mean_dn.copy()
    # Black is 3 x 260 DN in all channels together, white 3000 DN more.
    mean[8] += 1000 * 0.029
    mean[9] += 1000 * 0.031
    right = is_right(replace(readings, mean_dn=mean))
    assert np.flatnonzero(~right).tolist() == [9]
    mean[8] -= 1000 * 0.058
    assert np.flatnonzero(~is_right(replace(readings, mean_dn=mean))).tolist() == [9]


@pytest.mark.parametrize(
    ("later", "said"), [((0.96, 0.98, 1.0), "changes by \\+2.0%"), ((0.5, 1.0, 1.0), "400 ms")]
)
def test_light_that_creeps_is_not_called_a_late_picture(later: tuple[float, ...], said: str) -> None:
    readings = latency_readings(420.0, [400])
    mean = readings.mean_dn.copy()
    mean[3:6] = 260 + 1000 * np.array(later)[:, None]
    with pytest.raises(DeviceError, match=said):
        check_latency(replace(readings, mean_dn=mean), 25.0, True, 0.0)


@pytest.mark.parametrize(("step_dn", "responds"), [(1.6, False), (1.7, True)])
def test_a_projector_responds_when_three_channels_change_by_five_counts(
    step_dn: float, responds: bool
) -> None:
    readings = latency_readings(0.0, [400])
    dim = replace(readings, mean_dn=260 + (readings.mean_dn - 260) * step_dn / 1000)
    if responds:
        assert is_right(dim).all()
    else:
        with pytest.raises(DeviceError, match="does not respond"):
            is_right(dim)


def test_the_longest_wait_that_failed_and_trials_without_the_reference() -> None:
    readings = latency_readings(40.0, [400, 100, 50, 45, 25])
    right = is_right(readings)
    assert first_failing(readings, right) == 25.0
    good = latency_readings(0.0, [400, 25])
    assert first_failing(good, is_right(good)) is None
    judged, asked, stale = trials(readings, right)
    assert judged.min() == 6
    assert (len(judged), stale) == (30, 0)
    assert sorted(set(asked)) == [25, 45, 50, 100, 400]


def test_the_deviation_of_a_wait_is_that_between_two_waits_and_of_what_a_frame_can_tell() -> None:
    found = check_latency(latency_readings(40.0, [400, 100, 50, 45, 25]), 25.0, True, 0.0)
    assert found.wait_ms.std == pytest.approx(np.hypot(20 / np.sqrt(12), 0.03 * 10))
    safe = check_latency(latency_readings(0.0, [400, 0]), 25.0, True, 0.0)
    assert safe.wait_ms.std == pytest.approx(0.3)


def test_any_drive_above_zero_is_light() -> None:
    readings = latency_readings(0.0, [400])
    assert is_right(replace(readings, drive=np.minimum(readings.drive, 1))).all()


def test_first_frames_are_counted_and_blocking_leaves_out_what_the_camera_takes() -> None:
    readings = latency_readings(0.0, [400, 100])
    # The camera takes longer for the reference pictures, and one of those is missing.
    times = readings.timestamp_s.copy()
    times[2:] += 0.2
    times[5:] += 0.2
    found = check_latency(replace(readings, timestamp_s=times)[np.arange(len(times)) != 1], 25.0, True, 0.0)
    assert found.blocking_ms.value == pytest.approx(25.0, abs=1e-6)
    assert found.checked == 14
    plain = check_latency(readings, 25.0, False, 0.012)
    assert (plain.blocking_ms.value, plain.blocking_ms.std) == (12.0, 1.0)


def test_a_frame_is_stale_only_if_the_next_is_not() -> None:
    with pytest.raises(DeviceError, match="400 ms after"):
        check_latency(latency_readings(0.0, [400, 100], stale=(8, 9)), 25.0, True, 0.0)
    # All first frames late at the longest wait are no stale ones.
    with pytest.raises(DeviceError, match="400 ms after"):
        check_latency(latency_readings(408.0, [400, 100]), 25.0, True, 0.0)


def test_when_all_are_late_at_the_longest_wait_it_is_the_wait() -> None:
    readings = latency_readings(0.0, [400, 100])
    right = np.ones(len(readings), bool)
    first = np.flatnonzero(readings.since_show == 0)
    longest = first[readings.gap_ms[first] == 400]
    right[longest] = False
    judged, _, stale = trials(readings, right)
    assert stale == 0
    assert set(longest[longest > 5]) <= set(judged)
    right[longest[-1]] = True
    _, _, stale = trials(readings, right)
    assert stale == np.count_nonzero(longest > 5) - 1
    assert first_failing(readings, right) is None


def test_only_frames_after_the_reference_say_how_long_showing_blocks() -> None:
    """The last of the reference pictures, and what was read before it, are not counted."""
    readings = latency_readings(0.0, [400, 100])
    times = readings.timestamp_s.copy()
    last = int(np.flatnonzero(readings.since_show >= 2).max())
    plain = check_latency(readings, 25.0, True, 0.0).blocking_ms
    for row in range(1, last + 1):
        moved = times.copy()
        moved[row:] += 0.3
        found = check_latency(replace(readings, timestamp_s=moved), 25.0, True, 0.0).blocking_ms
        assert (found.value, found.std) == pytest.approx((plain.value, plain.std), abs=1e-9)
