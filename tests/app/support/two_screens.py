"""A private virtual display with an operator's and a projector's monitor that can be unplugged."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

from tests.app.support.virtual_display import virtual_display

PROJECTOR = "PROJECTOR"
OPERATOR_AREA, PROJECTOR_AREA = "1280/340x800/210+0+0", "1280/300x720/170+1280+0"


def missing_programs() -> list[str]:
    """Programs that two screens need and that are not installed."""
    return [name for name in ("Xvfb", "xrandr") if shutil.which(name) is None]


@contextmanager
def two_screens() -> Iterator[str]:
    """Start the display, yield its name like ``:7``, and stop it."""
    with virtual_display(2560, 800) as display:
        set_monitor(display, "OPERATOR", OPERATOR_AREA, "screen")
        plug(display)
        yield display


def set_monitor(display: str, name: str, area: str, output: str) -> None:
    """Define a monitor of the display."""
    _xrandr(display, "--setmonitor", name, area, output)


def plug(display: str) -> None:
    """Connect the projector."""
    set_monitor(display, PROJECTOR, PROJECTOR_AREA, "none")


def unplug(display: str) -> None:
    """Disconnect the projector."""
    _xrandr(display, "--delmonitor", PROJECTOR)


def _xrandr(display: str, *arguments: str) -> None:
    command = ["xrandr", "-display", display, *arguments]
    subprocess.run(command, check=True, capture_output=True, timeout=20)
