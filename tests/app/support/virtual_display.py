"""A private virtual display, so that windows are drawn where nobody sits."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager


def is_missing() -> bool:
    """Whether the virtual display is not installed."""
    return shutil.which("Xvfb") is None


@contextmanager
def virtual_display(width: int, height: int) -> Iterator[str]:
    """Start a display of one screen, yield its name like ``:7``, and stop it."""
    read, write = os.pipe()
    screen = f"{width}x{height}x24"
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", screen, "-nolisten", "tcp", "-noreset"],
        pass_fds=(write,),
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            yield f":{pipe.readline().strip()}"
    finally:
        server.terminate()
        server.wait(10)
