"""USB3 Vision and GigE Vision cameras of all makers, by Aravis."""

from __future__ import annotations

import ctypes
import time
from typing import Any

from dsl_core.devices.driver_table import Driver, FoundDevice
from dsl_core.devices.drivers.aravis_library import BRINGS, AravisLibrary, aravis
from dsl_core.devices.drivers.genicam.camera import GenicamCamera
from dsl_core.devices.drivers.genicam.pixel_formats import pixel_format
from dsl_core.devices.drivers.genicam.port import RawFrame
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.errors import DeviceError

_BUFFERS = 4
#: What the values of ArvBufferStatus mean, from 0.
_STATUS = (
    "", "it was cleared", "its time ran out", "packets are missing", "a packet has a wrong id",
    "it does not fit its buffer", "it was still being filled", "acquisition ended", "its payload is unknown",
)  # fmt: skip


class AravisPort:
    """One camera, by the functions of the library."""

    def __init__(self, library: AravisLibrary, identifier: str) -> None:
        """Open a camera by Aravis' id, serial number or address; the only one if that is empty."""
        self._call = library.call
        chosen = _choose(library, identifier)
        self._stream: int | None = None
        self._camera: int | None = self._call("arv_camera_new", chosen.encode())
        self._format, self._payload = "", 0
        try:
            self._device = self._call("arv_camera_get_device", self._camera)
            names = [self._text(f"arv_camera_get_{part}_name") for part in ("vendor", "model")]
            self.model = " ".join(names)
            self.serial = self._text("arv_camera_get_device_serial_number")
        except BaseException:
            self.close()
            raise

    def has(self, feature: str) -> bool:
        """Whether the camera has a feature, now."""
        return bool(self._call("arv_camera_is_feature_available", self._camera, feature.encode()))

    def can_write(self, feature: str) -> bool:
        """Whether a feature can be set; Aravis tells only when it is tried."""
        if not self.has(feature):
            return False
        try:
            self.write(feature, self.read(feature))
        except DeviceError:
            return False
        return True

    def choices(self, feature: str) -> list[str]:
        """Values that a feature of named values can have now."""
        count = ctypes.c_uint()
        name = "arv_camera_dup_available_enumerations_as_strings"
        found = self._call(name, self._camera, feature.encode(), ctypes.byref(count))
        names = [found[i].decode() for i in range(count.value)]
        self._call("g_free", found)
        return names

    def read(self, feature: str) -> float | str:
        """A feature's value."""
        value = self._call(f"arv_camera_get_{self._kind(feature)}", self._camera, feature.encode())
        return value.decode() if isinstance(value, bytes) else value

    def write(self, feature: str, value: float | str) -> None:
        """Set a feature."""
        kind = self._kind(feature)
        try:
            given: Any = {"string": str, "float": float}.get(kind, int)(value)
        except ValueError as error:
            raise DeviceError(f"The feature {feature} takes a number, not {value!r}. Correct it.") from error
        if isinstance(given, str):
            given = given.encode()
        self._call(f"arv_camera_set_{kind}", self._camera, feature.encode(), given)

    def bounds(self, feature: str) -> tuple[float, float]:
        """Smallest and largest value of a number."""
        kind = self._kind(feature)
        number = ctypes.c_double if kind == "float" else ctypes.c_int64
        low, high = number(), number()
        self._call(
            f"arv_camera_get_{kind}_bounds",
            self._camera, feature.encode(), ctypes.byref(low), ctypes.byref(high),
        )  # fmt: skip
        return float(low.value), float(high.value)

    def execute(self, command: str) -> None:
        """Do what a command feature does."""
        self._call("arv_camera_execute_command", self._camera, command.encode())

    def start(self) -> None:
        """Begin to acquire, with a stream of its own."""
        self._format = str(self.read("PixelFormat"))
        self._payload = self._call("arv_camera_get_payload", self._camera)
        stream = self._call("arv_camera_create_stream", self._camera, None, None)
        self._stream = stream
        for _ in range(_BUFFERS):
            self._call("arv_stream_push_buffer", stream, self._call("arv_buffer_new_allocate", self._payload))
        self._call("arv_camera_start_acquisition", self._camera)

    def stop(self) -> None:
        """End to acquire; the stream goes before another is made, or that one gets no frames."""
        self._call("arv_camera_stop_acquisition", self._camera)
        self._drop_stream()

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait while the camera says that it is not ready."""
        if not (self.has("AcquisitionStatusSelector") and self.has("AcquisitionStatus")):
            return True
        self.write("AcquisitionStatusSelector", "FrameTriggerWait")
        until_s = time.monotonic() + timeout_s
        while not self.read("AcquisitionStatus"):
            if time.monotonic() >= until_s:
                return False
            time.sleep(0.001)
        return True

    def fetch(self, timeout_s: float) -> RawFrame | None:
        """The next frame, copied; its buffer goes back at once."""
        if self._stream is None:
            raise DeviceError("The camera acquires nothing. Open the rig again.")
        micros = max(int(1e6 * timeout_s), 0)
        buffer = self._call("arv_stream_timeout_pop_buffer", self._stream, micros)
        if not buffer:
            return None
        try:
            return self._copy(buffer)
        finally:
            self._call("arv_stream_push_buffer", self._stream, buffer)

    def close(self) -> None:
        """Stop and let go of the camera, a lost one too."""
        camera, self._camera = self._camera, None
        if not camera:
            return
        try:
            self._call("arv_camera_stop_acquisition", camera)
        except DeviceError:
            pass  # it is lost: there is nothing to stop
        finally:
            self._drop_stream()
            self._call("g_object_unref", camera)

    def _copy(self, buffer: int) -> RawFrame:
        status = self._call("arv_buffer_get_status", buffer)
        if status != 0:
            known = _STATUS[status] if 0 < status < len(_STATUS) else f"status {status}"
            return RawFrame(b"", 0, 0, self._format, 0, f"a frame was bad: {known}")
        width, height = (self._call(f"arv_buffer_get_image_{side}", buffer) for side in ("width", "height"))
        size = ctypes.c_size_t()
        data = self._call("arv_buffer_get_data", buffer, ctypes.byref(size))
        chosen = pixel_format(self._format)
        wanted = chosen.size_bytes(width, height) if chosen is not None else size.value
        copied = ctypes.string_at(data, min(wanted, size.value))
        number = self._call("arv_buffer_get_frame_id", buffer)
        return RawFrame(copied, width, height, self._format, number)

    def _drop_stream(self) -> None:
        stream, self._stream = self._stream, None
        if stream:
            self._call("g_object_unref", stream)

    def _kind(self, feature: str) -> str:
        """Which of Aravis' families of functions a feature belongs to."""
        node = self._call("arv_device_get_feature", self._device, feature.encode())
        if not node:
            raise DeviceError(
                f"The camera {self.model} has no feature {feature}. Take it out of the profile's features."
            )
        for name, kind in (
            ("enumeration", "string"),
            ("boolean", "boolean"),
            ("float", "float"),
            ("integer", "integer"),
        ):
            family = self._call(f"arv_gc_{name}_get_type")
            if self._call("g_type_check_instance_is_a", node, family):
                return kind
        return "string"

    def _text(self, function: str) -> str:
        return (self._call(function, self._camera) or b"").decode(errors="replace")


def _choose(library: AravisLibrary, identifier: str) -> str:
    """Aravis' id of a camera that is there; the list must be updated first, or no frame ever arrives."""
    seen = _seen(library)
    matching = [each for each in seen if identifier in ("", *each)]
    if len(matching) == 1:
        return matching[0][0]
    there = "; ".join(f"{each[0]} (serial number {each[1]}, at {each[2]})" for each in seen) or "none"
    if not matching:
        raise DeviceError(
            f"No camera {identifier!r} is connected; connected: {there}. Check cable, power and network, and"
            " that this user may use USB cameras (Aravis' udev rules)."
            if identifier
            else "No camera by USB3 or GigE Vision is connected. Check cable, power and network, and that"
            " this user may use USB cameras (Aravis' udev rules)."
        )
    raise DeviceError(f"Several cameras are connected: {there}. Say which in the profile, by id.")


def _seen(library: AravisLibrary) -> list[tuple[str, str, str]]:
    """Id, serial number and address of each camera there is now."""
    library.call("arv_update_device_list")
    names = ("id", "serial_nbr", "address")
    return [
        tuple((library.call(f"arv_get_device_{name}", i) or b"").decode(errors="replace") for name in names)  # type: ignore[misc]
        for i in range(library.call("arv_get_n_devices"))
    ]


def find_cameras() -> list[FoundDevice]:
    """Cameras that are connected now; raises `DeviceError` without the library."""
    return [
        FoundDevice({"id": identifier}, f"{identifier}, serial number {serial}, at {address}")
        for identifier, serial, address in _seen(aravis())
    ]


def open_camera(settings: GenicamSettings) -> GenicamCamera:
    """Open a camera; raises `DeviceError`."""
    library = aravis()
    return GenicamCamera(lambda: AravisPort(library, settings.id), settings)


DRIVER = Driver("USB3 Vision and GigE Vision, any maker", GenicamSettings, open_camera, find_cameras, BRINGS)
