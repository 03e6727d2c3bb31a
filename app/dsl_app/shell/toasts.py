"""Messages below the page, which makes room for them: they never cover what they speak of."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtGui import QCursor
from PySide6.QtWidgets import QFrame, QMessageBox, QPushButton, QStatusBar, QWidget

from dsl_app.shared.notify import Level
from dsl_app.shared.widgets.forms import label, push_button
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_app.shared.wording import in_window

_log = logging.getLogger(__name__)
_LEVELS = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}
#: How long a message is shown, ms; the log keeps all of them.
STAY_MS = {"info": 5000, "warning": 9000}
#: How long an error is shown to a person who is there, ms: until the pointer has moved, nobody may be.
ERROR_STAYS_MS = 45_000
#: How often it is looked whether somebody is there, ms.
LOOK_MS = 500
MOST = 4
#: A message that leaves by itself and is not wider than this, px, is told in the status bar.
SHORT_PX = 420


class Toast(QFrame):
    """One message with its details and a Close button."""

    dismissed = Signal()

    def __init__(
        self,
        level: Level,
        text: str,
        details: str,
        parent: QWidget,
        offers: Mapping[str, Callable[[], object]] | None = None,
    ) -> None:
        """``offers`` are buttons by their texts; using one closes the toast."""
        super().__init__(parent)
        self.setProperty("role", "toast")
        self.setProperty("level", level)
        self.setAccessibleName(f"{level}: {text}")
        self.level, self.text = level, text
        self.words = label(text, can_be_copied=True)
        buttons = []
        for name, do in (offers or {}).items():
            offer = push_button(name, text, self.dismiss)
            offer.clicked.connect(lambda _checked=False, do=do: do())
            buttons.append(offer)
        if details:
            buttons.append(_flat("Details", "Show details", lambda: self._show(text, details)))
        buttons.append(_flat("Close", "Close this message", self.dismiss))
        row_of((self.words, 1), *buttons, on=self, margins=(12, 0, 4, 0))

    @property
    def is_short(self) -> bool:
        """Whether it is one line that fits into the status bar."""
        return "\n" not in self.text and self.words.sizeHint().width() <= SHORT_PX

    def be_whole(self) -> None:
        """Break the lines of a long text, with some room around."""
        self.words.setWordWrap(True)
        self.setContentsMargins(0, 4, 0, 4)

    def leave_once_read(self) -> None:
        """Close after `ERROR_STAYS_MS` with a person who is not pointing at the message."""
        unmoved, left_ms = QCursor.pos(), ERROR_STAYS_MS
        is_there = False

        def look() -> None:
            nonlocal is_there, left_ms
            is_there = is_there or QCursor.pos() != unmoved
            if is_there and not self.underMouse():
                left_ms -= LOOK_MS
            if left_ms <= 0:
                self.dismiss()

        watch = QTimer(self)
        watch.timeout.connect(look)
        watch.start(LOOK_MS)

    def dismiss(self) -> None:
        """Close the message."""
        self.hide()
        self.dismissed.emit()
        self.deleteLater()

    def _show(self, text: str, details: str) -> None:
        box = QMessageBox(QMessageBox.Icon.Information, "Details", text, parent=self.window())
        box.setTextFormat(Qt.TextFormat.PlainText)
        box.setDetailedText(details)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.open()


def _flat(text: str, tip: str, do: Callable[[], object]) -> QPushButton:
    button = push_button(text, tip, lambda: do())
    button.setFlat(True)
    return button


class Toasts(QObject):
    """Shows toasts of a window; a `Notifier`. With more than `MOST`, the oldest is closed.

    What leaves by itself and is short is told in the status ``line``, everything else in the ``strip``, which
    the window puts below its pages.
    """

    def __init__(self, line: QStatusBar) -> None:
        super().__init__(line)
        self._line = line
        self.strip = QWidget()
        self._rows = column_of(on=self.strip, margins=(0, 4, 8, 0), spacing=4)
        self.strip.hide()
        self._shown: list[Toast] = []

    @property
    def shown(self) -> tuple[Toast, ...]:
        """The toasts that are shown now."""
        return tuple(self._shown)

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence, and keep it in the log."""
        _log.log(_LEVELS[level], "%s", in_window(text))
        self._show(Toast(level, in_window(text), details, self.strip), STAY_MS.get(level, 0))

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]], stay_s: float = 0.0) -> None:
        """Show a sentence with buttons by their texts until one is used or it is closed.

        With ``stay_s`` it leaves by itself after that time.
        """
        self._show(Toast("info", text, "", self.strip, offers), round(1000 * stay_s))

    def withdraw(self, text: str) -> None:
        """Close the message of a text, if it is still shown: it has lost its sense."""
        for toast in self.shown:
            if toast.text == text:
                toast.dismiss()

    def _show(self, toast: Toast, stay_ms: int) -> None:
        if any(other.text == toast.text for other in self._shown):
            toast.deleteLater()
            return
        toast.dismissed.connect(lambda: self._drop(toast))
        self._shown.append(toast)
        for old in tuple(self._shown[:-MOST]):
            old.dismiss()
        if stay_ms:
            QTimer.singleShot(stay_ms, toast, toast.dismiss)
        elif toast.level == "error":
            toast.leave_once_read()
        self._place(toast, bool(stay_ms))
        toast.show()

    def _place(self, toast: Toast, leaves: bool) -> None:
        """Put a toast into the status bar if it belongs there and no other is there yet, else the strip."""
        is_taken = any(other.parent() is self._line for other in self._shown)
        if leaves and toast.is_short and not is_taken:
            self._line.insertPermanentWidget(0, toast)
        else:
            toast.be_whole()
            self._rows.addWidget(toast)
            self.strip.show()

    def _drop(self, toast: Toast) -> None:
        if toast in self._shown:
            self._shown.remove(toast)
            self.strip.setVisible(any(other.parent() is self.strip for other in self._shown))
