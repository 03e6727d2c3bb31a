"""The results of a series as a table; stage positions can be typed into it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QAbstractItemDelegate, QAbstractItemView, QTableWidgetItem, QWidget

from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.state import SeriesKind, SeriesRow, SeriesState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import quiet
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_core.evaluation.time_sweep import FIGURES, best_points

STAGE_HEADS = ("Result", "Position (mm)", "Pixels", "RMS (mm)", "Off the line (mm)", "± (mm)", "Remark")
SWEEP_HEADS = ("Result", "Capture (s)", "Depth (mm)", "Reflectance", "Angle (rad)", "Remark")
TIPS = {
    "Position (mm)": "The stage position; double-click or press F2 to change it",
    "Pixels": "Pixels on the plane of the target",
    "RMS (mm)": "Scatter of single pixels about the plane",
    "Off the line (mm)": "Distance of the plane minus the line fitted over all positions, slope free",
    "± (mm)": "Standard deviation of the distance, from how far the means of patches are off the plane",
    "Capture (s)": "Exposures and latencies of all frames together",
    "Depth (mm)": "RMS error of depth, over single pixels",
    "Reflectance": "RMS error of reflectance, over single pixels and bands",
    "Angle (rad)": "Mean angle between spectra",
    "Remark": "Why a result is not counted, or whether no faster scan beats it",
}
POSITION = 1


class SeriesTable(ReadTable):
    """Follows the rows of a `SeriesState`."""

    def __init__(self, state: SeriesState, control: SeriesController) -> None:
        tip = "Results of the series. Double-click a position to change it."
        super().__init__("Results of the series", tip, STAGE_HEADS)
        self._state, self._control = state, control
        #: What the lines of the table are of; the state may be ahead while somebody types.
        self._shown: tuple[SeriesRow, ...] = ()
        triggers = QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.verticalHeader().setDefaultSectionSize(24)
        self.horizontalHeader().setStretchLastSection(True)
        self.itemChanged.connect(self._typed)
        self.itemSelectionChanged.connect(self._chosen)
        self.stops = follow_any(self.show_series, state.rows, state.test, state.kind)

    def show_series(self) -> None:
        """Show all rows; the selection stays. Who types a position is not disturbed: they are shown after."""
        if self.state() == QAbstractItemView.State.EditingState:
            return
        kind = self._state.kind.value
        heads = STAGE_HEADS if kind is SeriesKind.STAGE else SWEEP_HEADS
        with quiet(self):
            self.setColumnCount(len(heads))
            self.setHorizontalHeaderLabels(heads)
            for column, head in enumerate(heads):
                item = self.horizontalHeaderItem(column)
                if item is not None:
                    item.setToolTip(plain_tip(TIPS.get(head, "")))
            self.show_rows([self._items(texts) for texts in row_texts(self._state)])
            rows = self._shown = self._state.rows.value
            at = next((i for i, row in enumerate(rows) if row.path == self._state.selected.value), None)
            self.clearSelection()
            if at is not None:
                self.selectRow(at)

    def _items(self, texts: RowTexts) -> list[QTableWidgetItem]:
        items = [cell(texts.name), *map(_number, texts.numbers)]
        if self._state.kind.value is SeriesKind.STAGE:
            items[POSITION].setFlags(items[POSITION].flags() | Qt.ItemFlag.ItemIsEditable)
        return [*items, _fixed(cell(texts.remark, "warn" if texts.is_trouble else "muted"))]

    def _typed(self, item: QTableWidgetItem) -> None:
        if item.column() != POSITION or self._state.kind.value is not SeriesKind.STAGE:
            return
        path, text = self._shown[item.row()].path, item.text()
        # The table cannot be refilled while it is still storing what was typed.
        QTimer.singleShot(0, self, lambda: self._keep(path, text))

    def closeEditor(self, editor: QWidget, hint: QAbstractItemDelegate.EndEditHint) -> None:
        """Close the editor, then show what changed while it was open."""
        super().closeEditor(editor, hint)
        QTimer.singleShot(0, self, self.show_series)

    def _keep(self, path: Path, text: str) -> None:
        try:
            value = float(text.replace("−", "-").replace(",", ".").removesuffix("mm"))
        except ValueError:
            value = math.nan
        if math.isfinite(value):
            self._control.set_position(path, value)
        # Shows the position as stored; text that is not a number is dropped.
        self.show_series()

    def _chosen(self) -> None:
        rows = self.selectionModel().selectedRows()
        if rows:
            self._control.select(self._shown[rows[0].row()].path)


@dataclass(frozen=True)
class RowTexts:
    """What a row of the table says; ``is_trouble`` marks a remark on why the result does not count."""

    name: str
    numbers: tuple[str, ...]
    remark: str
    is_trouble: bool = False


def row_texts(state: SeriesState) -> list[RowTexts]:
    """The table of a series, row by row."""
    kind, points = state.kind.value, state.points
    numbers = _stage_numbers(state) if kind is SeriesKind.STAGE else _sweep_numbers(state)
    is_sweep = kind is SeriesKind.SWEEP
    best = {points[i] for i in best_points(points, state.figure.value)} if is_sweep else set()
    found = []
    for row, texts in zip(state.rows.value, numbers, strict=True):
        trouble = row.trouble(kind)
        good = "No faster scan is better" if row.point in best else ""
        remark = trouble or (good if row.is_read(kind) else "Not read yet")
        found.append(RowTexts(row.name, texts, remark, bool(trouble)))
    return found


def _stage_numbers(state: SeriesState) -> list[tuple[str, ...]]:
    """Position, pixels, scatter, deviation and its standard deviation."""
    test = state.test.value
    counted = {row.path: i for i, row in enumerate(state.counted)}
    found: list[tuple[str, ...]] = []
    for row in state.rows.value:
        i, target = counted.get(row.path), row.target
        found.append(
            (
                "" if row.position_mm is None else f"{row.position_mm:.10g}",
                "–" if target is None else str(target.plane.pixels),
                "–" if target is None else f"{target.plane.rms_mm:.3f}",
                "–" if test is None or i is None else f"{test.free.deviations_mm[i]:+.4f}",
                "–" if test is None or i is None else f"{test.std_mm[i]:.4f}",
            )
        )
    return found


def _sweep_numbers(state: SeriesState) -> list[tuple[str, ...]]:
    """Seconds and errors."""
    return [
        ("–",) * (1 + len(FIGURES))
        if row.point is None
        else (f"{row.point.seconds:.1f}", *(row.point.words(figure) for figure in FIGURES))
        for row in state.rows.value
    ]


def _number(text: str) -> QTableWidgetItem:
    return _fixed(cell(text.replace("-", "−"), side=RIGHT))


def _fixed(item: QTableWidgetItem) -> QTableWidgetItem:
    """An item that cannot be typed into."""
    item.setFlags(item.flags() & ~Qt.ItemFlag.ItemIsEditable)
    return item
