"""Cameras of any maker that brings a GenTL producer, by harvesters (extra ``genicam``)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import Field

from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.devices.drivers.genicam.camera import GenicamCamera
from dsl_core.devices.drivers.genicam.port import RawFrame
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError
from dsl_core.extras import pip_command

BRINGS = f"harvesters and genicam: {pip_command('genicam')}; the producer (.cti) comes with the camera"
#: Where the standard says that producers are installed.
FOLDERS = "GENICAM_GENTL64_PATH"


class GentlSettings(GenicamSettings):
    """A camera, and the file of its maker through which it is reached."""

    producer: str = Field(
        default="", description=f"the maker's .cti file; all in the folders of {FOLDERS} if not given"
    )


def harvesters() -> tuple[Any, Any]:
    """The two libraries; raises `DeviceError` that says what brings them."""
    try:
        from genicam import genapi
        from harvesters import core
    except ImportError as error:
        raise DeviceError(f"GenTL cameras need libraries that are missing. Install {BRINGS}.") from error
    return core, genapi


class GentlPort:
    """One camera, by harvesters."""

    def __init__(self, libraries: tuple[Any, Any], producer: str, identifier: str) -> None:
        """Open a camera by id or serial number; the only one if that is empty."""
        self._core, self._genapi = libraries
        self._harvester = _harvest(self._core, producer)
        self._image: Any = None
        try:
            with _sentences():
                index, info = _choose(self._harvester, identifier)
                self.model = f"{info.vendor} {info.model}"
                self.serial = str(info.serial_number)
                self._image = self._harvester.create(index)
                self._nodes = self._image.remote_device.node_map
        except BaseException:
            self.close()
            raise

    def has(self, feature: str) -> bool:
        """Whether the camera has a feature, now."""
        return self._told(feature, self._genapi.is_available)

    def can_write(self, feature: str) -> bool:
        """Whether a feature can be set now."""
        return self._told(feature, self._genapi.is_writable)

    def choices(self, feature: str) -> list[str]:
        """Values that a feature of named values can have now."""
        with _sentences():
            return [str(name) for name in self._node(feature).symbolics]

    def read(self, feature: str) -> float | str:
        """A feature's value."""
        with _sentences():
            value = self._node(feature).value
        return value if isinstance(value, str) else float(value)

    def write(self, feature: str, value: float | str) -> None:
        """Set a feature."""
        with _sentences():
            node = self._node(feature)
            now = node.value
            kind: Any = type(now) if isinstance(now, bool | int | float) else str
            node.value = kind(value)

    def bounds(self, feature: str) -> tuple[float, float]:
        """Smallest and largest value of a number."""
        with _sentences():
            node = self._node(feature)
            return float(node.min), float(node.max)

    def execute(self, command: str) -> None:
        """Do what a command feature does."""
        with _sentences():
            self._node(command).execute()

    def start(self) -> None:
        """Begin to acquire."""
        with _sentences():
            self._image.start()

    def stop(self) -> None:
        """End to acquire."""
        with _sentences():
            self._image.stop()

    def wait_ready(self, timeout_s: float) -> bool:
        """The standard has no common way to ask; a trigger that is lost is given again."""
        return True

    def fetch(self, timeout_s: float) -> RawFrame | None:
        """The next whole frame, copied; harvesters itself drops those that are not."""
        with _sentences():
            buffer = self._image.try_fetch(timeout=max(timeout_s, 1e-3))
            if buffer is None:
                return None
            try:
                part = buffer.payload.components[0]
                number = int(buffer.module.frame_id)
                return RawFrame(part.data.tobytes(), part.width, part.height, str(part.data_format), number)
            finally:
                buffer.queue()

    def close(self) -> None:
        """Stop and let go of the camera and its producer, lost ones too."""
        image, self._image = self._image, None
        try:
            with _sentences():
                if image is not None:
                    image.destroy()
                self._harvester.reset()
        except DeviceError:
            return  # it is lost: there is nothing to close

    def _node(self, feature: str) -> Any:
        if not self._nodes.has_node(feature):
            raise DeviceError(
                f"The camera {self.model} has no feature {feature}. Take it out of the profile's features."
            )
        return self._nodes.get_node(feature)

    def _told(self, feature: str, ask: Callable[[Any], Any]) -> bool:
        with _sentences():
            return bool(self._nodes.has_node(feature) and ask(self._nodes.get_node(feature)))


@contextmanager
def _sentences() -> Iterator[None]:
    """Turn whatever a producer raises into `DeviceError`; its exceptions have no common base but this."""
    try:
        yield
    except DeviceError:
        raise
    except Exception as error:
        raise DeviceError(
            f"The camera's producer reports: {error}. Check the camera and its settings."
        ) from error


def _producers(named: str) -> list[str]:
    """Files of the producers to ask; raises `DeviceError` where there are none."""
    if named:
        if not Path(named).is_file():
            raise DeviceError(f"There is no producer {named}. Correct producer in the profile.")
        return [named]
    folders = [folder for folder in os.environ.get(FOLDERS, "").split(os.pathsep) if folder]
    found = sorted(str(path) for folder in folders for path in Path(folder).glob("*.cti"))
    if not found:
        raise DeviceError(
            f"No GenTL producer is installed: {FOLDERS} names no folder with a .cti file. Install the camera"
            " maker's software, or give producer in the profile."
        )
    return found


def _harvest(core: Any, producer: str) -> Any:
    harvester = core.Harvester()
    for path in _producers(producer):
        harvester.add_file(path)
    with _sentences():
        harvester.update()
    return harvester


def _choose(harvester: Any, identifier: str) -> tuple[int, Any]:
    seen = list(harvester.device_info_list)
    names = [(str(info.id_), str(info.serial_number)) for info in seen]
    matching = [i for i, known in enumerate(names) if identifier in ("", *known)]
    if len(matching) == 1:
        return matching[0], seen[matching[0]]
    there = "; ".join(f"{name} (serial number {serial})" for name, serial in names) or "none"
    if matching:
        raise DeviceError(f"Several cameras are connected: {there}. Say which in the profile, by id.")
    which = f"No camera {identifier!r} is connected; connected: {there}."
    raise DeviceError(
        f"{which if identifier else 'The producer sees no camera.'} Check cable, power and network."
    )


def find_cameras() -> list[FoundDevice]:
    """Cameras that the installed producers see; raises `DeviceError` without libraries or producers."""
    core, _ = harvesters()
    harvester = _harvest(core, "")
    try:
        return [
            FoundDevice(
                {"id": str(info.id_)}, f"{info.vendor} {info.model}, serial number {info.serial_number}"
            )
            for info in harvester.device_info_list
        ]
    finally:
        harvester.reset()


def open_camera(settings: GentlSettings) -> GenicamCamera:
    """Open a camera; raises `DeviceError`."""
    libraries = harvesters()
    return GenicamCamera(lambda: GentlPort(libraries, settings.producer, settings.id), settings)


DRIVER = Driver("any camera with a GenTL producer", GentlSettings, open_camera, find_cameras, BRINGS)
