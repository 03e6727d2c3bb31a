"""The Compare page: two results beside each other, or several as a series."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QTabWidget, QVBoxLayout

from dsl_app.compare.commands import CompareCommands
from dsl_app.compare.pair.panel import ComparePair
from dsl_app.compare.pair.state import CompareState
from dsl_app.compare.series.commands import SeriesCommands
from dsl_app.compare.series.panel import SeriesPanel
from dsl_app.compare.series.state import SeriesState
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.page import PageWidget, dropped_paths


class ComparePage(PageWidget):
    """Two tabs; what is opened or dropped goes to the one that is seen."""

    def __init__(
        self,
        state: CompareState,
        commands: CompareCommands,
        series_state: SeriesState,
        series_commands: SeriesCommands,
    ) -> None:
        super().__init__()
        self._commands, self._series_commands = commands, series_commands
        self.setAcceptDrops(True)
        self.pair = ComparePair(state, commands)
        self._series = Deferred(lambda: SeriesPanel(series_state, series_commands))
        self.tabs = QTabWidget()
        self.tabs.setDocumentMode(True)
        self.tabs.tabBar().setDrawBase(False)
        self.tabs.tabBar().setAccessibleName("Two results or a series")
        for tab, title, tip in (
            (self.pair, "T&wo results", "Two results, or one against the truth, pixel by pixel"),
            (self._series, "S&eries", "Depth over positions of a stage, or accuracy over time"),
        ):
            self.tabs.setTabToolTip(self.tabs.addTab(tab, title), tip)
        QVBoxLayout(self).addWidget(self.tabs)

    @property
    def series(self) -> SeriesPanel:
        """The series, made when somebody looks."""
        return self._series.content

    def show_series(self) -> None:
        """Show the tab of several results."""
        self.tabs.setCurrentWidget(self._series)

    @property
    def _shows_series(self) -> bool:
        return self.tabs.currentWidget() is self._series

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """Actions of the table that this page does."""
        return {"series_add": self._add_to_series}

    def _add_to_series(self) -> None:
        self.show_series()
        self.series.choose()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take folders."""
        if dropped_paths(event.mimeData()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Add to the series, or put what is dropped on a free side."""
        paths = dropped_paths(event.mimeData())
        if self._shows_series:
            self._series_commands.add(paths)
            return
        for path in paths:
            if not self._commands.open(path):
                self._commands.open_side(path, second=False)

    def compare(self, first: Path, second: Path) -> None:
        """Compare two results, where one sees it."""
        self.tabs.setCurrentWidget(self.pair)
        self._commands.open_both(first, second)

    def open_path(self, path: Path) -> bool:
        """Take a result: for the series, or on a free side."""
        if self._shows_series and self._series_commands.knows(path):
            self._series_commands.add([path])
            return True
        return self._commands.open(path)

    def command_line(self) -> str:
        """The command that does what the tab shows."""
        return (self._series_commands if self._shows_series else self._commands).command_line()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self.pair.apply_theme(theme)
        self._series.apply_theme(theme)

    def release(self) -> None:
        """Follow nothing more."""
        self.pair.release()
        if self._series.made is not None:
            self._series.made.release()
