"""Basler cameras by the maker's own library (extra ``basler``), whose emulator is a camera of ours, too."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.devices.drivers.genicam.camera import GenicamCamera
from dsl_core.devices.drivers.genicam.port import RawFrame
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError
from dsl_core.extras import pip_command

BRINGS = f"pypylon: {pip_command('basler')} (Basler's terms, 240 MB)"


def pylon() -> tuple[Any, Any]:
    """The library, and its part for features; raises `DeviceError` that says what brings it."""
    try:
        with warnings.catch_warnings():
            # Its wrapper warns while it is imported, and crashes the program where warnings are errors.
            warnings.simplefilter("ignore")
            from pypylon import genicam
            from pypylon import pylon as library
    except ImportError as error:
        raise DeviceError(f"Basler cameras need a library that is missing. Install {BRINGS}.") from error
    return library, genicam


class BaslerPort:
    """One camera, by pylon."""

    def __init__(self, libraries: tuple[Any, Any], identifier: str) -> None:
        """Open a camera by serial number or name; the only one if that is empty."""
        self._library, self._genicam = library, _ = libraries
        with _sentences(self._genicam):
            info = _choose(library, identifier)
            self.model = f"{info.GetVendorName()} {info.GetModelName()}"
            self.serial = str(info.GetSerialNumber())
            factory = library.TlFactory.GetInstance()
            self._camera = library.InstantCamera(factory.CreateDevice(info))
            self._camera.Open()
            self._nodes = self._camera.GetNodeMap()

    def has(self, feature: str) -> bool:
        """Whether the camera has a feature, now."""
        return self._told(lambda: self._genicam.IsAvailable(self._nodes.GetNode(feature)))

    def can_write(self, feature: str) -> bool:
        """Whether a feature can be set now."""
        return self._told(lambda: self._genicam.IsWritable(self._nodes.GetNode(feature)))

    def choices(self, feature: str) -> list[str]:
        """Values that a feature of named values can have now."""
        with _sentences(self._genicam):
            return [str(name) for name in self._node(feature).GetSymbolics()]

    def read(self, feature: str) -> float | str:
        """A feature's value."""
        with _sentences(self._genicam):
            value = self._node(feature).GetValue()
        return value if isinstance(value, str) else float(value)

    def write(self, feature: str, value: float | str) -> None:
        """Set a feature."""
        with _sentences(self._genicam):
            node = self._node(feature)
            now = node.GetValue()
            kind: Any = type(now) if isinstance(now, bool | int | float) else str
            node.SetValue(kind(value))

    def bounds(self, feature: str) -> tuple[float, float]:
        """Smallest and largest value of a number."""
        with _sentences(self._genicam):
            node = self._node(feature)
            return float(node.GetMin()), float(node.GetMax())

    def execute(self, command: str) -> None:
        """Do what a command feature does."""
        with _sentences(self._genicam):
            self._node(command).Execute()

    def start(self) -> None:
        """Begin to acquire."""
        with _sentences(self._genicam):
            self._camera.StartGrabbing(self._library.GrabStrategy_OneByOne)

    def stop(self) -> None:
        """End to acquire."""
        with _sentences(self._genicam):
            self._camera.StopGrabbing()

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait until a trigger will be taken: one that comes too early is lost without a word."""
        with _sentences(self._genicam):
            if not self._camera.CanWaitForFrameTriggerReady():
                return True
            mode = self._library.TimeoutHandling_Return
            return bool(self._camera.WaitForFrameTriggerReady(max(int(1000 * timeout_s), 1), mode))

    def fetch(self, timeout_s: float) -> RawFrame | None:
        """The next frame, copied."""
        with _sentences(self._genicam):
            mode = self._library.TimeoutHandling_Return
            result = self._camera.RetrieveResult(max(int(1000 * timeout_s), 1), mode)
            if not result.IsValid():
                return None
            try:
                if not result.GrabSucceeded():
                    reason = str(result.ErrorDescription).strip() or "no reason given"
                    return RawFrame(b"", 0, 0, "", 0, f"a frame was bad: {reason}")
                name = str(self._node("PixelFormat").GetValue())
                data = bytes(result.GetBuffer())
                return RawFrame(data, result.Width, result.Height, name, int(result.BlockID))
            finally:
                result.Release()

    def close(self) -> None:
        """Stop and let go of the camera, a lost one too."""
        try:
            self._camera.Close()
            self._camera.DestroyDevice()
        except self._genicam.GenericException:
            return  # it is lost: there is nothing to close

    def _node(self, feature: str) -> Any:
        node = self._nodes.GetNode(feature)
        if not self._genicam.IsAvailable(node):
            raise DeviceError(
                f"The camera {self.model} has no feature {feature}. Take it out of the profile's features."
            )
        return node

    def _told(self, ask: Callable[[], Any]) -> bool:
        with _sentences(self._genicam):
            return bool(ask())


@contextmanager
def _sentences(genicam: Any) -> Iterator[None]:
    """Turn pylon's exceptions into `DeviceError`."""
    try:
        yield
    except genicam.GenericException as error:
        text = str(error).split(" : ")[0].strip()
        raise DeviceError(f"pylon reports: {text} Check the camera and its settings.") from error


def _choose(library: Any, identifier: str) -> Any:
    seen = list(library.TlFactory.GetInstance().EnumerateDevices())
    matching = [
        each for each in seen if identifier in ("", str(each.GetSerialNumber()), str(each.GetFriendlyName()))
    ]
    if len(matching) == 1:
        return matching[0]
    there = "; ".join(str(each.GetFriendlyName()) for each in seen) or "none"
    if matching:
        raise DeviceError(f"Several Basler cameras are connected: {there}. Say which in the profile, by id.")
    which = f"No Basler camera {identifier!r} is connected; connected: {there}."
    raise DeviceError(
        f"{which if identifier else 'No Basler camera is connected.'} Check cable, power and network."
    )


def find_cameras() -> list[FoundDevice]:
    """Basler cameras that are connected now; raises `DeviceError` without the library."""
    seen = pylon()[0].TlFactory.GetInstance().EnumerateDevices()
    return [FoundDevice({"id": str(d.GetSerialNumber())}, str(d.GetFriendlyName())) for d in seen]


def open_camera(settings: GenicamSettings) -> GenicamCamera:
    """Open a camera; raises `DeviceError`."""
    libraries = pylon()
    return GenicamCamera(lambda: BaslerPort(libraries, settings.id), settings)


DRIVER = Driver("Basler cameras by pylon", GenicamSettings, open_camera, find_cameras, BRINGS)
