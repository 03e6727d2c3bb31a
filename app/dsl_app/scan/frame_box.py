"""Beside a running scan: the pattern of its last frame, how that is exposed, and frames captured again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import QFormLayout, QGroupBox

from dsl_app.scan.controls import frame_text
from dsl_app.scan.state import LivePicture, ScanState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.widgets.forms import label, named, show_parts

#: Width and height of the pattern, px: as wide as the column, and so low that the smallest window has no need
#: to scroll; lines are upright.
PATTERN_PX = (236, 48)


class FrameBox(QGroupBox):
    """Follows the last frame of a `ScanState`; there is none before the first frame."""

    def __init__(self, state: ScanState) -> None:
        super().__init__("Last frame")
        self._state = state
        tip = "What the projector showed, drawn as bright as it can be"
        self.pattern = named(label(""), "Pattern of the last frame", tip)
        self.brightest = label("", name="Brightest")
        self.saturated = label("", name="Saturated")
        self.each = label("", name="Each takes")
        self.again = label("", name="Captured again", wraps=True)
        form = QFormLayout(self)
        form.addRow(self.pattern)
        for title, widget in (
            ("Brightest", self.brightest),
            ("Saturated", self.saturated),
            ("Each takes", self.each),
            ("Captured again", self.again),
        ):
            form.addRow(title, widget)
        self.stops = [
            state.picture.follow(self._show_picture),
            *follow_any(self._show_text, state.picture, state.status),
        ]

    def _show_picture(self, shown: LivePicture | None) -> None:
        self.setVisible(shown is not None)
        if shown is not None:
            self.pattern.setPixmap(_pixmap(pattern_levels(shown)))

    def _show_text(self) -> None:
        show_parts(self, frame_text(self._state.status.value, self._state.picture.value))


def pattern_levels(shown: LivePicture) -> NDArray[np.uint8]:
    """The projected pattern of a frame as RGB (rows, columns, 3), its brightest level at 255."""
    from dsl_core.patterns.images import pattern_image

    return pattern_image(shown.plan, replace(shown.plan.original(shown.shot), level=1.0))


def _pixmap(levels: NDArray[np.uint8]) -> QPixmap:
    height, width = levels.shape[:2]
    image = QImage(np.ascontiguousarray(levels).data, width, height, 3 * width, QImage.Format.Format_RGB888)
    ways = Qt.AspectRatioMode.IgnoreAspectRatio, Qt.TransformationMode.SmoothTransformation
    return QPixmap.fromImage(image.scaled(*PATTERN_PX, *ways))
