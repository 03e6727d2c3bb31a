"""The projector's screen: chosen by name on the Rig page, watched, and never that of the window itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer
from PySide6.QtGui import QGuiApplication

from dsl_app.connection.projector_window import ProjectorWindow, ScreenLabel, describe_screen
from dsl_app.rig.projector_panel import LOST
from dsl_app.shell.main_window import MainWindow
from dsl_core.errors import DslError

if TYPE_CHECKING:
    from dsl_app.rig.page import RigPage

IDENTIFY_MS = 3000


class ProjectorScreens(QObject):
    """Holds the window on the projector's screen and does what the Rig page asks of screens."""

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._labels: list[ScreenLabel] = []
        self.beam = ProjectorWindow()
        self.beam.lost.connect(
            lambda name: window.toasts.tell(
                "error",
                f"The projector's screen {name} is gone. Connect it again and choose it on the Rig page.",
            )
        )
        self.beam.restored.connect(
            lambda name: window.toasts.tell(
                "info", f"The screen {name} is there again. Choose it on the Rig page to use it."
            )
        )
        window.closed.connect(self.leave)
        window.destroyed.connect(self.beam.close)

    def serve(self, page: RigPage) -> None:
        """Do what a Rig page asks, and tell it of screens that come and go."""
        page.projector.identify.connect(self.identify)
        page.projector.screen_chosen.connect(lambda name: self._choose(page, name))
        application = QGuiApplication.instance()
        assert isinstance(application, QGuiApplication)
        for signal in (application.screenAdded, application.screenRemoved):
            signal.connect(lambda _screen: self._list(page))

    def identify(self) -> None:
        """Show every screen's name on it for a while."""
        self.hide_names()
        self._labels = [ScreenLabel(s, describe_screen(s)) for s in QGuiApplication.screens()]
        for label in self._labels:
            label.show()
            QTimer.singleShot(IDENTIFY_MS, label, self.hide_names)

    def hide_names(self) -> None:
        """Take the names away; frames must not show them."""
        labels, self._labels = self._labels, []
        for label in labels:
            label.close()

    def leave(self) -> None:
        """Leave all screens to others."""
        self.hide_names()
        self.beam.close()

    def _list(self, page: RigPage) -> None:
        beam = self.beam
        page.projector.refresh_screens(beam.screen().name() if beam.is_armed else "", beam.lost_screen)

    def _choose(self, page: RigPage, name: str) -> None:
        if name == LOST:
            return
        found = next((s for s in QGuiApplication.screens() if s.name() == name), None)
        try:
            if found is None:
                self.beam.disarm()
            elif found is self._window.screen():
                raise DslError(
                    f"{name} is the screen of this window. Choose the projector's, or move this window away."
                )
            else:
                self.beam.arm(found)
        except DslError as error:
            self._window.toasts.tell("error", str(error))
        self._list(page)
