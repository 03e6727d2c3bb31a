"""The Compare page: two results side by side, or several as a series."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtGui import QDragEnterEvent, QDropEvent, QShowEvent

from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.panel import PairPanel
from dsl_app.compare.pair.state import PairState
from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.panel import SeriesPanel
from dsl_app.compare.series.state import SeriesState
from dsl_app.shared.settings import RecentFiles
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.layouts import column_of, tabs_of
from dsl_app.shared.widgets.page import PageWidget, dropped_paths


class ComparePage(PageWidget):
    """Two tabs; what is opened or dropped goes to the visible one."""

    def __init__(
        self,
        state: PairState,
        control: PairController,
        series_state: SeriesState,
        series_control: SeriesController,
        recent: RecentFiles,
    ) -> None:
        super().__init__()
        self._control, self._series_control = control, series_control
        self.setAcceptDrops(True)
        self.pair = PairPanel(state, control, recent)
        self.series = Deferred(lambda: SeriesPanel(series_state, series_control))
        self.tabs = tabs_of(
            "Two results or a series",
            (self.pair, "Tw&o results", "Compare two results, or one with its ground truth, pixel by pixel"),
            (self.series, "Ser&ies", "Depth over stage positions, or accuracy over time"),
        )
        column_of(self.tabs, on=self)

    def show_series(self) -> None:
        """Show the Series tab."""
        self.tabs.setCurrentWidget(self.series)

    @property
    def _shows_series(self) -> bool:
        return self.tabs.currentWidget() is self.series

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """Actions that this page handles."""
        return {"series_add": self._add_to_series}

    def _add_to_series(self) -> None:
        self.show_series()
        self.series.content.choose()

    def showEvent(self, event: QShowEvent) -> None:
        """Read results again that were replaced while another page was open."""
        super().showEvent(event)
        self._control.read_again()
        self._series_control.read_again()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accept folders."""
        if dropped_paths(event.mimeData()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Add to the series, or open what is dropped on a free side."""
        paths = dropped_paths(event.mimeData())
        if self._shows_series:
            self._series_control.add(paths)
            return
        for path in paths:
            if not self._control.open(path):
                self._control.open_side(path, second=False)

    def compare(self, first: Path, second: Path) -> None:
        """Compare two results on the first tab."""
        self.tabs.setCurrentWidget(self.pair)
        self._control.open_both(first, second)

    def open_path(self, path: Path) -> bool:
        """Open a result: in the series, or on a free side."""
        if self._shows_series and self._series_control.knows(path):
            self._series_control.add([path])
            return True
        return self._control.open(path)

    def command_line(self) -> str:
        """The command that does what the visible tab shows."""
        return (self._series_control if self._shows_series else self._control).command_line()
