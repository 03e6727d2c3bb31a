"""Cameras are set up in the order they need, read back, and refused with a sentence for what they lack."""

from __future__ import annotations

import pytest

from dsl_core.devices.drivers.genicam.preparing import prepare
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError
from tests.devices.drivers.genicam.fake_port import FakePort, FakeSensor


def no_wait(seconds: float) -> None:
    pass


def test_everything_automatic_is_off_before_gain_and_trigger() -> None:
    sensor = FakeSensor()
    found = prepare(FakePort(sensor), GenicamSettings(gain_db=3.0), no_wait)
    features, written = sensor.features, sensor.written
    for name in ("ExposureAuto", "GainAuto", "BalanceWhiteAuto"):
        assert features[name] == "Off"
        assert written.index(name) < written.index("Gain")
    assert (features["ExposureMode"], features["GammaEnabled"]) == ("Timed", 0)
    assert (features["TriggerMode"], features["TriggerSource"]) == ("On", "Software")
    assert features["TriggerSelector"] == "FrameStart"
    assert written.index("AcquisitionFrameRate") < written.index("Gain")
    # Locked until they have settled, so a gain that was written too early is not there.
    assert (found.gain_db, features["Gain"]) == (3.0, 3.0)
    assert found.exposure_range_ms == (0.019, 30_000.0)
    assert (found.format.name, found.bit_depth, found.size_px) == ("BayerRG16", 16, (64, 48))


def test_region_and_binning_are_of_the_sensor() -> None:
    settings = GenicamSettings(region_px=(8, 4, 48, 40), binning=2, adc_bits=12)
    found = prepare(FakePort(FakeSensor()), settings, no_wait)
    assert found.size_px == (24, 20)
    assert (found.region_px, found.binning, found.bit_depth) == ((8, 4, 48, 40), 2, 12)


@pytest.mark.parametrize(
    ("features", "mirrored"),
    [
        ({}, "off"),
        ({"ReverseX": 0.0, "ReverseY": 0.0}, "off"),
        ({"ReverseX": 1.0}, "left to right"),
        ({"ReverseX": 0.0, "ReverseY": 1.0}, "top to bottom"),
        ({"ReverseX": 1.0, "ReverseY": 1.0}, "both ways"),
    ],
)
def test_how_a_camera_turns_its_picture_is_noted_and_left(features: dict[str, float], mirrored: str) -> None:
    sensor = FakeSensor()
    sensor.features.update(features)
    assert prepare(FakePort(sensor), GenicamSettings(), no_wait).mirrored == mirrored
    assert features.items() <= sensor.features.items()


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"region_px": (0, 0, 65, 48)}, "Width from 16 to 64"),
        ({"region_px": (1, 0, 32, 32)}, "odd pixel"),
        ({"pixel_format": "BayerRG10"}, "it offers Mono8, BayerRG8, BayerRG16, BayerRG12p"),
        ({"pixel_format": "RGB8"}, "no raw pixel format 'RGB8'"),
        ({"gain_db": 60.0}, "0 to 24 dB, not 60 dB"),
        ({"features": {"Gamna": 1.0}}, "no Gamna"),
    ],
)
def test_what_the_camera_cannot_do_is_refused(settings: dict[str, object], reason: str) -> None:
    with pytest.raises(DeviceError, match=reason):
        prepare(FakePort(FakeSensor()), GenicamSettings.model_validate(settings), no_wait)


def test_an_automatic_that_stays_on_is_named() -> None:
    sensor = FakeSensor(settles_after=10_000)
    with pytest.raises(DeviceError, match=r"keeps .*Auto at Continuous instead of Off"):
        prepare(FakePort(sensor), GenicamSettings(), no_wait)


@pytest.mark.parametrize(
    ("lack", "reason"),
    [
        ("ExposureTime", "cannot set its exposure"),
        ("TriggerSoftware", "cannot be triggered by software"),
        ("Gain", "no gain in dB"),
    ],
)
def test_a_camera_that_lacks_something_is_refused(lack: str, reason: str) -> None:
    sensor = FakeSensor()
    del sensor.features[lack]
    with pytest.raises(DeviceError, match=reason):
        prepare(FakePort(sensor), GenicamSettings(gain_db=1.0), no_wait)


def test_a_region_that_the_camera_rounds_is_not_taken_silently() -> None:
    class Rounding(FakePort):
        def write(self, feature: str, value: float | str) -> None:
            super().write(feature, float(value) // 16 * 16 if feature == "Width" else value)

    with pytest.raises(DeviceError, match="reads 32 x 32 pixels"):
        prepare(Rounding(FakeSensor()), GenicamSettings(region_px=(0, 0, 40, 32)), no_wait)
