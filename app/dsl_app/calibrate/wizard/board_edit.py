"""A printed board as fields: what kind, how many squares, how large they measured."""

from __future__ import annotations

from pydantic import TypeAdapter, ValidationError
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, WholeBox, label
from dsl_core.model.board import Board, Charuco, Checkerboard


class BoardEdit(QWidget):
    """Shows and edits a board; ``edited`` tells it as the text of a setting."""

    edited = Signal(str)

    def __init__(self, name: str) -> None:
        super().__init__()
        self._board: Board = Checkerboard(columns=11, rows=7, square_mm=20.0)
        self.kind = ChoiceBox(f"Kind of {name}", "A checkerboard, or one with a marker in each white square")
        self.kind.addItem("Checkerboard, inner corners", "checkerboard")
        self.kind.addItem("ChArUco, squares", "charuco")
        self.columns = WholeBox("Columns", 3, 99, 11, tip="Inner corners, or squares of a ChArUco, across")
        self.rows = WholeBox("Rows", 3, 99, 7, tip="Inner corners, or squares of a ChArUco, down")
        self.square = NumberBox("Side of a square", 1, 999, 20, "mm", 3, "Measured over many printed squares")
        self.marker = NumberBox("Side of a marker", 1, 999, 15, "mm", 3, "Measured on the printed board")
        self._marker_label = label("marker", "muted")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.kind)
        column.addLayout(_row(self.columns, label("×", "muted"), self.rows))
        column.addLayout(_row(label("square", "muted"), self.square, self._marker_label, self.marker))
        self.kind.activated.connect(lambda _: self._tell())
        for box in (self.columns, self.rows, self.square, self.marker):
            box.setKeyboardTracking(False)
            box.valueChanged.connect(lambda _: self._tell())

    def show_text(self, text: str) -> None:
        """Show the board of a setting's text; one that cannot be read leaves what is shown."""
        try:
            self._board = TypeAdapter[Board](Board).validate_json(text)
        except ValidationError:
            return
        boxes = (self.kind, self.columns, self.rows, self.square, self.marker)
        for box in boxes:
            box.blockSignals(True)
        board = self._board
        self.kind.setCurrentIndex(self.kind.findData(board.kind))
        self.columns.setValue(board.columns)
        self.rows.setValue(board.rows)
        self.square.setValue(board.square_mm)
        if isinstance(board, Charuco):
            self.marker.setValue(board.marker_mm)
        for box in boxes:
            box.blockSignals(False)
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
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    row.addStretch(1)
    return row


def _text_of(values: dict[str, object]) -> str:
    """A board as a setting's text; an impossible one as it is, for the engine to say what is wrong."""
    import json

    try:
        return TypeAdapter[Board](Board).validate_python(values).model_dump_json()
    except ValidationError:
        return json.dumps(values)
