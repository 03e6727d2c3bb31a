"""GenTL producers: the one in the genicam package is listed, streamed, and refused for what it lacks."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from dsl_core.devices.drivers import gentl
from dsl_core.devices.drivers.gentl import GentlPort, GentlSettings
from dsl_core.errors import DeviceError

_FOUND = importlib.util.find_spec("genicam")
needs_harvesters = pytest.mark.skipif(
    _FOUND is None or importlib.util.find_spec("harvesters") is None,
    reason=f"GenTL's libraries are missing: {gentl.BRINGS}",
)


@pytest.fixture
def producer() -> str:
    assert _FOUND is not None
    assert _FOUND.origin is not None
    return str(Path(_FOUND.origin).with_name("viky.cti"))


def test_without_the_libraries_a_sentence_says_what_brings_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "harvesters", None)
    for action in (gentl.find_cameras, lambda: gentl.open_camera(GentlSettings())):
        with pytest.raises(DeviceError, match=r'pip install "dsl-scan\[genicam\]"'):
            action()


def test_without_a_producer_it_is_said_where_one_was_looked_for(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(gentl.FOLDERS, str(tmp_path))
    with pytest.raises(DeviceError, match=r"GENICAM_GENTL64_PATH names no folder with a \.cti file"):
        gentl._producers("")
    with pytest.raises(DeviceError, match=r"no producer .*lost\.cti"):
        gentl._producers(str(tmp_path / "lost.cti"))
    (tmp_path / "maker.cti").touch()
    assert gentl._producers("") == [str(tmp_path / "maker.cti")]


@needs_harvesters
def test_cameras_are_listed_and_told_apart(producer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gentl.FOLDERS, str(Path(producer).parent))
    assert [dict(each.settings)["id"] for each in gentl.find_cameras()] == [
        "VikyTL_DEV_red",
        "VikyTL_DEV_green",
        "VikyTL_DEV_blue",
    ]
    with pytest.raises(DeviceError, match="Several cameras are connected: VikyTL_DEV_red"):
        gentl.open_camera(GentlSettings(producer=producer))


@needs_harvesters
def test_its_frames_are_streamed(producer: str) -> None:
    port = GentlPort(gentl.harvesters(), producer, "VikyTL_DEV_green")
    try:
        assert port.choices("PixelFormat") == ["RGBa8", "Mono8"]
        port.write("PixelFormat", "Mono8")
        port.start()
        frames = [port.fetch(2.0) for _ in range(5)]
        port.stop()
    finally:
        port.close()
    for frame in frames:
        assert frame is not None
        assert (frame.width, frame.height, len(frame.data), frame.fault) == (400, 400, 160_000, "")
    numbers = [frame.frame_id for frame in frames if frame is not None]
    assert numbers == sorted(set(numbers))


@needs_harvesters
def test_it_is_refused_because_it_has_no_exposure(producer: str) -> None:
    with pytest.raises(DeviceError, match="Viky 1 cannot set its exposure: it has no feature ExposureTime"):
        gentl.open_camera(GentlSettings(producer=producer, id="VikyTL_DEV_green"))
