"""The Compare page on a series of results of a flat target."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from dsl_app.compare.page import ComparePage
from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.state import PairState
from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.panel import SeriesPanel
from dsl_app.compare.series.state import SeriesState
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.settings import RecentFiles, Settings
from dsl_app.shared.theme import LIGHT
from dsl_app.shared.undo import UndoStack
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from tests.app.support.doubles import RecordingNotifier
from tests.cases.stage_series import write_stage

POSITIONS = (700.0, 725.0, 750.0, 775.0)


@dataclass
class Bench:
    page: ComparePage
    state: SeriesState
    pair: PairState
    undo: UndoStack

    @property
    def panel(self) -> SeriesPanel:
        return self.page.series.content

    def see(self) -> SeriesPanel:
        self.page.tabs.setCurrentIndex(1)
        return self.panel

    def drop(self, *paths: Path) -> None:
        data = QMimeData()
        data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
        left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
        enter = QDragEnterEvent(QPoint(300, 300), Qt.DropAction.CopyAction, data, left, none)
        QApplication.sendEvent(self.page, enter)
        assert enter.isAccepted()
        QApplication.sendEvent(
            self.page, QDropEvent(QPointF(300, 300), Qt.DropAction.CopyAction, data, left, none)
        )


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("stage")
    return [write_stage(folder, position, seed=i) for i, position in enumerate(POSITIONS)]


@pytest.fixture
def bench(qtbot: QtBot) -> Iterator[Bench]:
    runner, undo, notifier = QtRunner(), UndoStack(), RecordingNotifier()
    pair, state = PairState(), SeriesState()
    page = ComparePage(
        pair,
        PairController(pair, runner, notifier),
        state,
        SeriesController(state, runner, notifier, undo),
        RecentFiles(Settings()),
    )
    qtbot.addWidget(page)
    page.apply_theme(LIGHT)
    page.resize(1180, 700)
    page.show()
    yield Bench(page, state, pair, undo)
    page.release()
    runner.shut_down()
