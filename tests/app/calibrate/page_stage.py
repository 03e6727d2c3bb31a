"""The Calibrate page in tests: its window, the wizards that it opened, and clicks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dsl_app.calibrate.page import CalibratePage
from dsl_app.calibrate.wizard.window import CalibrationWizard
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.theme import LIGHT
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QTableWidget,
    QWidget,
)
from pytestqt.qtbot import QtBot

from tests.app.calibrate.calibrate_bench import CalibrateBench, make_bench


class Stage:
    """The page on a host window, and the wizards that it opened."""

    def __init__(self, qtbot: QtBot, folder: Path) -> None:
        self.qtbot, self.runner = qtbot, QtRunner()
        self.bench: CalibrateBench = make_bench(folder, self.runner)
        bench = self.bench
        self.page = CalibratePage(bench.state, bench.rig.state, bench.control, folder)
        qtbot.addWidget(self.page)
        self.page.apply_theme(LIGHT)
        self.page.resize(1196, 740)
        self.page.show()
        self.windows: list[CalibrationWizard] = []
        bench.control.wizard_ready.connect(self._open)
        bench.rig.connect(bench.rig.state.choice.value)
        self.wait(lambda: bench.rig.state.devices.value is not None)

    def _open(self, pair: object) -> None:
        state, control = self.bench.wizards[-1]
        self.windows.append(CalibrationWizard(state, control, LIGHT, self.page))
        self.windows[-1].open()

    def wait(self, until: Callable[[], bool]) -> None:
        self.qtbot.waitUntil(until, timeout=60_000)

    def idle(self) -> None:
        self.wait(lambda: self.runner.active == ())

    def wizard(self, name: str) -> CalibrationWizard:
        """Open a wizard by the button of its row."""
        count = len(self.windows)
        click(self.page.rows[name].run)
        self.wait(lambda: len(self.windows) > count)
        return self.windows[-1]

    def finish(self) -> None:
        self.page.release()
        self.runner.shut_down()


def click(button: QWidget) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def cell(table: QTableWidget, row: int, column: int) -> str:
    item = table.item(row, column)
    assert item is not None
    return item.text()


def by_hand(stage: Stage) -> None:
    devices = stage.bench.rig.state.devices.value
    assert devices is not None
    devices.place = None
