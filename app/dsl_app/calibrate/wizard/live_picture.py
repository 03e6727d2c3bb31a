"""What the camera took last, while a target is placed and captured."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtWidgets import QVBoxLayout, QWidget

from dsl_app.calibrate.wizard.state import Seen
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label, set_role

#: Share of saturated pixels that deserves a warning (as peers have it).
MANY_SATURATED = 0.005
NOTHING = "No picture yet. It appears with the first look."


class LivePicture(QWidget):
    """A picture that keeps its shape, saturated pixels in red."""

    def __init__(self) -> None:
        super().__init__()
        self.view = pg.GraphicsLayoutWidget()
        self.view.setAccessibleName("What the camera sees")
        self.view.setToolTip("The camera's last bright frame; saturated pixels are red")
        self.view.setMinimumSize(220, 150)
        self._box = self.view.addViewBox(lockAspect=True, invertY=True, enableMenu=False, enableMouse=False)
        self._item = pg.ImageItem(axisOrder="row-major")
        self._box.addItem(self._item)
        self._text = label(NOTHING, "muted")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.view, 1)
        column.addWidget(self._text)

    def show_seen(self, seen: Seen | None) -> None:
        """Show a frame; None clears it."""
        if seen is None:
            self._item.clear()
            self._text.setText(NOTHING)
            set_role(self._text, "muted")
            return
        self._item.setImage(seen.picture, autoLevels=False, levels=None)
        self._box.autoRange(padding=0.01)
        self._text.setText(f"saturated {100 * seen.saturated:.2f} %")
        set_role(self._text, "bad" if seen.saturated > MANY_SATURATED else "muted")

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self.view.setBackground(theme.base)
