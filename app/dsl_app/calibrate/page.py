"""The Calibrate page: the campaign's calibrations in their order, and the library below."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, QTimer, QUrl
from PySide6.QtGui import QDesktopServices, QShowEvent
from PySide6.QtWidgets import (
    QFrame,
    QScrollArea,
    QSplitter,
    QVBoxLayout,
    QWidget,
)

from dsl_app.calibrate.campaign_box import CampaignBox
from dsl_app.calibrate.commands import CalibrateCommands
from dsl_app.calibrate.drift_window import DriftWindow
from dsl_app.calibrate.library_panel import LibraryPanel
from dsl_app.calibrate.row import CalibrationRow
from dsl_app.calibrate.state import CalibrateState, DriftVerdict, Row
from dsl_app.connection.state import RigState
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import Banner
from dsl_app.shared.widgets.page import PageWidget

#: How often news of a calibration of everything is fetched, ms.
FETCH_MS = 200
#: Height of the rows, as far as there is room.
ROWS_PX = 316


class CalibratePage(PageWidget):
    """Follows a `CalibrateState` and asks a controller; ``home`` is where new campaigns are proposed."""

    def __init__(self, state: CalibrateState, rig: RigState, commands: CalibrateCommands, home: Path) -> None:
        super().__init__()
        self._state, self._commands, self._theme = state, commands, DARK
        self.banner = Banner("Connect the campaign's rig")
        self.banner.action.setToolTip("Open the rig that the campaign was begun with")
        self.head = CampaignBox(state, rig, commands, home)
        self.rows = {row.name: CalibrationRow(row, number) for number, row in enumerate(state.rows.value, 1)}
        self.library = LibraryPanel(state, commands.library)
        self._timer = QTimer(self)
        self._timer.setInterval(FETCH_MS)
        self._timer.timeout.connect(commands.take_news)
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        content = QWidget()
        rows = QVBoxLayout(content)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(4)
        for row in self.rows.values():
            rows.addWidget(row)
        rows.addStretch(1)
        area = QScrollArea()
        area.setWidget(content)
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        split = QSplitter(Qt.Orientation.Vertical)
        split.setChildrenCollapsible(False)
        split.addWidget(area)
        split.addWidget(self.library)
        split.setStretchFactor(0, 0)
        split.setStretchFactor(1, 1)
        split.setSizes([ROWS_PX, 300])
        column = QVBoxLayout(self)
        column.addWidget(self.banner)
        column.addWidget(self.head)
        column.addWidget(split, 1)

    def _connect(self) -> None:
        state = self._state
        self.banner.action.clicked.connect(self._commands.connect_rig)
        for row in self.rows.values():
            row.wanted.connect(self.run)
        self._stops: list[Callable[[], None]] = [
            *self.head.stops,
            *self.library.stops,
            state.rows.follow(self._show_rows),
            state.trouble.follow(lambda _: self._show_trouble()),
            state.foreign.follow(lambda _: self._show_trouble()),
            state.everything.follow(self._show_everything),
            state.opening.follow(lambda _: self._show_everything(state.everything.value)),
            state.drift.changed.connect(self._show_drift),
            state.opened.connect(lambda path: QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))),
        ]

    def run(self, name: str) -> None:
        """Open the wizard of a calibration; a campaign is begun first where none is open."""
        if self._state.campaign.value is None and not self.head.ask_new():
            return
        self._commands.run(name)

    def _show_rows(self, rows: tuple[Row, ...]) -> None:
        for row in rows:
            if row.name in self.rows:
                self.rows[row.name].show_row(row)

    def _show_trouble(self) -> None:
        self.banner.say(self._state.trouble.value)
        self.banner.action.setVisible(self._state.foreign.value)

    def _show_everything(self, text: str) -> None:
        busy = bool(text) or bool(self._state.opening.value)
        for row in self.rows.values():
            row.run.setEnabled(not busy)
        if text:
            self._timer.start()
        else:
            self._timer.stop()

    def _show_drift(self, verdict: DriftVerdict | None) -> None:
        if verdict is not None:
            window = DriftWindow(verdict, self._theme, self)
            window.again_wanted.connect(
                lambda: self._commands.library.check(
                    verdict.name, verdict.spectralon, bool(verdict.overridden)
                )
            )
            window.use_wanted.connect(lambda: self._commands.library.use(verdict.name))
            window.open()

    def showEvent(self, event: QShowEvent) -> None:
        """Folders and libraries change while nobody looks."""
        super().showEvent(event)
        self._commands.refresh()
        self._commands.library.load()

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """A wizard for each calibration, and all of them."""
        found: dict[str, Callable[[], object]] = {
            f"calibrate_{name}": partial(self.run, name) for name in self.rows
        }
        return found | {
            "calibrate_new": self.head.new.click,
            "calibrate_open": self.head.open.click,
            "calibrate_everything": self._commands.run_everything,
        }

    def open_path(self, path: Path) -> bool:
        """Open a campaign, or take a calibration's file into the library."""
        return self._commands.open(path)

    def command_line(self) -> str:
        """The commands that calibrate everything of this campaign, or one after the other."""
        return "\n".join(self._commands.command_line(name) for name in ("", *self.rows))

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme

    def release(self) -> None:
        """End what runs; everything captured is kept."""
        self._timer.stop()
        for stop in self._stops:
            stop()
        self._commands.close()
