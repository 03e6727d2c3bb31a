"""Shows the window of the application in a test and ends its jobs before it is closed."""

from __future__ import annotations

from dsl_app.shell.main_window import MainWindow
from pytestqt.qtbot import QtBot

PATIENCE_MS = 60_000


def show_window(qtbot: QtBot, window: MainWindow) -> None:
    """Show a window that pytest-qt closes after the test, once its jobs have ended.

    pytest-qt closes widgets before it lets fixtures go on after their ``yield``. A window closed by then
    no longer hears of the jobs it stopped, so that a fixture that waits for them there may wait for ever.
    Jobs are stopped again and again: a rig that has just been connected starts its live view.
    """

    def is_quiet() -> bool:
        window.parts.runner.cancel_all()
        return not window.parts.runner.active

    def end_jobs(_: object) -> None:
        qtbot.waitUntil(is_quiet, timeout=PATIENCE_MS)

    qtbot.addWidget(window, before_close_func=end_jobs)
    window.show()
