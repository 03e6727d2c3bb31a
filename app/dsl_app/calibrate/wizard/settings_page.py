"""The settings of a calibration, with what each means; the campaign remembers them."""

from __future__ import annotations

import json
from functools import partial
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QFormLayout, QHBoxLayout, QLabel, QLineEdit, QWidget

from dsl_app.calibrate.setting_words import setting_title
from dsl_app.calibrate.wizard.state import SettingRow
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, WholeBox, label, named, quiet, remark_line
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, scrolled
from dsl_core.model.board import Board, Charuco, Checkerboard

F = TypeVar("F", bound=QWidget)
INTRODUCTION = (
    "Captures follow these settings, which the campaign remembers. Captures made with other settings stay on"
    " disk."
)
FIELD_PX = 420
NOTHING = "This calibration has no settings."


class SettingsPage(QWidget):
    """A row for each setting; ``edited`` tells key and text of one that a person changed."""

    edited = Signal(str, str)

    def __init__(self) -> None:
        super().__init__()
        self._shown: tuple[SettingRow, ...] = ()
        self.fields: dict[str, QLineEdit | QCheckBox | BoardEdit] = {}
        self._docs: dict[str, QLabel] = {}
        self._intro = label(INTRODUCTION, "muted", wraps=True)
        self._trouble = remark_line()
        self._trouble.setProperty("role", "bad")
        self._trouble.setAccessibleName("What is wrong with the settings")
        content = QWidget()
        self._form = QFormLayout(content)
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        area = scrolled(content)
        column_of(self._intro, self._trouble, (area, 1), on=self, margins=(8, 0, 0, 0))
        self.say("")

    def say(self, trouble: str) -> None:
        """Say what is wrong with a setting; empty for nothing."""
        self._trouble.setText(trouble)
        self._trouble.setVisible(bool(trouble))

    def show_settings(self, rows: tuple[SettingRow, ...]) -> None:
        """Show settings; fields of the same keys stay and keep the focus."""
        if [row.key for row in rows] != [row.key for row in self._shown]:
            self._build(rows)
        self._shown = rows
        self._intro.setText(INTRODUCTION if rows else NOTHING)
        for row in rows:
            field = self.fields[row.key]
            if row.key in self._docs:
                self._docs[row.key].setText(f"{row.doc} {row.understood}".strip())
            if isinstance(field, QCheckBox):
                field.setChecked(row.value == "true")
            elif isinstance(field, BoardEdit):
                field.show_text(row.value)
            else:
                field.setText(row.value)
                field.setPlaceholderText(row.default or row.used or "none")

    def _build(self, rows: tuple[SettingRow, ...]) -> None:
        while self._form.rowCount():
            self._form.removeRow(0)
        self.fields, self._docs = {}, {}
        for row in rows:
            name = setting_title(row.key)
            field = self._field(row, name)
            self.fields[row.key] = field
            if not row.doc:
                self._form.addRow(name, field)
                continue
            # What explains a field stands close to it.
            doc = self._docs[row.key] = label(row.doc, "muted", wraps=True)
            self._form.addRow(name, boxed(column_of(field, doc, margins=0, spacing=2)))

    def _field(self, row: SettingRow, name: str) -> QLineEdit | QCheckBox | BoardEdit:
        tell = partial(self._tell, row.key)
        default = f" Default: {row.default}." if row.default and row.kind == "text" else ""
        tip = f"{row.doc}{default}" or name
        if row.kind == "switch":
            switch = QCheckBox()
            switch.clicked.connect(lambda on: tell("true" if on else "false"))
            return _named(switch, name, tip)
        if row.kind == "board":
            board = BoardEdit(name)
            board.edited.connect(tell)
            return _named(board, name, tip)
        line = QLineEdit()
        line.editingFinished.connect(lambda: tell(line.text()))
        return _named(line, name, tip)

    def _tell(self, key: str, text: str) -> None:
        known = next(row.value for row in self._shown if row.key == key)
        # An empty field means the default.
        default = next(row.default for row in self._shown if row.key == key)
        value = text.strip() or default
        if value != known:
            self.edited.emit(key, value)


def _named(field: F, name: str, tip: str) -> F:
    field.setMaximumWidth(FIELD_PX)
    return named(field, name, tip)


class BoardEdit(QWidget):
    """A printed board: its kind, how many squares, how large they measured.

    ``edited`` tells it as the text of a setting.
    """

    edited = Signal(str)

    def __init__(self, name: str) -> None:
        super().__init__()
        self._board: Board = Checkerboard(columns=11, rows=7, square_mm=20.0)
        self.kind = ChoiceBox(
            f"Kind of {name}",
            "A checkerboard, or a ChArUco board with a marker in each white square",
            [("Checkerboard, inner corners", "checkerboard"), ("ChArUco, squares", "charuco")],
            lambda _: self._tell(),
        )
        self.columns = WholeBox("Columns", 3, 99, 11, tip="Inner corners, or squares of a ChArUco, across")
        self.rows = WholeBox("Rows", 3, 99, 7, tip="Inner corners, or squares of a ChArUco, down")
        self.square = NumberBox("Side of a square", 1, 999, 20, "mm", 3, "Measured over many printed squares")
        self.marker = NumberBox("Side of a marker", 1, 999, 15, "mm", 3, "Measured on the printed board")
        self._marker_label = label("marker", "muted")
        column_of(
            self.kind,
            _row(self.columns, label("×", "muted"), self.rows),
            _row(label("square", "muted"), self.square, self._marker_label, self.marker),
            on=self,
            margins=0,
        )
        for box in (self.columns, self.rows, self.square, self.marker):
            box.setKeyboardTracking(False)
            box.valueChanged.connect(lambda _: self._tell())

    def show_text(self, text: str) -> None:
        """Show the board of a setting's text; one that cannot be read changes nothing."""
        try:
            self._board = TypeAdapter[Board](Board).validate_json(text)
        except ValidationError:
            return
        boxes = (self.kind, self.columns, self.rows, self.square, self.marker)
        with quiet(*boxes):
            board = self._board
            self.kind.choose(board.kind)
            self.columns.setValue(board.columns)
            self.rows.setValue(board.rows)
            self.square.setValue(board.square_mm)
            if isinstance(board, Charuco):
                self.marker.setValue(board.marker_mm)
        self._show_marker(isinstance(board, Charuco))

    def _show_marker(self, on: bool) -> None:
        self.marker.setVisible(on)
        self._marker_label.setVisible(on)

    def _tell(self) -> None:
        values: dict[str, object] = {
            "kind": self.kind.currentData(),
            "columns": self.columns.value(),
            "rows": self.rows.value(),
            "square_mm": self.square.value(),
        }
        is_charuco = values["kind"] == "charuco"
        self._show_marker(is_charuco)
        if is_charuco:
            values["marker_mm"] = self.marker.value()
            if isinstance(self._board, Charuco):
                values |= {"dictionary": self._board.dictionary, "legacy": self._board.legacy}
        self.edited.emit(_text_of(values))


def _row(*widgets: QWidget) -> QHBoxLayout:
    return row_of(*widgets, STRETCH)


def _text_of(values: dict[str, object]) -> str:
    """A board as a setting's text; an impossible one as it is, so that the engine says what is wrong."""
    try:
        return TypeAdapter[Board](Board).validate_python(values).model_dump_json()
    except ValidationError:
        return json.dumps(values)
