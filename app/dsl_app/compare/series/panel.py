"""Several results together: their table and figures above, a plot and the plane of one of them below."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import QWidget

from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.picture import SeriesPicture
from dsl_app.compare.series.plot import SeriesPlot
from dsl_app.compare.series.state import SeriesKind, SeriesState, series_display
from dsl_app.compare.series.table import SeriesTable
from dsl_app.compare.verdict_table import VerdictTable
from dsl_app.shared.evented import follow_any
from dsl_app.shared.widget_state import ButtonState, LabelState
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import ChoiceBox, push_button, remark_line, show_button, show_label
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of, splitter
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shared.widgets.save_dialog import ask_place
from dsl_core.evaluation.stage_test import stage_table
from dsl_core.evaluation.time_sweep import FIGURES


class SeriesPanel(QWidget):
    """Follows a `SeriesState` and asks its controller."""

    def __init__(self, state: SeriesState, control: SeriesController) -> None:
        super().__init__()
        self._state, self._control = state, control
        kinds = [(kind.value, kind) for kind in SeriesKind]
        self.kind = ChoiceBox("Series", "What to measure with the results", kinds, control.ask)
        self.add = push_button(
            "&Add results…", "Choose a result, or a folder that contains several", self.choose
        )
        self.remove = push_button(
            "Re&move", "Remove the selected result from the series (Delete); can be undone", self._remove
        )
        tip = "What the scans are compared with"
        self.against = ChoiceBox("Compare with", tip, do=control.compare_with)
        figures = [(figure.words, figure) for figure in FIGURES]
        self.figure = ChoiceBox("Error", "The error that the plot shows", figures, control.show_figure)
        tip = "Save table, figures, plot and pictures as an HTML page"
        self.report = push_button("Write re&port…", tip, self._choose_report)
        self.hint = remark_line()
        self.hint.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.table = SeriesTable(state, control)
        self.figures = VerdictTable("Figures of the series", "The figures of all positions together")
        # Slow to make: made when they are first seen.
        self.plot = Deferred(lambda: SeriesPlot(state))
        self.picture = Deferred(lambda: SeriesPicture(state, control))
        set_help(self, "comparing#a-series")
        set_help(self.figures, "comparing#depth-over-stage-positions")
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        head = row_of(self.kind, self.add, self.remove, self.against, self.figure, STRETCH, self.report)
        above = splitter(Qt.Orientation.Horizontal, (self.table, 3), (self.figures, 2))
        below = splitter(Qt.Orientation.Horizontal, (self.plot, 3), (self.picture, 2))
        self.parts = splitter(Qt.Orientation.Vertical, (above, 2), (below, 3))
        column_of(head, self.hint, (self.parts, 1), on=self, margins=(0, 8, 0, 0))

    def _connect(self) -> None:
        state = self._state
        delete = QShortcut(QKeySequence(Qt.Key.Key_Delete), self.table, self._remove)
        delete.setContext(Qt.ShortcutContext.WidgetShortcut)
        shown = (state.kind, state.rows, state.advice, state.busy, state.against, state.selected)
        self.stops = [
            *follow_any(self._show, *shown),
            state.test.follow(
                lambda test: self.figures.show_verdicts(() if test is None else stage_table(test))
            ),
            state.figure.follow(lambda _: self.table.show_series()),
        ]

    def choose(self) -> None:
        """Ask for a result or a folder of results."""
        path = OpenDialog.ask(self, "Add a result, or a folder that contains several", takes_folders=True)
        if path is not None:
            self._control.add([path])

    def _remove(self) -> None:
        if self._state.selected.value is not None:
            self._control.remove(self._state.selected.value)

    def _choose_report(self) -> None:
        rows, asked = self._state.rows.value, self._state.reported
        if not rows:
            return
        start = rows[0].path.parent / "series.html"
        path = ask_place(self, "Write the report", str(start), "Web page (*.html)")
        if path is not None:
            self._control.write_report(path, asked)

    def _show(self) -> None:
        display = series_display(self._state)
        show_label(self.hint, LabelState(display.remark, "muted"))
        self.kind.choose(self._state.kind.value)
        self.parts.setVisible(display.has_rows)
        self.remove.setEnabled(display.can_remove)
        can = display.can_report
        show_button(self.add, ButtonState(is_primary=not can))
        show_button(self.report, ButtonState(is_enabled=can, is_primary=can))
        for widget, is_seen in (
            (self.against, not display.is_stage),
            (self.figure, not display.is_stage),
            (self.figures, display.is_stage),
            (self.picture, display.is_stage),
        ):
            widget.setVisible(is_seen)
        box = self.against
        if list(display.references) != [(box.itemText(i), box.itemData(i)) for i in range(box.count())]:
            box.clear()
            for text, path in display.references:
                box.addItem(text, path)
        box.setCurrentIndex([path for _, path in display.references].index(self._state.against.value))
