"""The rail of activities at the left of the window."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QToolButton, QWidget

from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import named
from dsl_app.shared.widgets.icons import icon
from dsl_app.shared.widgets.layouts import STRETCH, column_of
from dsl_app.shell.actions import Page

#: Height that an icon with its name needs, px.
LEAST_PX = 64


class Rail(QFrame):
    """One button per page, in the order of the work; ``chosen`` tells the key of the page."""

    chosen = Signal(str)

    def __init__(self, pages: Sequence[Page], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("rail")
        self._pages = tuple(pages)
        self._buttons = {page.key: self._button(page, number) for number, page in enumerate(pages)}
        column_of(*self._buttons.values(), STRETCH, on=self, margins=(0, 6, 0, 6), spacing=2)

    def _button(self, page: Page, number: int) -> QToolButton:
        button = QToolButton(self)
        button.setText(page.title)
        button.setCheckable(True)
        button.setAutoExclusive(True)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
        button.setIconSize(QSize(26, 26))
        button.setFixedWidth(84)
        named(button, page.title, f"{page.tip} (Ctrl+{number})")
        button.clicked.connect(lambda _checked, key=page.key: self.chosen.emit(key))
        return button

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show the icons alone where their names have no room, as over the log on a small screen."""
        super().resizeEvent(event)
        style = Qt.ToolButtonStyle
        has_room = event.size().height() >= LEAST_PX * len(self._buttons)
        for button in self._buttons.values():
            button.setToolButtonStyle(style.ToolButtonTextUnderIcon if has_room else style.ToolButtonIconOnly)

    def mark(self, key: str) -> None:
        """Mark a page as open; the keyboard goes on from it if it was at another one."""
        if any(button.hasFocus() for button in self._buttons.values()):
            self._buttons[key].setFocus()
        self._buttons[key].setChecked(True)
        for each, button in self._buttons.items():
            # Qt moves the stop of the Tab key with the keyboard alone, not with pages opened otherwise.
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus if each == key else Qt.FocusPolicy.NoFocus)

    def paint_icons(self, theme: Theme) -> None:
        """Draw the icons in the colours of a theme."""
        for page in self._pages:
            self._buttons[page.key].setIcon(icon(page.icon, theme.text))
