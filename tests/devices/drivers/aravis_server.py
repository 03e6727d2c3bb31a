"""Aravis' own GigE Vision camera on loopback, fed with pictures; also run by itself, to be killed."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Fills a picture of (height, width); it must be quick, or the camera misses its next trigger.
Paint = Callable[[int, int], NDArray[np.uint16]]
_PATTERN = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint
)


class AravisServer:
    """A camera that other programs on this computer see by GigE Vision."""

    def __init__(self, serial: str, paint: Paint | None = None) -> None:
        """Start it; raises `OSError` without the library."""
        library = ctypes.CDLL("libaravis-0.8.so.0")
        self._library, self._paint = library, paint
        for name, result, arguments in (
            ("arv_gv_fake_camera_new", ctypes.c_void_p, [ctypes.c_char_p] * 2),
            ("arv_gv_fake_camera_get_fake_camera", ctypes.c_void_p, [ctypes.c_void_p]),
            ("arv_gv_fake_camera_is_running", ctypes.c_int, [ctypes.c_void_p]),
            ("arv_fake_camera_set_fill_pattern", None, [ctypes.c_void_p, _PATTERN, ctypes.c_void_p]),
            ("arv_buffer_get_image_width", ctypes.c_int, [ctypes.c_void_p]),
            ("arv_buffer_get_image_height", ctypes.c_int, [ctypes.c_void_p]),
            ("arv_buffer_get_data", ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_void_p]),
            ("g_object_unref", None, [ctypes.c_void_p]),
        ):
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        self._server = library.arv_gv_fake_camera_new(b"127.0.0.1", serial.encode())
        if not library.arv_gv_fake_camera_is_running(self._server):
            raise OSError("Aravis' camera did not start; another one may hold its port.")
        self._callback = _PATTERN(self._fill)
        if paint is not None:
            camera = library.arv_gv_fake_camera_get_fake_camera(self._server)
            library.arv_fake_camera_set_fill_pattern(camera, self._callback, None)

    def _fill(self, buffer: int, data: Any, exposure_us: int, gain: int, pixel_format: int) -> None:
        assert self._paint is not None
        width = self._library.arv_buffer_get_image_width(buffer)
        height = self._library.arv_buffer_get_image_height(buffer)
        # The size that the buffer gives is still 0 here.
        target = self._library.arv_buffer_get_data(buffer, None)
        picture = np.ascontiguousarray(self._paint(height, width), "<u2")
        ctypes.memmove(target, picture.ctypes.data, picture.nbytes)

    def close(self) -> None:
        """Stop it."""
        server, self._server = self._server, None
        if server:
            self._library.g_object_unref(server)


def shown_in(path: str, width: int, height: int) -> Paint:
    """Pictures that are whatever a file of raw pixels holds at the time."""
    picture = np.memmap(path, np.uint16, "r", shape=(height, width))
    return lambda down, across: picture


if __name__ == "__main__":
    serial, *source = sys.argv[1:]
    kept = AravisServer(serial, shown_in(source[0], int(source[1]), int(source[2])) if source else None)
    print("ready", flush=True)
    sys.stdin.read()
