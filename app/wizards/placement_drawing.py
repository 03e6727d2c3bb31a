"""What stands where during a step of a calibration, as a drawing from above."""

from __future__ import annotations

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.theme import DARK, Theme
from dsl_core.model.placement import Placement


class PlacementDrawing(QWidget):
    """Camera, projector, film, filter and target of a placement; says in words what it draws."""

    def __init__(self) -> None:
        super().__init__()
        self._theme = DARK
        self._placement = Placement()
        self.setMinimumSize(260, 200)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Drawing of what to place where")

    def sizeHint(self) -> QSize:
        """A comfortable size beside an instruction."""
        return QSize(420, 300)

    def show_placement(self, placement: Placement) -> None:
        """Draw a placement."""
        self._placement = placement
        self.update()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.update()
