"""The import dialog: what was found in a folder of another program, and where to save it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QSize, Signal
from PySide6.QtWidgets import (
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QPushButton,
    QWidget,
)

from dsl_app.importing.captures.unit_box import unit_box
from dsl_app.importing.state import PUBLISHED, FileRow, Found, ImportRequest, ImportState, import_view
from dsl_app.shared.evented import follow_any
from dsl_app.shared.known_files import breakable
from dsl_app.shared.widgets.ask_file import ask_file
from dsl_app.shared.widgets.dialogs import JobDialog, use_room
from dsl_app.shared.widgets.forms import ChoiceBox, WholeBox, label, named, push_button, quiet, set_role
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.layouts import STRETCH, row_of
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shared.widgets.read_table import ReadTable, cell

if TYPE_CHECKING:
    from dsl_app.importing.controller import ImportController

_COLUMNS = ("Expected", "Found", "Status", "What to do")
_LARGEST_PX = 20000


class ImportDialog(JobDialog):
    """Follows an `ImportState` whose folder has been checked; the controller imports.

    ``other_chosen`` carries a folder that is to be imported instead.
    """

    other_chosen = Signal(object)

    def __init__(self, state: ImportState, commands: ImportController, parent: QWidget) -> None:
        super().__init__(commands.start, commands.command_line, parent)
        request = state.request.value
        assert request is not None
        self._state, self._commands = state, commands
        #: The folder whose request is shown.
        self._shown: Path | None = None
        self.setWindowTitle("Import")
        use_room(self, parent, QSize(880, 560))
        add_help_key(self, "importing")
        self._make_folder()
        self._make_target(request)
        self._lay_out()
        self._connect()
        self.stops = [
            state.found.follow(self._show_found),
            state.request.follow(self._show_request),
            *follow_any(self._judge, state.busy, state.trouble),
        ]
        self.name.setFocus()

    @property
    def folder_to_save_in(self) -> Path:
        """Where what is imported is saved."""
        return Path(self.home.text())

    # Make ------------------------------------------------------------------------------------------

    def _make_folder(self) -> None:
        self._folder = label("", "muted")
        self.other = push_button("&Another folder…", "Choose another folder to import", self._choose_folder)
        self._summary = label("")
        self.table = ReadTable(
            "Files of the folder",
            "What the published layout expects, what was found, what to do",
            _COLUMNS,
        )
        self.table.wrap(len(_COLUMNS) - 1)
        for column in (0, 1):
            self.table.horizontalHeader().setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)
        self.base = ChoiceBox(
            "Film, sensor and scales of",
            "The folder does not contain the film's pose, the sensor's response and the scale of white.\n"
            "A scan needs the calibration of the rig that captured it.",
            [("The published rig", PUBLISHED), *((name, name) for name in self._state.library.value)],
            lambda base: self._commands.change(base=base),
        )
        self.file = push_button("&File…", "Choose a calibration file (.json)", self._choose_file)
        self._size = QWidget()
        self.width_px, self.height_px = (
            WholeBox(f"{what} of the camera's images", 0, _LARGEST_PX, 0, "px",
                     f"{what} in pixels; needed only if the calibration file does not contain it")
            for what in ("Width", "Height")
        )  # fmt: skip
        for box in (self.width_px, self.height_px):
            box.setSpecialValueText("as in the file")
        self.unit_mm = unit_box()
        self.doubts = label("", "warn", wraps=True)

    def _make_target(self, request: ImportRequest) -> None:
        tip = "Name of the imported scan or calibration; the ending is added"
        self.name = named(QLineEdit(request.target.stem), "Name", tip)
        tip = "Folder of the imported scan or calibration; the source folder is not changed"
        self.home = named(QLineEdit(str(request.target.parent)), "Folder to save in", tip)
        self.browse = push_button("&Choose…", "Choose the folder to save in", self._choose_home)
        self.name_buttons(
            "Import", "Import the folder, completely or not at all", "Close without importing (Escape)"
        )

    def _lay_out(self) -> None:
        head = row_of((self._folder, 1), self.other)
        row_of(self.width_px, label("×", "muted"), self.height_px, STRETCH, on=self._size, margins=0)
        self._form = QFormLayout()
        self._form.addRow("Film, sensor, scales", _row(self.base, self.file))
        self._form.addRow("Camera's images", self._size)
        self._form.addRow("Unit of lengths", self.unit_mm)
        self._form.addRow("", self.doubts)
        self._form.addRow("Name", self.name)
        self._form.addRow("In folder", _row(self.home, self.browse))
        self.column.addLayout(head)
        self.column.addWidget(self._summary)
        self.column.addWidget(self.table, 1)
        self.column.addLayout(self._form)
        self.close_column()

    def _connect(self) -> None:
        commands = self._commands
        for field in (self.name, self.home):
            field.textEdited.connect(lambda _: self._rename())
        for box in (self.width_px, self.height_px):
            box.setKeyboardTracking(False)
            box.valueChanged.connect(
                lambda _: commands.change(camera_px=(self.width_px.value(), self.height_px.value()))
            )
        self.unit_mm.valueChanged.connect(lambda unit_mm: commands.change(unit_mm=unit_mm))

    # Show ------------------------------------------------------------------------------------------

    def _show_found(self, found: Found | None) -> None:
        if found is None:
            return
        self._folder.setText(breakable(found.folder))
        self._summary.setText(found.summary)
        self.doubts.setText(found.doubts)
        self._form.setRowVisible(self.doubts, bool(found.doubts))
        for row in (self._size, self.unit_mm):
            self._form.setRowVisible(row, import_view(self._state).asks_lengths)
        self.table.show_rows([self._items(row) for row in found.rows])

    def _items(self, row: FileRow) -> tuple[Any, ...]:
        harmless = row.status in ("misnamed", "extra", "optional")
        role = "good" if not row.is_odd else "warn" if harmless else "bad"
        return (
            cell(breakable(row.expected or "–")),
            cell("as expected" if row.found == row.expected else breakable(row.found or "–"), "muted"),
            cell(row.status, role),
            cell(row.advice),
        )

    def _show_request(self, request: ImportRequest | None) -> None:
        if request is None:
            return
        if self.base.findData(request.base) < 0:
            self.base.addItem(Path(request.base).name, request.base)
        self.base.choose(request.base)
        # Text that is being typed is not replaced.
        is_other, self._shown = request.folder != self._shown, request.folder
        with quiet(self.width_px, self.height_px, self.unit_mm):
            self.unit_mm.setValue(request.unit_mm)
            for box, size_px in zip((self.width_px, self.height_px), request.camera_px, strict=True):
                box.setValue(size_px)
        for field, text in ((self.name, request.target.stem), (self.home, str(request.target.parent))):
            if is_other or not field.hasFocus():
                field.setText(text)
        self._judge()

    def _judge(self) -> None:
        view = import_view(self._state)
        self.show_status(view.trouble, view.remark, view.is_busy)
        set_role(self.other, "primary" if view.is_hopeless else "")
        (self.other if view.is_hopeless else self.go).setDefault(True)

    # Do --------------------------------------------------------------------------------------------

    def _rename(self) -> None:
        self._commands.rename(self.name.text(), Path(self.home.text()))

    def _choose_folder(self) -> None:
        found = self._state.found.value
        start = "" if found is None else str(found.folder.parent)
        folder = OpenDialog.ask_folder(self, "Import a folder", start)
        if folder is not None:
            self.other_chosen.emit(folder)

    def _choose_file(self) -> None:
        path = ask_file(self, "Choose a calibration", "Calibrations (*.json)")
        if path is not None:
            self._commands.change(base=str(path))

    def _choose_home(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Save in", self.home.text())
        if name:
            self.home.setText(name)
            self._rename()


def _row(field: QWidget, button: QPushButton) -> QHBoxLayout:
    return row_of((field, 1), button)
