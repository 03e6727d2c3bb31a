"""Connects the rig of the last session, once, when that slows nothing down."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer

from dsl_app.connection.state import Link
from dsl_app.shell.main_window import MainWindow

if TYPE_CHECKING:
    # The window comes up before numpy.
    from dsl_app.connection.controller import RigController

#: How long such a page is on screen before the rig is connected, and the time between two tries, ms.
LATER_MS, AGAIN_MS = 3000, 200
#: Pages that need no rig.
LOOKING = ("start", "results")


class FirstConnection(QObject):
    """Connects at once, or later on a page that needs no rig: a first example needs none of its libraries."""

    def __init__(self, window: MainWindow, rig: RigController) -> None:
        super().__init__(window)
        self._window, self._rig, self._waits = window, rig, True

    def begin(self, at_once: bool) -> None:
        """Connect now, or when another page is opened, or when no job runs for a while."""
        if at_once or self._window.page not in LOOKING:
            self._connect()
            return
        self._window.opened.connect(lambda page: None if page in LOOKING else self._connect())
        QTimer.singleShot(LATER_MS, self, self.connect_when_quiet)

    def connect_when_quiet(self) -> None:
        """Connect unless a job runs; then try again."""
        if self._window.parts.runner.active:
            QTimer.singleShot(AGAIN_MS, self, self.connect_when_quiet)
        else:
            self._connect()

    def _connect(self) -> None:
        # Once: who disconnects the rig later wants it so.
        if self._waits and self._rig.state.link.value is Link.CLOSED:
            self._rig.connect(self._rig.state.choice.value)
        self._waits = False
