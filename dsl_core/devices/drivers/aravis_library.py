"""The functions of Aravis 0.8 that cameras need, called through ctypes.

Aravis (LGPL-2.1 or later) talks to USB3 Vision and GigE Vision cameras of all makers. It is not in the
program: the system's packages bring it.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from ctypes import c_char_p, c_double, c_int, c_int64, c_size_t, c_uint, c_uint64, c_void_p
from functools import lru_cache
from pathlib import Path
from typing import Any

from dsl_core.errors import DeviceError

BRINGS = "libaravis-0.8-0 (Debian, Ubuntu: apt install; macOS: brew install aravis; Windows: MSYS2)"
_NAMES = {
    "linux": ("libaravis-0.8.so.0",),
    "darwin": (
        "libaravis-0.8.0.dylib",
        # Where Homebrew puts libraries, which the loader does not search on every Mac.
        str(Path("/opt", "homebrew", "lib", "libaravis-0.8.0.dylib")),
        "/usr/local/lib/libaravis-0.8.0.dylib",
    ),
    "win32": ("libaravis-0.8-0.dll",),
}
_POINTERS = ctypes.POINTER(c_void_p)
_BOUNDS = (c_void_p, c_char_p, ctypes.POINTER(c_double), ctypes.POINTER(c_double))
_WHOLE_BOUNDS = (c_void_p, c_char_p, ctypes.POINTER(c_int64), ctypes.POINTER(c_int64))
#: Result and arguments of each function; those that can fail take a pointer to a GError as well.
_CAN_FAIL: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "arv_camera_new": (c_void_p, (c_char_p,)),
    "arv_camera_get_vendor_name": (c_char_p, (c_void_p,)),
    "arv_camera_get_model_name": (c_char_p, (c_void_p,)),
    "arv_camera_get_device_serial_number": (c_char_p, (c_void_p,)),
    "arv_camera_get_payload": (c_uint, (c_void_p,)),
    "arv_camera_start_acquisition": (None, (c_void_p,)),
    "arv_camera_stop_acquisition": (None, (c_void_p,)),
    "arv_camera_create_stream": (c_void_p, (c_void_p, c_void_p, c_void_p)),
    "arv_camera_execute_command": (None, (c_void_p, c_char_p)),
    "arv_camera_is_feature_available": (c_int, (c_void_p, c_char_p)),
    "arv_camera_dup_available_enumerations_as_strings": (
        ctypes.POINTER(c_char_p),
        (c_void_p, c_char_p, ctypes.POINTER(c_uint)),
    ),
    "arv_camera_get_string": (c_char_p, (c_void_p, c_char_p)),
    "arv_camera_set_string": (None, (c_void_p, c_char_p, c_char_p)),
    "arv_camera_get_float": (c_double, (c_void_p, c_char_p)),
    "arv_camera_set_float": (None, (c_void_p, c_char_p, c_double)),
    "arv_camera_get_float_bounds": (None, _BOUNDS),
    "arv_camera_get_integer": (c_int64, (c_void_p, c_char_p)),
    "arv_camera_set_integer": (None, (c_void_p, c_char_p, c_int64)),
    "arv_camera_get_integer_bounds": (None, _WHOLE_BOUNDS),
    "arv_camera_get_boolean": (c_int, (c_void_p, c_char_p)),
    "arv_camera_set_boolean": (None, (c_void_p, c_char_p, c_int)),
}
_CANNOT_FAIL: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "arv_update_device_list": (None, ()),
    "arv_get_n_devices": (c_uint, ()),
    "arv_get_device_id": (c_char_p, (c_uint,)),
    "arv_get_device_vendor": (c_char_p, (c_uint,)),
    "arv_get_device_model": (c_char_p, (c_uint,)),
    "arv_get_device_serial_nbr": (c_char_p, (c_uint,)),
    "arv_get_device_address": (c_char_p, (c_uint,)),
    "arv_camera_get_device": (c_void_p, (c_void_p,)),
    "arv_device_get_feature": (c_void_p, (c_void_p, c_char_p)),
    "arv_gc_node_get_type": (c_size_t, ()),
    "arv_gc_enumeration_get_type": (c_size_t, ()),
    "arv_gc_float_get_type": (c_size_t, ()),
    "arv_gc_integer_get_type": (c_size_t, ()),
    "arv_gc_boolean_get_type": (c_size_t, ()),
    "g_type_check_instance_is_a": (c_int, (c_void_p, c_size_t)),
    "arv_buffer_new_allocate": (c_void_p, (c_size_t,)),
    "arv_stream_push_buffer": (None, (c_void_p, c_void_p)),
    "arv_stream_try_pop_buffer": (c_void_p, (c_void_p,)),
    "arv_stream_timeout_pop_buffer": (c_void_p, (c_void_p, c_uint64)),
    "arv_buffer_get_status": (c_int, (c_void_p,)),
    "arv_buffer_get_data": (c_void_p, (c_void_p, ctypes.POINTER(c_size_t))),
    "arv_buffer_get_frame_id": (c_uint64, (c_void_p,)),
    "arv_buffer_get_image_width": (c_int, (c_void_p,)),
    "arv_buffer_get_image_height": (c_int, (c_void_p,)),
    "g_object_unref": (None, (c_void_p,)),
    "g_free": (None, (c_void_p,)),
    "g_error_free": (None, (c_void_p,)),
}


class _Error(ctypes.Structure):
    """GLib's GError."""

    _fields_ = (("domain", ctypes.c_uint32), ("code", c_int), ("message", c_char_p))


class AravisLibrary:
    """Calls by name; one that fails raises `DeviceError` with what Aravis says."""

    def __init__(self, library: Any) -> None:
        self._functions: dict[str, Any] = {}
        for table, fails in ((_CAN_FAIL, True), (_CANNOT_FAIL, False)):
            for name, (result, arguments) in table.items():
                function = getattr(library, name)
                function.restype = result
                function.argtypes = (*arguments, _POINTERS) if fails else arguments
                self._functions[name] = function

    def call(self, name: str, *arguments: Any) -> Any:
        """Call a function; the pointer to its error is added where it takes one."""
        function = self._functions[name]
        if name in _CANNOT_FAIL:
            return function(*arguments)
        failure = c_void_p()
        result = function(*arguments, ctypes.byref(failure))
        if failure:
            text = ctypes.cast(failure, ctypes.POINTER(_Error)).contents.message or b""
            self._functions["g_error_free"](failure)
            raise DeviceError(
                f"Aravis reports: {text.decode(errors='replace')}. Check the camera and its settings."
            )
        return result


@lru_cache(maxsize=1)
def aravis(load: Callable[[str], Any] = ctypes.CDLL) -> AravisLibrary:
    """The library of this computer; raises `DeviceError` that says what brings it."""
    for name in _NAMES.get(sys.platform, _NAMES["linux"]):
        try:
            return AravisLibrary(load(name))
        except OSError:
            continue
        except AttributeError as error:
            raise DeviceError(f"{name} lacks a function ({error}). Install 0.8.20 or later.") from error
    raise DeviceError(f"USB3 Vision and GigE Vision cameras need Aravis, which is missing. Install {BRINGS}.")
