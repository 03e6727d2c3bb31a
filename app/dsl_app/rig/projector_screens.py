"""The projector's screen: chosen by name on the Rig page, monitored, and never that of the window itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QWidget

from dsl_app.rig.projector_panel import LOST
from dsl_app.rig.projector_window import LOST_SCREEN, ProjectorWindow, ScreenLabel, describe_screen
from dsl_app.shared.notify import Notifier
from dsl_core.errors import DslError

if TYPE_CHECKING:
    from dsl_app.rig.page import RigPage

IDENTIFY_MS = 3000


class ProjectorScreens(QObject):
    """Owns the window on the projector's screen, and serves the Rig page's choice of screens."""

    def __init__(self, window: QWidget, notifier: Notifier) -> None:
        super().__init__(window)
        self._window, self._notifier = window, notifier
        self._labels: list[ScreenLabel] = []
        self.projector_window = ProjectorWindow()
        self.projector_window.lost.connect(lambda name: notifier.tell("error", LOST_SCREEN.format(name)))
        self.projector_window.restored.connect(
            lambda name: notifier.tell(
                "info", f"The screen {name} is connected again. Choose it on the Rig page to use it."
            )
        )
        window.destroyed.connect(self.projector_window.close)

    def serve(self, page: RigPage) -> None:
        """Serve a Rig page, and update its list when screens are connected, disconnected or lost."""
        page.projector.identify.connect(self.identify)
        page.projector.screen_chosen.connect(lambda name: self._choose(page, name))
        application = QGuiApplication.instance()
        assert isinstance(application, QGuiApplication)
        for signal in (application.screenAdded, application.screenRemoved, self.projector_window.lost):
            signal.connect(lambda _screen: self._list(page))

    def identify(self) -> None:
        """Show every screen's name on it for a while."""
        self.hide_names()
        self._labels = [ScreenLabel(s, describe_screen(s)) for s in QGuiApplication.screens()]
        for label in self._labels:
            label.show()
            QTimer.singleShot(IDENTIFY_MS, label, self.hide_names)

    def hide_names(self) -> None:
        """Remove the names; frames must not show them."""
        labels, self._labels = self._labels, []
        for label in labels:
            label.close()

    def close(self) -> None:
        """Release all screens."""
        self.hide_names()
        self.projector_window.close()

    def _list(self, page: RigPage) -> None:
        window = self.projector_window
        page.projector.refresh_screens(window.screen().name() if window.is_armed else "", window.lost_screen)

    def _choose(self, page: RigPage, name: str) -> None:
        if name == LOST:
            return
        found = next((s for s in QGuiApplication.screens() if s.name() == name), None)
        try:
            if found is None:
                self.projector_window.disarm()
            elif found is self._window.screen():
                raise DslError(
                    f"{name} is the screen of this window. Choose the projector's, or move this window away."
                )
            else:
                self.projector_window.arm(found)
        except DslError as error:
            self._notifier.tell("error", str(error))
        self._list(page)
