"""A camera that loses triggers, delivers bad buffers, is unplugged and restarted: no frame is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.devices.base import Camera
from dsl_core.devices.conformance import CameraConformance
from dsl_core.devices.drivers.genicam.camera import GenicamCamera
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError
from tests.devices.drivers.genicam.fake_port import FakePort, FakeSensor


class Clock:
    """Time passes only by waiting, and a little at each look."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        self.now_s += 1e-3
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


def camera(sensor: FakeSensor, clock: Clock | None = None, **settings: object) -> GenicamCamera:
    clock = clock or Clock()
    chosen = GenicamSettings.model_validate({"adc_bits": 12, "pixel_format": "BayerRG16"} | settings)
    return GenicamCamera(lambda: FakePort(sensor), chosen, clock, clock.sleep)


class TestGenicamCamera(CameraConformance):
    def open_camera(self) -> Camera:
        return camera(FakeSensor())


def test_numbers_rise_through_the_wrap_of_the_ids() -> None:
    with camera(FakeSensor()) as eye:
        frames = [eye.snap() for _ in range(140)]
    assert np.diff([frame.frame_id for frame in frames]).tolist() == [1] * 139
    # The pixels are of the frame, moved down from the left.
    assert [int(frame.pixels[0, 0]) for frame in frames] == list(range(1, 141))


def test_bad_buffers_are_triggered_again_and_never_returned() -> None:
    sensor = FakeSensor(faults=["bad", "bad", "bad", "", "bad"])
    with camera(sensor) as eye:
        taken = [int(eye.snap().pixels[0, 0]) for _ in range(2)]
        assert taken == [4, 6]
        assert (eye.counts.asked, eye.counts.delivered, eye.counts.bad) == (2, 2, 4)


def test_a_trigger_that_is_lost_is_given_again() -> None:
    with camera(FakeSensor(faults=["lost"])) as eye:
        assert eye.snap().pixels[0, 0] == 1
        assert eye.counts.late == 1


def test_numbers_rise_where_a_restart_counts_from_zero() -> None:
    with camera(FakeSensor(counts_anew=True, faults=["", "lost", "", "lost", "lost"])) as eye:
        assert [eye.snap().frame_id for _ in range(4)] == [0, 1, 2, 3]


def test_a_frame_that_comes_late_does_not_pass_for_the_next() -> None:
    class Slow(FakePort):
        held = True

        def fetch(self, timeout_s: float) -> None:
            held, Slow.held = Slow.held, False
            return None if held else super().fetch(timeout_s)  # type: ignore[return-value]

    sensor, clock = FakeSensor(), Clock()
    with GenicamCamera(
        lambda: Slow(sensor), GenicamSettings(pixel_format="Mono8"), clock, clock.sleep
    ) as eye:
        assert eye.snap().frame_id == 65402


def test_no_trigger_is_given_before_the_camera_is_ready() -> None:
    sensor = FakeSensor(busy=5)
    with camera(sensor) as eye:
        assert eye.snap().pixels[0, 0] == 1
        assert eye.counts.late == 0


def test_a_camera_that_delivers_nothing_sound_says_why() -> None:
    with (
        camera(FakeSensor(faults=["bad"] * 10_000)) as eye,
        pytest.raises(DeviceError, match=r"no sound frame within 50 ms.*packets are missing"),
    ):
        eye.snap(timeout_ms=50)


def test_a_lost_camera_is_found_and_set_up_again() -> None:
    sensor, clock = FakeSensor(), Clock()
    eye = camera(sensor, clock, reconnect_s=5.0)
    eye.configure(40.0)
    before = eye.snap()
    sensor.is_gone = True
    with pytest.raises(DeviceError, match=r"was lost .* did not come back within 5 s .*Check cable"):
        eye.snap()
    # Plugged in again, as it is delivered: automatic, with another exposure.
    sensor.is_gone, sensor.features = False, FakeSensor().features
    after = eye.snap()
    assert after.exposure_ms == 40.0
    assert after.frame_id > before.frame_id
    assert sensor.features["GainAuto"] == "Off"
    assert eye.counts.reopened == 1


def test_a_camera_that_comes_back_while_it_is_searched_for_gives_the_frame() -> None:
    sensor, clock = FakeSensor(), Clock()
    eye = camera(sensor, clock)

    def sleep(seconds: float) -> None:
        clock.now_s += seconds
        sensor.is_gone = clock.now_s < 3.0

    eye._sleep = sleep
    sensor.is_gone = True
    assert eye.snap().pixels.shape == (48, 64)


@pytest.mark.parametrize("during_a_trigger", [False, True])
def test_a_camera_that_restarts_unnoticed_is_set_up_again(during_a_trigger: bool) -> None:
    sensor = FakeSensor()
    default = dict(sensor.features)
    lost_on_the_way = FakePort.execute

    class Restarting(FakePort):
        def execute(self, command: str) -> None:
            if during_a_trigger and sensor.taken == 1:
                sensor.features.update(default, PixelFormat="BayerRG16")
                sensor.faults = ["lost"]
                sensor.taken += 1
            lost_on_the_way(self, command)

    clock = Clock()
    chosen = GenicamSettings(pixel_format="BayerRG16", adc_bits=12)
    with GenicamCamera(lambda: Restarting(sensor), chosen, clock, clock.sleep) as eye:
        eye.configure(2.0)
        set_up = dict(sensor.features)
        eye.snap()
        if not during_a_trigger:
            sensor.features.update(default)
        assert eye.snap().exposure_ms == 2.0
        assert sensor.features == set_up
        assert eye.counts.reopened == 1


def test_frames_of_another_format_have_the_camera_set_up_again() -> None:
    sensor = FakeSensor()
    with camera(sensor) as eye:
        eye.snap()
        sensor.features["PixelFormat"] = "BayerRG12p"
        with pytest.raises(DeviceError, match="BayerRG12p instead of"):
            eye.snap()
        assert eye.snap().pixels.dtype == np.uint16
        assert sensor.features["PixelFormat"] == "BayerRG16"


def test_another_camera_in_its_place_is_refused() -> None:
    sensor = FakeSensor()
    eye = camera(sensor)
    sensor.is_gone = True
    with pytest.raises(DeviceError, match="was lost"):
        eye.snap()
    sensor.is_gone, sensor.serial = False, "F2"
    with pytest.raises(DeviceError, match="another one answered"):
        eye.snap()


def test_a_camera_that_was_restarted_is_opened_again_at_the_second_refusal() -> None:
    sensor = FakeSensor()
    eye = camera(sensor)
    sensor.is_stale = True
    with pytest.raises(DeviceError, match="Another program controls"):
        eye.snap()
    # As a runner tries again: the exposure is accepted, which proves nothing.
    assert eye.configure(10.0) == 10.0
    assert eye.snap().pixels[0, 0] == 1
    assert eye.counts.reopened == 1


def test_an_exposure_is_what_the_camera_says_it_is() -> None:
    sensor = FakeSensor()
    with camera(sensor) as eye:
        # With its frame rate in the way, it would be clipped to 8 ms.
        assert eye.configure(320.0) == 320.0
        assert eye.snap().exposure_ms == 320.0
        for wrong in (float("nan"), 0.001, 1e6):
            with pytest.raises(DeviceError, match=r"exposes 0\.019 to 30000 ms"):
                eye.configure(wrong)


def test_pixels_that_use_the_lowest_bits_are_not_cut() -> None:
    with camera(FakeSensor(wrong_pixels=True)) as eye, pytest.raises(DeviceError, match="lowest 4 of 16"):
        eye.snap()


def test_temperature_and_a_closed_camera() -> None:
    eye = camera(FakeSensor())
    assert eye.temperature_c == 41.5
    eye.close()
    with pytest.raises(DeviceError, match="is closed"):
        eye.snap()


def test_a_camera_that_cannot_be_set_up_is_let_go() -> None:
    opened: list[FakePort] = []

    def port() -> FakePort:
        opened.append(FakePort(FakeSensor()))
        return opened[-1]

    with pytest.raises(DeviceError, match="60 dB"):
        GenicamCamera(port, GenicamSettings(gain_db=60.0))
    assert [each.closed for each in opened] == [True]
