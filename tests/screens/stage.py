"""One application, freshly opened, and the hands and eyes of a person before it."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link, RigChoice
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import QEvent, QPoint, Qt, QTimer
from PySide6.QtGui import QCursor, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog, QPushButton, QWidget

from dsl_core.resources import HOME_VARIABLE
from tests.screens.look import Look
from tests.screens.material import CHART, Material

W = TypeVar("W", bound=QWidget)
CHART_RIG = RigChoice("twin", tuple(CHART.items()))
#: How long the window settles before a picture is taken, s, and in how many rounds of its events at least.
SETTLE_S = 0.25
ROUNDS = 20
PATIENCE_S = 300.0


class Stage:
    """Opens the application in ``folder``, which is its home, and puts pictures into ``out``."""

    def __init__(self, scene: str, folder: Path, out: Path, material: Material, look: Look) -> None:
        self.folder, self.material, self._out, self._look, self._scene = folder, material, out, look, scene
        self.window: MainWindow
        self.composition: Composition

    # Open and close --------------------------------------------------------------------------------

    def open(self, library: bool = False, page_waits: bool = False, **settings: object) -> None:
        """Open the window as it comes up with these settings, with or without calibrations kept.

        Its page is there at once, unless it ``page_waits`` for the first paint, as for a person.
        """
        home = self.folder / "home"
        if library:
            shutil.copytree(self.material.home, home, dirs_exist_ok=True)
        home.mkdir(exist_ok=True)
        os.environ[HOME_VARIABLE] = str(home)
        folders = {"output_folder": "scans", "campaigns_folder": "campaigns"}
        told = {key: str(self.folder / name) for key, name in folders.items()}
        path = home / "settings.json"
        if not path.exists():
            path.write_text(json.dumps({"tour_seen": True, **told, **settings}, default=str))
        self.composition = Composition(StartOptions())
        self.window = self.composition.open_window(home, self._look.theme, in_background=page_waits)
        QCursor.setPos(QGuiApplication.primaryScreen().geometry().bottomRight())
        self.window.show()
        self.window.move(0, 0)
        self.window.resize(QGuiApplication.primaryScreen().size())
        self.window.activateWindow()

    def connect(self, choice: RigChoice = CHART_RIG) -> None:
        """Connect a rig and wait for it."""
        rig = self.composition.rig
        rig.connect(choice)
        self.wait(lambda: rig.state.link.value is Link.OPEN)

    def close(self) -> None:
        """Stop what runs and close everything."""
        for dialog in self.dialogs:
            dialog.hide()
        self.window.parts.runner.cancel_all()
        self.idle()
        self.window.close()
        self.window.deleteLater()
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        QApplication.processEvents()

    def copied(self, path: Path) -> Path:
        """A copy of a folder of the material that the scene may change."""
        is_campaign = path in (self.material.half, self.material.complete)
        target = self.folder / ("campaigns" if is_campaign else "") / path.name
        if not target.exists():
            shutil.copytree(path, target, ignore=shutil.ignore_patterns("lock"))
        return target

    # Wait ------------------------------------------------------------------------------------------

    def wait(self, holds: Callable[[], object], seconds: float = PATIENCE_S) -> None:
        """Let window and threads live until something holds."""
        limit = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < limit, "it never came true"
            QApplication.processEvents()
            time.sleep(0.005)

    def idle(self) -> None:
        """Wait until no job runs."""
        self.wait(lambda: not self.window.parts.runner.active)

    def settle(self) -> None:
        """Let the window paint what it has to, however long one painting takes."""
        limit, rounds = time.monotonic() + SETTLE_S, 0
        while rounds < ROUNDS or time.monotonic() < limit:
            QApplication.processEvents()
            time.sleep(0.005)
            rounds += 1

    # See -------------------------------------------------------------------------------------------

    def shoot(self, name: str = "") -> None:
        """Take a picture of the whole screen."""
        self.settle()
        stem = "-".join(part for part in (self._scene, name) if part)
        picture = QGuiApplication.primaryScreen().grabWindow(0)
        assert picture.save(str(self._out / f"{stem}.png"))

    def shoot_question(self, name: str, ask: Callable[[], object]) -> None:
        """Take a picture of a question that waits for its answer, then give it up."""
        seen: list[QWidget] = []

        def look() -> None:
            asked = QApplication.activeModalWidget()
            if asked is None:
                QTimer.singleShot(50, look)
                return
            seen.append(asked)
            self.shoot(name)
            assert isinstance(asked, QDialog)
            asked.reject()

        QTimer.singleShot(50, look)
        ask()
        self.wait(lambda: bool(seen))

    @property
    def dialogs(self) -> list[QWidget]:
        """Windows over the main one, the latest last."""
        return [w for w in QApplication.topLevelWidgets() if w is not self.window and w.isVisible()]

    def dialog(self, kind: type[W]) -> W:
        """The dialog of a kind, as soon as it is there."""
        found: list[W] = []

        def look() -> bool:
            found[:] = [each for each in self.dialogs if isinstance(each, kind)]
            return bool(found)

        self.wait(look)
        return found[-1]

    # Do --------------------------------------------------------------------------------------------

    def click(self, widget: QWidget, at: QPoint | None = None) -> None:
        """Click a widget, in its middle unless told where."""
        QTest.mouseClick(
            widget,
            Qt.MouseButton.LeftButton,
            Qt.KeyboardModifier.NoModifier,
            widget.rect().center() if at is None else at,
        )

    def press(self, text: str, inside: QWidget | None = None) -> None:
        """Click the button with a text that can be seen."""
        buttons = (inside or self.window).findChildren(QPushButton)
        found = [b for b in buttons if b.isVisible() and b.text().replace("&", "") == text]
        assert found, f"there is no button {text!r}"
        self.click(found[0])
