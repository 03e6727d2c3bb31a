"""What a person who helps from afar asks first: versions, graphics, devices, memory, as lines to send."""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from dsl_core.extras import EXTRA_OF
from dsl_core.resources import expanded
from dsl_core.solve.limits import free_memory_bytes, usable_cores
from dsl_core.version import __version__

#: Draws and lists screens in a process of its own; named, as the engine imports no window.
GRAPHICS = "dsl_app.shell.graphics_process"
#: What the extras bring, by its name at the registry.
_OF_EXTRAS = (
    "torch",
    "numba",
    "opencv-contrib-python-headless",
    "PySide6-Essentials",
    "vtk",
    "pyvista",
    "pyqtgraph",
    "rawpy",
)
_PACKAGES = ("numpy", "scipy", "zarr", "numcodecs", "xarray", "pydantic", "typer", "OpenEXR")
_DRIVERS = ("pyserial", "zaber-motion", "seabreeze", "pypylon", "genicam", "harvesters")
_GRAPHICS_S = 60.0


def diagnosis(folder: Path, with_devices: bool = True) -> Iterator[tuple[str, str]]:
    """What is asked about and what was found, as pairs of texts, in their order.

    ``folder`` is where scans are to go. Without ``with_devices`` no driver looks for devices, which takes
    seconds. The name of the computer and of its user are left out.
    """
    yield "dsl-scan", f"{__version__}, {_home_as_tilde(str(Path(__file__).parents[2]))}"
    yield "Python", f"{platform.python_version()}, {_home_as_tilde(sys.executable)}"
    yield "system", f"{platform.system()} {platform.release()}, {platform.machine()}{_distribution()}"
    yield "processor", f"{os.cpu_count()} cores, {usable_cores()} for this program"
    yield "memory", _memory()
    yield "disk", f"{shutil.disk_usage(folder).free / 1e9:.1f} GB free where this was asked"
    for name in (*_PACKAGES, *_OF_EXTRAS, *_DRIVERS):
        yield name, _version(name)
    yield "graphics card", _card()
    yield from _graphics()
    if with_devices:
        yield from _devices()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _distribution() -> str:
    try:
        return f", {platform.freedesktop_os_release()['PRETTY_NAME']}"
    except (OSError, KeyError):  # Windows and macOS
        return ""


def _memory() -> str:
    import psutil

    total = psutil.virtual_memory().total
    return f"{free_memory_bytes() / 1e9:.1f} GB free for this program of {total / 1e9:.1f} GB"


def _card() -> str:
    try:
        import torch
    except ModuleNotFoundError:
        return f"not asked; torch is not installed (extra {EXTRA_OF['torch']!r})"
    if not torch.cuda.is_available():
        build = f"is built for CUDA {torch.version.cuda}" if torch.version.cuda else "is the CPU build"
        return f"none that torch can use; torch {build}"
    free, total = torch.cuda.mem_get_info()
    return f"{torch.cuda.get_device_name()}, {free / 1e9:.1f} GB free of {total / 1e9:.1f} GB"


def _graphics() -> Iterator[tuple[str, str]]:
    """Screens and OpenGL as another process finds them."""
    if _version("PySide6-Essentials") == "not installed":
        yield "screens", "not asked; the window is not installed (extra 'gui')"
        return
    said, ended = "", ""
    try:
        answer = subprocess.run(
            [sys.executable, "-m", GRAPHICS], capture_output=True, timeout=_GRAPHICS_S, check=False
        )
        said = answer.stdout.decode(errors="replace")
        ended = f"the process that asked ended with code {answer.returncode}: {_last_line(answer.stderr)}"
    except subprocess.TimeoutExpired as error:
        said = (error.stdout or b"").decode(errors="replace")
        ended = f"no answer within {_GRAPHICS_S:.0f} s"
    found: dict[str, object] = {}
    for line in said.splitlines():
        if line.startswith("{"):
            found |= json.loads(line)
    screens, opengl = found.get("screens"), found.get("opengl")
    if isinstance(screens, list):
        yield "screens", "; ".join(screens) or "none: neither DISPLAY nor WAYLAND_DISPLAY is set"
    else:
        yield "screens", ended
    if isinstance(opengl, dict):
        yield "OpenGL", ", ".join(map(str, opengl.values())) or "none found"
    else:
        yield "OpenGL", ended


def _last_line(text: bytes) -> str:
    lines = text.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else "it said nothing"


def _devices() -> Iterator[tuple[str, str]]:
    from dsl_core.devices.doctor import survey
    from dsl_core.devices.registry import list_rigs

    for rig in list_rigs():
        yield f"rig {rig.name}", rig.error or f"{rig.package} {rig.version}".strip()
    for finding in survey():
        yield finding.device, finding.text


def _home_as_tilde(path: str) -> str:
    home = str(expanded(Path("~")))
    return path.replace(home, "~", 1) if len(home) > 1 and path.startswith(home) else path
