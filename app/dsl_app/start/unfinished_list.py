"""What was interrupted, each with a button that resumes it; nothing is shown where there is nothing."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QPushButton, QWidget

from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import label, push_button, set_role
from dsl_app.shared.widgets.layouts import boxed, column_of, row_of
from dsl_app.start.unfinished import Unfinished, UnfinishedController

#: The first page is on screen before anything is looked for, ms.
LOOK_AFTER_MS = 1500


class UnfinishedList(QWidget):
    """Follows what was found."""

    def __init__(self, control: UnfinishedController) -> None:
        super().__init__()
        self._control = control
        self._lines: list[QWidget] = []
        self._first: QPushButton | None = None
        self._column = column_of(on=self, margins=0, spacing=4)
        self.title = label("Unfinished", "heading")
        self._column.addWidget(self.title)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(LOOK_AFTER_MS)
        self._timer.timeout.connect(control.look)
        self.stops = [
            control.found.follow(self._show),
            control.comes_second.changed.connect(lambda _: self._mark_next()),
        ]

    def _show(self, found: tuple[Unfinished, ...]) -> None:
        for line in self._lines:
            self._column.removeWidget(line)
            line.deleteLater()
        self._first = None
        self._lines = [self._line(each) for each in found]
        for line in self._lines:
            self._column.addWidget(line)
        self._mark_next()
        self.setVisible(bool(found))

    def _mark_next(self) -> None:
        """The first of them is what a person does next, unless something else is."""
        if self._first is not None:
            set_role(self._first, "" if self._control.comes_second.value else "primary")

    def _line(self, what: Unfinished) -> QWidget:
        words = label(what.words, wraps=True)
        words.setToolTip(plain_tip(str(what.path)))
        button = push_button(what.button, f"Continue {what.path}", partial(self._resume, what))
        self._first = self._first or button
        return boxed(row_of((words, 1), button, margins=0))

    def _resume(self, what: Unfinished, _: bool = False) -> None:
        self._control.resume(what)

    def look_soon(self) -> None:
        """Look for what was interrupted once the page is on screen."""
        self._timer.start()
