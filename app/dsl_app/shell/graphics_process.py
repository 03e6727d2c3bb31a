"""What draws on this computer, as a program of its own: a graphics driver that aborts takes nothing along.

It prints a JSON object: the screens as Qt sees them, and what VTK draws point clouds with.
"""

from __future__ import annotations

import json
import os
import sys

from dsl_app.shared.display import has_screen


def screens() -> list[str]:
    """Name, size in real pixels and rate of every screen; none where there is no display."""
    if not has_screen(sys.platform, os.environ):
        return []
    from PySide6.QtGui import QGuiApplication

    application = QGuiApplication(sys.argv[:1])
    found = []
    for screen in application.screens():
        size, ratio = screen.size(), screen.devicePixelRatio()
        real = f"{round(size.width() * ratio)} × {round(size.height() * ratio)} px"
        found.append(f"{screen.name()} {real}, scale {ratio:g}, {screen.refreshRate():.0f} Hz")
    return found


def opengl() -> dict[str, str]:
    """Vendor, renderer and version of the OpenGL that draws off screen; empty where VTK has none."""
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - brings the window that the factory makes
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetSize(16, 16)
    window.Render()
    told = (line.partition(" string:") for line in window.ReportCapabilities().splitlines())
    return {name.strip().removeprefix("OpenGL "): value.strip() for name, sign, value in told if sign}


def main() -> int:
    """Print what is found; the OpenGL comes last, since it may end the process."""
    print(json.dumps({"screens": screens()}), flush=True)
    print(json.dumps({"opengl": opengl()}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
