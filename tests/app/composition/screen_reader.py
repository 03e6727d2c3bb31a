"""Reads back what the projector's screen holds after every picture, and counts what differs."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QGuiApplication, QImage, QScreen

from dsl_core.devices.base import Projector, ProjectorInfo


def screen_of(name: str) -> QScreen | None:
    """The screen of a name."""
    return next((screen for screen in QGuiApplication.screens() if screen.name() == name), None)


def pixels_of(screen: QScreen) -> NDArray[np.uint8]:
    """What the frame buffer holds on a screen, shape (height, width, 3)."""
    picture = screen.grabWindow(0).toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(picture.constBits(), np.uint8).reshape(picture.height(), picture.bytesPerLine())
    return rows[:, : 3 * picture.width()].reshape(picture.height(), picture.width(), 3).copy()


class ScreenReader(QObject):
    """Stands before a projector on a screen; ``compared`` pictures had ``differing`` pixels in all."""

    _shown = Signal(object, object)

    def __init__(self, projector: Projector, screen: str) -> None:
        super().__init__()
        self._name = screen
        self.compared = self.differing = 0
        self.projector = _Watched(projector, self)
        self._shown.connect(self._compare)

    def read(self, image: NDArray[np.uint8]) -> None:
        """Compare a picture with the screen, in the window's thread; waits for the end."""
        done = threading.Event()
        self._shown.emit(image, done)
        assert done.wait(30)

    def _compare(self, image: NDArray[np.uint8], done: threading.Event) -> None:
        screen = screen_of(self._name)
        if screen is None:
            done.set()
            return
        seen = pixels_of(screen)
        levels = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
        factor = seen.shape[0] // levels.shape[0]
        wanted = levels.repeat(factor, 0).repeat(factor, 1)
        self.compared += 1
        self.differing += seen.size if seen.shape != wanted.shape else int((seen != wanted).any(2).sum())
        done.set()


class _Watched(Projector):
    def __init__(self, projector: Projector, reader: ScreenReader) -> None:
        self._projector, self._reader = projector, reader

    @property
    def info(self) -> ProjectorInfo:
        return self._projector.info

    def show(self, image: NDArray[np.uint8]) -> None:
        self._projector.show(image)
        self._reader.read(image)

    def close(self) -> None:
        self._projector.close()
