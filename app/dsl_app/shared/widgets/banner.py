"""A sentence over the whole page that stays until it is dealt with."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton


class Banner(QFrame):
    """Hidden while it has nothing to say; ``action`` is the button that deals with it."""

    def __init__(self, action: str) -> None:
        super().__init__()
        self.setProperty("role", "banner")
        self._text = QLabel()
        self._text.setWordWrap(True)
        self._text.setTextFormat(Qt.TextFormat.PlainText)
        self._text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.action = QPushButton(action)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(12, 8, 8, 8)
        self._row.addWidget(self._text, 1)
        self._row.addWidget(self.action)
        self.say("")

    def add_button(self, text: str) -> QPushButton:
        """Another button, after ``action``."""
        button = QPushButton(text)
        self._row.addWidget(button)
        return button

    @property
    def text(self) -> str:
        """What it says."""
        return self._text.text()

    def say(self, text: str) -> None:
        """Show a sentence, or hide for none."""
        self._text.setText(text)
        self.setAccessibleName(text)
        self.setVisible(bool(text))
