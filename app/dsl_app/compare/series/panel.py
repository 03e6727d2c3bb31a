"""Several results together: their table and figures above, a plot and the plane of one of them below."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QHeaderView,
    QSplitter,
    QVBoxLayout,
    QWidget,
)

from dsl_app.compare.series.commands import SeriesCommands
from dsl_app.compare.series.picture import SeriesPicture
from dsl_app.compare.series.plot import SeriesPlot
from dsl_app.compare.series.state import Kind, SeriesState
from dsl_app.compare.series.table import SeriesTable
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import ChoiceBox, push_button, remark_line, show_remark
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_core.evaluation.stage_test import stage_table
from dsl_core.evaluation.time_sweep import FIGURES

NOTHING = {
    Kind.STAGE: (
        "Add results of one flat target at three or more positions of a stage: choose a folder with all of"
        " them, or drop them here. Positions come from names like “stage 695.2 mm.zarr”, or are typed into"
        " the table."
    ),
    Kind.SWEEP: (
        "Add results of one scene that was scanned by several plans: choose a folder with all of them, or"
        " drop them here. They are compared with the truth of the twin, or with one of them."
    ),
}
#: Room for the longest figure's name.
FIGURES_PX = 400


class SeriesPanel(QWidget):
    """Follows a `SeriesState` and asks a controller."""

    def __init__(self, state: SeriesState, commands: SeriesCommands) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.kind = ChoiceBox("Question", "What the results are asked together")
        for kind in Kind:
            self.kind.addItem(kind.value, kind)
        self.add = push_button("&Add results…", "Choose a result, or a folder that holds several")
        self.remove = push_button(
            "Re&move", "Take the selected result out of the series (Delete); undo brings it back"
        )
        self.against = ChoiceBox("Compare with", "What the scans are compared with")
        self.figure = ChoiceBox("Error", "The error that the plot shows")
        for figure in FIGURES:
            self.figure.addItem(figure.words, figure)
        self.report = push_button("Write &report…", "Table, figures, plot and pictures as an HTML page")
        self.hint = remark_line()
        self.hint.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.table = SeriesTable(state, commands)
        self.figures = ReadTable(
            "Figures of the series", "What all positions say together", ("Figure", "Value", "Unit")
        )
        self.figures.setMinimumWidth(FIGURES_PX)
        self.figures.verticalHeader().setDefaultSectionSize(24)
        self.figures.horizontalHeader().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self._plot = Deferred(lambda: SeriesPlot(state))
        self._picture = Deferred(lambda: SeriesPicture(state, commands))
        set_help(self, "comparing#a-series")
        set_help(self.figures, "comparing#depth-over-stage-positions")
        self._stops: list[Callable[[], None]] = []
        self._lay_out()
        self._connect()

    @property
    def plot(self) -> SeriesPlot:
        """The plot, made when somebody looks."""
        return self._plot.content

    @property
    def picture(self) -> SeriesPicture:
        """The plane of the selected row, made when somebody looks."""
        return self._picture.content

    def _lay_out(self) -> None:
        head = QHBoxLayout()
        for widget in (self.kind, self.add, self.remove, self.against, self.figure):
            head.addWidget(widget)
        head.addStretch(1)
        head.addWidget(self.report)
        above = _splitter(Qt.Orientation.Horizontal, (self.table, 3), (self.figures, 2))
        below = _splitter(Qt.Orientation.Horizontal, (self._plot, 3), (self._picture, 2))
        self.parts = _splitter(Qt.Orientation.Vertical, (above, 2), (below, 3))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 8, 0, 0)
        column.addLayout(head)
        column.addWidget(self.hint)
        column.addWidget(self.parts, 1)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.kind.activated.connect(lambda _: commands.ask(self.kind.currentData()))
        self.add.clicked.connect(self.choose)
        self.remove.clicked.connect(self._remove)
        delete = QShortcut(QKeySequence(Qt.Key.Key_Delete), self.table)
        delete.setContext(Qt.ShortcutContext.WidgetShortcut)
        delete.activated.connect(self._remove)
        self.against.activated.connect(lambda _: commands.compare_with(self.against.currentData()))
        self.figure.activated.connect(lambda _: commands.show_figure(self.figure.currentData()))
        self.report.clicked.connect(self._choose_report)
        self._stops = [
            *self.table.stops,
            state.kind.follow(lambda _: self._show()),
            state.rows.follow(lambda _: self._show()),
            state.test.follow(lambda _: self._show()),
            state.advice.follow(lambda _: self._show()),
            state.busy.follow(lambda _: self._show()),
            state.against.follow(lambda _: self._show()),
            state.selected.follow(lambda _: self._show()),
            state.figure.follow(lambda _: self.table.show_series()),
        ]

    # Ask -------------------------------------------------------------------------------------------

    def choose(self) -> None:
        """Choose results."""
        name = QFileDialog.getExistingDirectory(self, "Add a result, or a folder with several")
        if name:
            self._commands.add([Path(name)])

    def _remove(self) -> None:
        if self._state.selected.value is not None:
            self._commands.remove(self._state.selected.value)

    def _choose_report(self) -> None:
        rows = self._state.rows.value
        if not rows:
            return
        start = rows[0].path.parent / "series.html"
        name, _ = QFileDialog.getSaveFileName(self, "Write the report", str(start), "Web page (*.html)")
        if name:
            self._commands.write_report(Path(name))

    # Show ------------------------------------------------------------------------------------------

    def _show(self) -> None:
        state = self._state
        kind, rows = state.kind.value, state.rows.value
        is_stage, is_answered = kind is Kind.STAGE, bool(rows) and not state.advice.value
        text = f"{state.busy.value}…" if state.busy.value else state.advice.value
        show_remark(self.hint, text if rows else NOTHING[kind])
        self.kind.setCurrentIndex(self.kind.findData(kind))
        self.parts.setVisible(bool(rows))
        self.remove.setEnabled(state.selected_row is not None)
        self.report.setEnabled(is_answered and not state.busy.value)
        for widget, is_seen in (
            (self.against, not is_stage),
            (self.figure, not is_stage),
            (self.figures, is_stage),
            (self._picture, is_stage),
        ):
            widget.setVisible(is_seen)
        self._show_choices()
        self._show_figures()

    def _show_choices(self) -> None:
        paths, against = [row.path for row in self._state.rows.value], self._state.against.value
        # Its row may have been removed; it is compared with all the same.
        others = [] if against is None or against in paths else [against]
        wanted = [("Truth of the twin", None), *((path.stem, path) for path in (*paths, *others))]
        box = self.against
        if wanted != [(box.itemText(i), box.itemData(i)) for i in range(box.count())]:
            box.clear()
            for text, path in wanted:
                box.addItem(text, path)
        box.setCurrentIndex([path for _, path in wanted].index(against))

    def _show_figures(self) -> None:
        test = self._state.test.value
        rows = () if test is None else stage_table(test)
        self.figures.show_rows(
            [
                (cell(row.figure), cell(row.words.replace("-", "−"), side=RIGHT), cell(row.unit))
                for row in rows
            ]
        )

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self.table.apply_theme(theme)
        self._plot.apply_theme(theme)
        self._picture.apply_theme(theme)

    def release(self) -> None:
        """Follow nothing more."""
        late = [part.stops for part in (self._plot.made, self._picture.made) if part is not None]
        for stop in (*self._stops, *chain.from_iterable(late)):
            stop()


def _splitter(direction: Qt.Orientation, *parts: tuple[QWidget, int]) -> QSplitter:
    made = QSplitter(direction)
    made.setChildrenCollapsible(False)
    for i, (widget, stretch) in enumerate(parts):
        made.addWidget(widget)
        made.setStretchFactor(i, stretch)
    return made
