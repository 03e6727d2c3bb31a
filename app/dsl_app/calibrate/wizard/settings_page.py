"""The settings of a calibration, with what each means; the campaign remembers them."""

from __future__ import annotations

from functools import partial
from typing import TypeVar

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QCheckBox, QFormLayout, QFrame, QLineEdit, QScrollArea, QVBoxLayout, QWidget

from dsl_app.calibrate.wizard.board_edit import BoardEdit
from dsl_app.calibrate.wizard.state import SettingRow
from dsl_app.shared.widgets.forms import label

F = TypeVar("F", bound=QWidget)
INTRODUCTION = (
    "What is captured follows these settings. The campaign remembers them; what was captured with others"
    " stays on disk."
)
FIELD_PX = 420
NOTHING = "This calibration has no settings."


class SettingsPage(QWidget):
    """A row a setting; ``edited`` tells key and text of one that a person changed."""

    edited = Signal(str, str)

    def __init__(self) -> None:
        super().__init__()
        self._shown: tuple[SettingRow, ...] = ()
        self.fields: dict[str, QLineEdit | QCheckBox | BoardEdit] = {}
        self._intro = label(INTRODUCTION, "muted")
        self._intro.setWordWrap(True)
        self._trouble = label("", "bad")
        self._trouble.setWordWrap(True)
        self._trouble.setAccessibleName("What is wrong with the settings")
        content = QWidget()
        self._form = QFormLayout(content)
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        area = QScrollArea()
        area.setWidget(content)
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 0, 0, 0)
        column.addWidget(self._intro)
        column.addWidget(self._trouble)
        column.addWidget(area, 1)
        self.say("")

    def say(self, trouble: str) -> None:
        """Say what is wrong with a setting; empty for nothing."""
        self._trouble.setText(trouble)
        self._trouble.setVisible(bool(trouble))

    def show_settings(self, rows: tuple[SettingRow, ...]) -> None:
        """Show settings; fields of the same keys stay, with the focus in them."""
        if [row.key for row in rows] != [row.key for row in self._shown]:
            self._build(rows)
        self._shown = rows
        self._intro.setText(INTRODUCTION if rows else NOTHING)
        for row in rows:
            field = self.fields[row.key]
            if isinstance(field, QCheckBox):
                field.setChecked(row.value == "true")
            elif isinstance(field, BoardEdit):
                field.show_text(row.value)
            else:
                field.setText(row.value)

    def _build(self, rows: tuple[SettingRow, ...]) -> None:
        while self._form.rowCount():
            self._form.removeRow(0)
        self.fields = {}
        for row in rows:
            name = words_of(row.key)
            field = self._field(row, name)
            self.fields[row.key] = field
            self._form.addRow(name, field)
            if row.doc:
                doc = label(row.doc, "muted")
                doc.setWordWrap(True)
                self._form.addRow("", doc)

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
        line.setPlaceholderText(row.default or "none")
        line.editingFinished.connect(lambda: tell(line.text()))
        return _named(line, name, tip)

    def _tell(self, key: str, text: str) -> None:
        known = next(row.value for row in self._shown if row.key == key)
        # A field that was left without its default's text means the default.
        default = next(row.default for row in self._shown if row.key == key)
        wanted = text.strip() or default
        if wanted != known:
            self.edited.emit(key, wanted)


#: Units that end names of settings, and how people write them.
_UNITS = {"nm": "nm", "mm": "mm", "ms": "ms", "px": "px", "deg": "°"}


def words_of(key: str) -> str:
    """The name of a setting for people.

    >>> words_of("filters_nm"), words_of("stage_std_mm"), words_of("poses")
    ('Filters (nm)', 'Stage std (mm)', 'Poses')
    """
    *words, last = key.split("_")
    if words and last in _UNITS:
        return f"{' '.join(words).capitalize()} ({_UNITS[last]})"
    return " ".join((*words, last)).capitalize()


def _named(field: F, name: str, tip: str) -> F:
    field.setAccessibleName(name)
    field.setToolTip(tip)
    field.setMaximumWidth(FIELD_PX)
    return field
