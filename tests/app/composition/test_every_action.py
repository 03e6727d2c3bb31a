"""Every action of the table does something that a person notices, on every page where it is offered."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from dsl_app.composition import demo
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link, RigChoice
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shell.actions import ACTIONS, Action
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.tour import Tour
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QWidget
from pytestqt.qtbot import QtBot

from tests.app.support.small_result import write_small_result

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))
#: Closing the window, which all other actions need, has tests of its own.
LEFT_OUT = {"quit"}


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("home")


@pytest.fixture(scope="module")
def window(qapp: QApplication, home: Path) -> Iterator[MainWindow]:
    """One window with a result and a connected rig for all actions, as a person has it."""
    patch = pytest.MonkeyPatch()
    patch.setenv("DSL_SCAN_HOME", str(home))
    # The rig of the whole demo takes long to open, and that cannot be cancelled.
    patch.setattr(demo, "LIVE_RIG", TWIN)
    composition = Composition(StartOptions(TWIN))
    made = composition.open_window(home)
    made.resize(1280, 800)
    made.show()
    rig = composition.rig
    rig.connect(TWIN)
    wait_until(lambda: rig.state.link.value is Link.OPEN)
    made.open_path(write_small_result(home))
    wait_until(lambda: not made.parts.runner.active)
    yield made
    made.parts.runner.cancel_all()
    wait_until(lambda: not made.parts.runner.active)
    made.close()
    patch.undo()


def wait_until(holds: Callable[[], bool], seconds: float = 60.0) -> None:
    """Let window and threads live until something holds; Qt's own waiting would starve the threads."""
    for _ in range(int(seconds * 50)):
        if holds():
            return
        QApplication.processEvents()
        time.sleep(0.02)
    pytest.fail("It never came true.")


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """File dialogs that were opened; all are left without a choice."""
    asked: list[str] = []

    def refuse_file(_parent: object, title: str, *_: object) -> tuple[str, str]:
        asked.append(title)
        return "", ""

    def refuse_folder(_parent: object, title: str, *_: object) -> str:
        asked.append(title)
        return ""

    for name in ("getOpenFileName", "getSaveFileName"):
        monkeypatch.setattr(QFileDialog, name, refuse_file)
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", refuse_folder)
    monkeypatch.setattr(OpenDialog, "ask", lambda _parent, title, *_, **__: asked.append(title))
    return asked


def notice(window: MainWindow, asked: list[str]) -> tuple[object, ...]:
    """Everything by which a person notices that something happened."""
    page = window.page_of(window.page)
    return (
        window.page,
        window.theme.name,
        tuple(toast.text for toast in window.toasts.shown),
        tuple(dialog.windowTitle() for dialog in dialogs(window)),
        tuple(asked),
        window.parts.runner.active,
        tuple(dock.isVisible() for dock in (window._log_dock,)),
        len(window.findChildren(Tour)),
        tuple(action.isChecked() for action in window.actions_by_key.values()),
        window.parts.undo.undo_text,
        page.grab().toImage(),
    )


def dialogs(window: MainWindow) -> list[QWidget]:
    return [w for w in QApplication.topLevelWidgets() if w is not window and w.isVisible()]


def tidy(window: MainWindow) -> None:
    for tour in window.findChildren(Tour):
        tour.leave()
    for dialog in dialogs(window):
        if isinstance(dialog, QDialog):
            dialog.reject()
        else:
            dialog.hide()
    for toast in window.toasts.shown:
        toast.dismiss()
    QApplication.processEvents()


def prepare(window: MainWindow, action: Action) -> None:
    """Bring the window where the action changes something."""
    window.open_page(action.page or "results")
    if action.key.startswith("page_"):
        window.open_page("rig" if action.key != "page_rig" else "scan")
    if action.key.startswith("theme_"):
        window.do("theme_light" if action.key == "theme_dark" else "theme_dark")
    if action.key in ("view_colour", "band_up", "band_down"):
        window.do("view_band")
    elif action.key.startswith("view_"):
        window.do("view_colour")


@pytest.mark.slow
@pytest.mark.parametrize("action", [a for a in ACTIONS if a.key not in LEFT_OUT], ids=lambda a: a.key)
def test_it_is_noticed(qtbot: QtBot, window: MainWindow, chosen: list[str], action: Action) -> None:
    prepare(window, action)
    made = window.actions_by_key[action.key]
    if not made.isVisible():
        pytest.skip("not offered")
    if not made.isEnabled():
        assert action.key in ("undo", "redo")
        return
    before = notice(window, chosen)
    # A question that waits for an answer is given up, as soon as it is there.
    give_up = QTimer(window)
    give_up.timeout.connect(lambda: tidy(window))
    give_up.start(100)
    made.trigger()
    # Later, it would close the dialogs of other tests.
    give_up.stop()
    noticed: list[bool] = []

    def is_noticed() -> bool:
        noticed.append(notice(window, chosen) != before)
        return noticed[-1]

    wait_until(is_noticed, 5)
    window.parts.runner.cancel_all()
    tidy(window)
