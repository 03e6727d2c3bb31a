"""Messages in the status bar, whose height is fixed: they cover nothing, and nothing moves when they come."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtGui import QCursor
from PySide6.QtWidgets import QFrame, QMessageBox, QPushButton, QWidget

from dsl_app.shared.notify import Level
from dsl_app.shared.widgets.forms import label, push_button, set_role
from dsl_app.shared.widgets.layouts import STRETCH, row_of
from dsl_app.shared.wording import in_window
from dsl_app.shell.short_text import ShortText
from dsl_app.shell.status_line import StatusLine

_log = logging.getLogger(__name__)
_LEVELS = {"info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}
#: How long a message is shown, ms; the log keeps all of them.
STAY_MS = {"info": 5000, "warning": 9000}
#: How long an error is shown to a person who is there, ms: until the pointer has moved, nobody may be.
ERROR_STAYS_MS = 45_000
#: How often it is looked whether somebody is there, ms.
LOOK_MS = 500
MOST = 4


class Toast(QFrame):
    """One message with its details and a Close button; ``stay_ms`` in front it leaves, or stays for 0."""

    dismissed = Signal()

    def __init__(
        self,
        level: Level,
        text: str,
        details: str = "",
        stay_ms: int = 0,
        offers: Mapping[str, Callable[[], object]] | None = None,
        is_next: bool = False,
    ) -> None:
        """``offers`` are buttons by their texts; using one closes the toast.

        ``is_next`` makes the first of them the blue one: what a person does next.
        """
        super().__init__()
        self.setProperty("role", "toast")
        self.setProperty("level", level)
        self.setAccessibleName(f"{level}: {text}")
        self.level, self.text = level, text
        self._details, self._stay_ms = details, stay_ms
        # What is offered loses its sense with time, seen or not.
        self._ages_behind = bool(offers)
        self._watch: QTimer | None = None
        self.words = ShortText(text)
        self.behind = label("", "muted")
        self._next: QPushButton | None = None
        buttons: list[QPushButton] = []
        for name, do in (offers or {}).items():
            offer = push_button(name, text, self.dismiss, "primary" if is_next and not buttons else "")
            offer.clicked.connect(lambda _checked=False, do=do: do())
            if is_next and not buttons:
                self._next = offer
            buttons.append(offer)
        self.more = _flat("Details", "Show the whole message", self._show)
        self.more.setVisible(bool(details))
        self.words.cut.connect(lambda is_cut: self.more.setVisible(is_cut or bool(details)))
        buttons += [self.more, _flat("Close", "Close this message", self.dismiss)]
        row_of(self.words, self.behind, *buttons, on=self, margins=(12, 0, 4, 0))

    def come_to_front(self, behind: int) -> None:
        """Be the one that is shown, before so many others; the time until it leaves begins."""
        self.behind.setText(f"{behind} more" if behind else "")
        self.behind.setVisible(bool(behind))
        self.show()
        if self._watch is not None:
            return
        self._watch = QTimer(self)
        if self._stay_ms:
            self._watch.timeout.connect(self.dismiss)
            self._watch.start(self._stay_ms)
        elif self.level == "error":
            self._leave_once_read(self._watch)

    def be_calm(self) -> None:
        """Offer what was offered next as one thing among others."""
        if self._next is not None:
            set_role(self._next, "")

    def stand_back(self) -> None:
        """Wait behind another, for as long as that is shown."""
        self.hide()
        if not self._ages_behind:
            self._forget_time()

    def _forget_time(self) -> None:
        if self._watch is not None:
            self._watch.stop()
            self._watch.deleteLater()
            self._watch = None

    def _leave_once_read(self, watch: QTimer) -> None:
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

        watch.timeout.connect(look)
        watch.start(LOOK_MS)

    def dismiss(self) -> None:
        """Close the message."""
        self.hide()
        self._forget_time()
        self.dismissed.emit()
        self.deleteLater()

    def _show(self) -> None:
        box = QMessageBox(QMessageBox.Icon.Information, "Details", self.text, parent=self.window())
        box.setTextFormat(Qt.TextFormat.PlainText)
        if self._details:
            box.setDetailedText(self._details)
        box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        box.open()


def _flat(text: str, tip: str, do: Callable[[], object]) -> QPushButton:
    button = push_button(text, tip, lambda: do())
    button.setFlat(True)
    return button


class Toasts(QObject):
    """Shows toasts of a window in its status ``line``, the latest in front of others; a `Notifier`.

    With more than `MOST`, the oldest is closed.
    """

    def __init__(self, line: StatusLine) -> None:
        super().__init__(line)
        self.place = QWidget()
        # As wide as its text, where there is room.
        self._row = row_of(STRETCH, on=self.place, margins=(0, 2, 8, 2))
        line.insertPermanentWidget(0, self.place, 1)
        self.place.hide()
        self._shown: list[Toast] = []

    @property
    def shown(self) -> tuple[Toast, ...]:
        """The toasts that are there now, the one in front last."""
        return tuple(self._shown)

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence, and keep it in the log."""
        _log.log(_LEVELS[level], "%s", in_window(text))
        self._add(Toast(level, in_window(text), details, STAY_MS.get(level, 0)))

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]], stay_s: float = 0.0) -> None:
        """Show a sentence with buttons by their texts until one is used or it is closed.

        With ``stay_s`` it leaves by itself after that time.
        """
        self._add(Toast("info", text, stay_ms=round(1000 * stay_s), offers=offers))

    def offer_next(
        self, text: str, offers: Mapping[str, Callable[[], object]], gone: Callable[[], object]
    ) -> None:
        """Offer what a person does next: the first button is the blue one; ``gone`` is called at its end."""
        toast = Toast("info", text, offers=offers, is_next=True)
        toast.dismissed.connect(gone)
        self._add(toast)

    def be_calm(self, text: str) -> None:
        """Offer what the message of a text offers as one thing among others: the person does another."""
        for toast in self.shown:
            if toast.text == text:
                toast.be_calm()

    def withdraw(self, text: str) -> None:
        """Close the message of a text, if it is still there: it has lost its sense."""
        for toast in self.shown:
            if toast.text == in_window(text):
                toast.dismiss()

    def _add(self, toast: Toast) -> None:
        if any(other.text == toast.text for other in self._shown):
            toast.deleteLater()
            return
        toast.dismissed.connect(lambda: self._drop(toast))
        toast.hide()
        self._row.insertWidget(0, toast)
        self._shown.append(toast)
        for old in tuple(self._shown[:-MOST]):
            old.dismiss()
        self._arrange()

    def _drop(self, toast: Toast) -> None:
        if toast in self._shown:
            self._shown.remove(toast)
            self._row.removeWidget(toast)
            self._arrange()

    def _arrange(self) -> None:
        """Show the latest, and nothing where there is none."""
        for toast in self._shown[:-1]:
            toast.stand_back()
        if self._shown:
            self._shown[-1].come_to_front(len(self._shown) - 1)
        self.place.setVisible(bool(self._shown))
