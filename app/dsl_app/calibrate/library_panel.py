"""The library of calibrations: named, dated, with serial numbers, settings and errors."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QFileDialog,
    QGroupBox,
    QHBoxLayout,
    QMessageBox,
    QPushButton,
    QSplitter,
    QTableWidgetItem,
    QTextBrowser,
    QVBoxLayout,
)

from dsl_app.calibrate.commands import LibraryCommands
from dsl_app.calibrate.library_words import NOTHING, details_of
from dsl_app.calibrate.state import CalibrateState
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.read_table import ReadTable, cell
from dsl_core.io.calibration_library import LibraryLine

_COLUMNS = ("Name", "Stored", "Use", "Camera", "Projector", "Outside limits")
#: Filters of the export dialog, and the forms they mean.
FORMS = {
    "Everything, for another computer (*.json)": "entry",
    "The rig alone (*.json)": "rig",
    "Published layout, a folder (*)": "published",
}


class LibraryPanel(QGroupBox):
    """Lists every version, tells of the selected one, and acts on it."""

    def __init__(self, state: CalibrateState, commands: LibraryCommands) -> None:
        super().__init__("Library of calibrations")
        self._state, self._commands = state, commands
        self.table = _table()
        self.details = QTextBrowser()
        self.details.setAccessibleName("Details of the calibration")
        self.details.setToolTip("Conditions, dates and figures of the selected calibration")
        self._note = label("", "muted")
        self._note.setWordWrap(True)
        self.use = self._button("&Use for scans", "Scan with this calibration from now on", self._use)
        self.report = self._button("Show &report", "Open its report in the browser", self._report)
        self.restore = self._button(
            "Ma&ke current", "Let this older version be the current one; none is lost", self._restore
        )
        self.check = self._button(
            "Check for &drift…",
            "One quick shot of a flat target: is the rig as calibrated?",
            self._check,
        )
        self.export = self._button("E&xport…", "Write it for another computer or program", self._export)
        self.import_ = self._button("&Import…", "Take a calibration's file into the library", self._import)
        self._lay_out()
        self.table.itemSelectionChanged.connect(self._select)
        self.table.itemActivated.connect(lambda _: self._report())
        self.stops: list[Callable[[], None]] = [
            state.library.follow(self._list),
            state.in_use.follow(lambda _: self._list(state.library.value)),
            state.note.follow(self._show_note),
        ]

    def _button(self, text: str, tip: str, act: Callable[[], None]) -> QPushButton:
        made = QPushButton(text)
        made.setToolTip(tip)
        made.clicked.connect(lambda: act())
        return made

    def _lay_out(self) -> None:
        split = QSplitter(Qt.Orientation.Horizontal)
        split.setChildrenCollapsible(False)
        split.addWidget(self.table)
        split.addWidget(self.details)
        split.setStretchFactor(0, 3)
        split.setStretchFactor(1, 2)
        row = QHBoxLayout()
        for button in (self.use, self.report, self.restore, self.check, self.export):
            row.addWidget(button)
        row.addStretch(1)
        row.addWidget(self.import_)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 4, 0, 0)
        column.addWidget(split, 1)
        self.table.setMinimumHeight(110)
        column.addLayout(row)
        column.addWidget(self._note)

    def _show_note(self, text: str) -> None:
        self._note.setText(text)
        self._note.setVisible(bool(text))

    # The list --------------------------------------------------------------------------------------

    @property
    def line(self) -> LibraryLine | None:
        """The version that is selected."""
        rows = {index.row() for index in self.table.selectedIndexes()}
        lines = self._state.library.value
        return lines[min(rows)] if rows and min(rows) < len(lines) else None

    @property
    def key(self) -> str:
        """What names the selected version: its name, with the stamp unless it is the current one."""
        line = self.line
        if line is None:
            return ""
        return line.name if line.is_current else f"{line.name}@{line.stamp}"

    def _list(self, lines: tuple[LibraryLine, ...]) -> None:
        selected = max(self.table.currentRow(), 0)
        self.table.show_rows([self._items(line) for line in lines])
        if lines:
            self.table.selectRow(min(selected, len(lines) - 1))
        self._select()

    def _items(self, line: LibraryLine) -> list[QTableWidgetItem]:
        items = [cell(text) for text in self._texts(line)]
        if line.error:
            for item in items:
                item.setToolTip(line.error)
        return items

    def _texts(self, line: LibraryLine) -> tuple[str, ...]:
        used = self._state.in_use.value in (f"{line.name}@{line.stamp}", line.name if line.is_current else "")
        use = "scans" if used else ("current" if line.is_current else "")
        stored = _date_of(line.stamp)
        if line.entry is None:
            return line.name, stored, use, "damaged", "", ""
        rig = line.entry.rig
        missed = [str(figure) for note in rig.calibrations for figure in note.failed]
        return (
            line.name,
            stored,
            use,
            f"{rig.provenance.camera_serial or '–'}, {rig.camera.width_px} × {rig.camera.height_px} px",
            rig.provenance.projector_serial or "–",
            ", ".join(missed) or "none",
        )

    def _select(self) -> None:
        line = self.line
        readable = line is not None and line.entry is not None
        for button in (self.use, self.report, self.check, self.export):
            button.setEnabled(readable)
        self.restore.setEnabled(readable and line is not None and not line.is_current)
        self.details.setHtml(NOTHING if line is None else details_of(line))

    # Acts ------------------------------------------------------------------------------------------

    def _use(self) -> None:
        self._commands.use(self.key)

    def _report(self) -> None:
        if self.report.isEnabled():
            self._commands.report(self.key)

    def _restore(self) -> None:
        line = self.line
        if line is not None:
            self._commands.restore(line.name, line.stamp)

    def _check(self) -> None:
        if not self._commands.must_be_placed:
            self._commands.check(self.key)
            return
        box = QMessageBox(self)
        box.setWindowTitle("Check for drift")
        box.setText("Mount the film, and place a flat, matt target that fills the picture. What is it?")
        spectralon = box.addButton("The &Spectralon", QMessageBox.ButtonRole.AcceptRole)
        other = box.addButton("&Another target", QMessageBox.ButtonRole.AcceptRole)
        other.setToolTip("The light is not judged then, as nothing says how bright the target is")
        box.addButton(QMessageBox.StandardButton.Cancel)
        box.exec()
        wanted, is_spectralon = box.clickedButton() in (spectralon, other), box.clickedButton() is spectralon
        # Else it would stay as long as the page; before its answer is read, it must not go.
        box.deleteLater()
        if wanted:
            self._commands.check(self.key, is_spectralon)

    def _export(self) -> None:
        line = self.line
        if line is None:
            return
        name, chosen = QFileDialog.getSaveFileName(
            self, "Export a calibration", f"{line.name}.json", ";;".join(FORMS)
        )
        if name:
            # The dialog asked before it named a file that exists.
            self._commands.export(self.key, Path(name), FORMS.get(chosen, "entry"), overwrite=True)

    def _import(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Import a calibration", "", "Calibrations (*.json)")
        if name:
            self._commands.take_in(Path(name))


def _table() -> ReadTable:
    table = ReadTable(
        "Calibrations of this computer", "Every version of every calibration, the newest first", _COLUMNS
    )
    table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    table.horizontalHeader().setStretchLastSection(True)
    return table


def _date_of(stamp: str) -> str:
    """When a version was stored, where the reader lives."""
    try:
        stored = datetime.strptime(f"{stamp}+0000", "%Y%m%d-%H%M%S-%f%z")
    except ValueError:
        return stamp
    return stored.astimezone().strftime("%Y-%m-%d %H:%M")
