"""Run by its test in a process of its own, on a display with two monitors: what the projector window does."""

from __future__ import annotations

import sys
import threading

import numpy as np
from dsl_app.rig.projector_window import ProjectorWindow, ScreenProjector, mirrors, pixel_size
from numpy.typing import NDArray
from PySide6.QtCore import QCoreApplication, QTimer
from PySide6.QtGui import QGuiApplication, QImage, QScreen
from PySide6.QtWidgets import QApplication

from dsl_core.devices.base import Projector, ProjectorInfo
from dsl_core.errors import DeviceError
from tests.app.support.two_screens import PROJECTOR, plug, set_monitor, unplug

application = QApplication(sys.argv)
display = sys.argv[1]


def wait(condition: object, seconds: float = 10.0) -> None:
    """Let events happen until a condition holds."""
    assert callable(condition)
    for _ in range(int(seconds / 0.02)):
        QCoreApplication.processEvents()
        if condition():
            return
        threading.Event().wait(0.02)
    raise AssertionError("waited in vain")


def screen(name: str) -> QScreen | None:
    return next((s for s in QGuiApplication.screens() if s.name() == name), None)


def pixels(of: QScreen) -> NDArray[np.uint8]:
    """What the frame buffer holds on a screen."""
    picture = of.grabWindow(0).toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(picture.constBits(), np.uint8).reshape(picture.height(), picture.bytesPerLine())
    return rows[:, : 3 * picture.width()].reshape(picture.height(), picture.width(), 3).copy()


def pattern(width: int, height: int) -> NDArray[np.uint8]:
    """All levels in all channels, a checker of single pixels, and noise."""
    image = np.random.default_rng(1).integers(0, 256, (height, width, 3), dtype=np.uint8)
    image[:256, :256] = np.arange(256, dtype=np.uint8)[:, None, None]
    image[:40, 256:] = 255 * (np.indices((40, width - 256)).sum(0) % 2)[..., None]
    return image


class RecordingProjector(Projector):
    """Counts what it is shown."""

    def __init__(self) -> None:
        self.shown = 0

    @property
    def info(self) -> ProjectorInfo:
        return ProjectorInfo("none", "", 640, 360, 1.0, 16.7)

    def show(self, image: NDArray[np.uint8]) -> None:
        self.shown += 1


def main() -> None:
    wait(lambda: screen(PROJECTOR) is not None)
    second = screen(PROJECTOR)
    assert second is not None
    window = ProjectorWindow()
    told: list[str] = []
    window.lost.connect(lambda name: told.append(f"lost {name}"))
    window.restored.connect(lambda name: told.append(f"restored {name}"))
    window.arm(second)
    wait(lambda: window.is_armed)

    image = pattern(*pixel_size(second))
    projector = ScreenProjector(window, latency_ms=1.0)
    errors: list[BaseException] = []

    def show(levels: NDArray[np.uint8]) -> None:
        try:
            projector.show(levels)
        except BaseException as error:  # handed to the main thread
            errors.append(error)

    worker = threading.Thread(target=show, args=(image,))
    worker.start()
    wait(lambda: not worker.is_alive())
    assert not errors, errors
    show(np.zeros((*image.shape[:2], 4), np.uint8))
    assert isinstance(errors.pop(), DeviceError)
    seen = pixels(second)
    assert seen.shape == image.shape, (seen.shape, image.shape)
    print("differing pixels at 1:1:", int((seen != image).any(2).sum()))

    half = pattern(640, 360)
    window.show_pixels(half)
    window.repaint()
    doubled = half.repeat(2, 0).repeat(2, 1)
    print("differing pixels at 1:2:", int((pixels(second) != doubled).any(2).sum()))

    unplug(display)
    wait(lambda: told == ["lost PROJECTOR"])
    assert not window.isVisible()
    assert window.lost_screen == PROJECTOR
    show(image)
    assert isinstance(errors.pop(), DeviceError)
    # Patterns that nobody sees would spoil a scan: the projector behind does not get them either.
    behind = RecordingProjector()
    try:
        ScreenProjector(window, behind).show(half)
    except DeviceError as error:
        print("lost:", error)
    assert behind.shown == 0
    plug(display)
    wait(lambda: told == ["lost PROJECTOR", "restored PROJECTOR"])
    assert not window.isVisible()
    window.disarm()
    assert not window.lost_screen
    ScreenProjector(window, behind).show(half)
    assert behind.shown == 1

    again = screen(PROJECTOR)
    assert again is not None
    window.arm(again)
    wait(lambda: window.is_armed)
    set_monitor(display, "MIRROR", "1280/300x720/170+1280+0", "none")
    wait(lambda: screen("MIRROR") is not None)
    second = screen(PROJECTOR)
    assert second is not None
    assert mirrors(second)
    wait(lambda: not window.isVisible())
    assert told[-1] == "lost PROJECTOR"
    window.disarm()
    try:
        window.arm(second)
    except DeviceError as error:
        print("mirrored:", error)
    QTimer.singleShot(0, application.quit)
    application.exec()


main()
