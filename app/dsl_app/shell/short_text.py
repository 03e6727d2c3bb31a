"""A text in a place of a fixed height, which says where it is cut off."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QLabel, QSizePolicy

from dsl_app.shared.plain_tip import plain_tip

LINES = 2
DOTS = "…"


class ShortText(QLabel):
    """A text on at most `LINES` lines: a longer one ends in an ellipsis, and the tooltip has all of it.

    ``fits`` is whether the text is whole; ``cut`` tells when that changes.
    """

    cut = Signal(bool)

    def __init__(self, text: str) -> None:
        super().__init__()
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setWordWrap(True)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Ignored)
        self._whole, self.fits = text, True
        self.setText(text)

    def minimumSizeHint(self) -> QSize:
        """A few words: the rest is cut off."""
        return QSize(100, self.fontMetrics().height())

    def sizeHint(self) -> QSize:
        """As wide as the text is on one line."""
        metrics = self.fontMetrics()
        lines = [metrics.horizontalAdvance(line) for line in self._whole.split("\n")]
        return QSize(max(lines) + 4, LINES * metrics.lineSpacing())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Cut the text where it does not fit."""
        super().resizeEvent(event)
        fits = self._is_inside(self._whole)
        self.setText(self._whole if fits else self._beginning())
        self.setToolTip(plain_tip("" if fits else self._whole))
        if fits != self.fits:
            self.fits = fits
            self.cut.emit(not fits)

    def _beginning(self) -> str:
        """The longest beginning that fits, with an ellipsis."""
        shortest, longest = 0, len(self._whole)
        while longest - shortest > 1:
            middle = (shortest + longest) // 2
            if self._is_inside(self._whole[:middle].rstrip() + DOTS):
                shortest = middle
            else:
                longest = middle
        return self._whole[:shortest].rstrip() + DOTS

    def _is_inside(self, text: str) -> bool:
        metrics, room = self.fontMetrics(), self.contentsRect()
        room.setHeight(1000 * metrics.lineSpacing())
        needed = metrics.boundingRect(room, Qt.TextFlag.TextWordWrap, text)
        return needed.height() <= LINES * metrics.lineSpacing() and needed.width() <= room.width()
