"""A cloud where there is no OpenGL: a picture drawn by numpy, and a sentence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

Points = NDArray[np.float32]


class StillScene:
    """Without OpenGL: a picture of the cloud, seen a little from the side, where even that can be made."""

    SENTENCE = (
        "No OpenGL was found to draw with, so the cloud cannot be turned here. Export it as PLY to turn it"
        " elsewhere, or install a graphics driver."
    )

    def __init__(self) -> None:
        self.widget = QWidget()
        self._picture, self._text = QLabel(), QLabel(self.SENTENCE)
        self._text.setWordWrap(True)
        self._text.setProperty("role", "muted")
        self._picture.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._picture.setAccessibleName("Picture of the point cloud")
        column = QVBoxLayout(self.widget)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._picture, 1)
        column.addWidget(self._text)
        self._background = "#000000"

    def show_cloud(self, points: Points, colours: NDArray[np.uint8], anew: bool = True) -> None:
        """Draw points into a picture without a window; it has one view."""
        picture = still_picture(points, colours, self._background)
        if picture is None:
            return
        height, width = picture.shape[:2]
        image = QImage(picture.data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()
        self._picture.setPixmap(QPixmap.fromImage(image))

    def show_marker(self, point: Points | None, colour: str) -> None:
        """A still picture has no marker."""

    def show_pins(self, points: Points, colours: NDArray[np.uint8]) -> None:
        """A still picture has no pins."""

    def set_background(self, colour: str) -> None:
        """The colour behind the next picture."""
        self._background = colour

    def projection(self) -> NDArray[np.float64]:
        """Nothing is seen: every point lies behind the eye."""
        return np.zeros((4, 4))

    def reset(self) -> None:
        """A still picture has one view."""

    def close(self) -> None:
        """Nothing to let go of."""


def still_picture(points: Points, colours: NDArray[np.uint8], background: str) -> NDArray[np.uint8] | None:
    """A cloud as bytes (rows, columns, 3), drawn by numpy alone; None without points.

    Painted from back to front, so that near points cover far ones.
    """
    if len(points) == 0:
        return None
    width, height = 640, 480
    centre = np.median(points, axis=0)
    turn = np.radians(20.0)
    moved = points - centre
    x = moved[:, 0] * np.cos(turn) + moved[:, 2] * np.sin(turn)
    z = moved[:, 2] * np.cos(turn) - moved[:, 0] * np.sin(turn)
    scale = min(width / np.ptp(x), height / np.ptp(moved[:, 1])) * 0.94 if np.ptp(x) > 0 else 1.0
    column = np.rint((x - (x.min() + x.max()) / 2) * scale + width / 2).astype(int)
    row = np.rint((moved[:, 1] - (moved[:, 1].min() + moved[:, 1].max()) / 2) * scale + height / 2).astype(
        int
    )
    picture = np.empty((height, width, 3), np.uint8)
    picture[:] = tuple(bytes.fromhex(background[1:]))
    back_to_front = np.argsort(-z)
    seen = (column >= 1) & (column < width - 1) & (row >= 1) & (row < height - 1)
    order = back_to_front[seen[back_to_front]]
    for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
        picture[row[order] + dy, column[order] + dx] = colours[order]
    return np.ascontiguousarray(picture)
