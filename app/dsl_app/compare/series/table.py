"""The results of a series as a table; positions of the stage can be typed into it."""

from __future__ import annotations

import math
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QAbstractItemView, QTableWidgetItem

from dsl_app.compare.series.commands import SeriesCommands
from dsl_app.compare.series.state import Kind, Row, SeriesState
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_core.evaluation.time_sweep import FIGURES, best_points

STAGE_HEADS = ("Result", "Position (mm)", "Pixels", "RMS (mm)", "Off the line (mm)", "± (mm)", "Remark")
SWEEP_HEADS = ("Result", "Capture (s)", "Depth (mm)", "Reflectance", "Angle (rad)", "Remark")
TIPS = {
    "Position (mm)": "Where the stage stood; double-click or press F2 to type another",
    "Pixels": "Pixels that lie on the plane of the target",
    "RMS (mm)": "Scatter of single pixels about their plane",
    "Off the line (mm)": "Distance of the plane minus the straight line over all positions, slope free",
    "± (mm)": "One standard deviation of the distance, from how far means of patches lie off the plane",
    "Capture (s)": "Exposures and latencies of all frames",
    "Depth (mm)": "Root mean square error of depth, over single pixels",
    "Reflectance": "Root mean square error of reflectance, over single pixels and bands",
    "Angle (rad)": "Mean angle between spectra",
    "Remark": "Why a result does not count, or whether no quicker one beats it",
}
POSITION = 1


class SeriesTable(ReadTable):
    """Follows the rows of a `SeriesState`."""

    def __init__(self, state: SeriesState, commands: SeriesCommands) -> None:
        tip = "Results of the series. Double-click a position to type another."
        super().__init__("Results of the series", tip, STAGE_HEADS)
        self._state, self._commands, self._theme = state, commands, DARK
        triggers = QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.verticalHeader().setDefaultSectionSize(24)
        self.horizontalHeader().setStretchLastSection(True)
        self.itemChanged.connect(self._typed)
        self.itemSelectionChanged.connect(self._chosen)
        self.stops = [
            state.rows.changed.connect(lambda _: self.show_series()),
            state.test.changed.connect(lambda _: self.show_series()),
            state.kind.changed.connect(lambda _: self.show_series()),
        ]
        self.show_series()

    def show_series(self) -> None:
        """Show all rows, the selected one still selected."""
        kind = self._state.kind.value
        heads = STAGE_HEADS if kind is Kind.STAGE else SWEEP_HEADS
        self.blockSignals(True)
        self.setColumnCount(len(heads))
        self.setHorizontalHeaderLabels(heads)
        for column, head in enumerate(heads):
            item = self.horizontalHeaderItem(column)
            if item is not None:
                item.setToolTip(TIPS.get(head, ""))
        self.show_rows(self._stage_rows() if kind is Kind.STAGE else self._sweep_rows())
        rows = self._state.rows.value
        at = next((i for i, row in enumerate(rows) if row.path == self._state.selected.value), None)
        self.clearSelection()
        if at is not None:
            self.selectRow(at)
        self.blockSignals(False)

    def _stage_rows(self) -> list[list[QTableWidgetItem]]:
        test = self._state.test.value
        counted = {row.path: i for i, row in enumerate(self._state.counted)}
        found = []
        for row in self._state.rows.value:
            i = counted.get(row.path) if test is not None else None
            target = row.target
            texts = (
                "–" if target is None else str(target.plane.pixels),
                "–" if target is None else f"{target.plane.rms_mm:.3f}",
                "–" if test is None or i is None else f"{test.free.deviations_mm[i]:+.4f}",
                "–" if test is None or i is None else f"{test.std_mm[i]:.4f}",
            )
            found.append([cell(row.name), self._position(row), *map(_number, texts), self._remark(row)])
        return found

    def _sweep_rows(self) -> list[list[QTableWidgetItem]]:
        points = self._state.points
        best = {points[i].name for i in best_points(points, self._state.figure.value)}
        found = []
        for row in self._state.rows.value:
            point = row.point
            texts = ["–"] * (1 + len(FIGURES))
            if point is not None:
                texts = [f"{point.seconds:.1f}", *(point.words(figure) for figure in FIGURES)]
            good = "No quicker one is better" if point is not None and point.name in best else ""
            found.append([cell(row.name), *map(_number, texts), self._remark(row, good)])
        return found

    def _position(self, row: Row) -> QTableWidgetItem:
        known = row.position_mm
        item = _number("" if known is None else f"{known:g}")
        item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable)
        return item

    def _remark(self, row: Row, good: str = "") -> QTableWidgetItem:
        kind = self._state.kind.value
        trouble = row.trouble(kind)
        if trouble:
            return _fixed(cell(trouble, self._theme.warn))
        return _fixed(cell(good if row.is_read(kind) else "Not read yet", self._theme.muted))

    # Ask -------------------------------------------------------------------------------------------

    def _typed(self, item: QTableWidgetItem) -> None:
        if item.column() != POSITION or self._state.kind.value is not Kind.STAGE:
            return
        path, text = self._state.rows.value[item.row()].path, item.text()
        # The table is filled anew, which it cannot be while it still keeps what was typed.
        QTimer.singleShot(0, self, lambda: self._keep(path, text))

    def _keep(self, path: Path, text: str) -> None:
        try:
            value = float(text.replace("−", "-").replace(",", ".").removesuffix("mm"))
        except ValueError:
            value = math.nan
        if math.isfinite(value):
            self._commands.set_position(path, value)
        # What was typed is shown as it is kept; what is no number is not.
        self.show_series()

    def _chosen(self) -> None:
        rows = self.selectionModel().selectedRows()
        if rows:
            self._commands.select(self._state.rows.value[rows[0].row()].path)

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.show_series()


def _number(text: str) -> QTableWidgetItem:
    return _fixed(cell(text.replace("-", "−"), side=RIGHT))


def _fixed(item: QTableWidgetItem) -> QTableWidgetItem:
    """An item that cannot be typed into."""
    item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEditable)
    return item
