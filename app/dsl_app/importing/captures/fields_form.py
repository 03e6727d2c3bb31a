"""A form of the fields of a mapping, made again when there are other fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from PySide6.QtWidgets import QCheckBox, QFormLayout, QLineEdit, QWidget

from dsl_app.importing.captures.fields import Field
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, WholeBox, check_box, named, quiet


class FieldsForm(QWidget):
    """Shows fields; ``change`` gets the key and the new value of one that a person changes."""

    def __init__(self, change: Callable[[str, Any], object]) -> None:
        super().__init__()
        self._change = change
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        self.controls: dict[str, QWidget] = {}

    def show_fields(self, fields: Sequence[Field]) -> None:
        """Show the values of fields; the control that has the focus keeps it where its field stays."""
        if list(self.controls) != [field.key for field in fields]:
            while self._form.rowCount():
                self._form.removeRow(0)
            self.controls = {field.key: self._made(field) for field in fields}
            for field in fields:
                title = "" if field.kind == "flag" else field.title
                self._form.addRow(title, self.controls[field.key])
        for field in fields:
            _show(self.controls[field.key], field.value)

    def _made(self, field: Field) -> QWidget:
        change = partial(self._change, field.key)
        match field.kind:
            case "choice":
                return ChoiceBox(field.title, field.tip, field.choices, change)
            case "whole":
                whole = WholeBox(field.title, int(field.low), int(field.high), 0, field.unit, field.tip)
                whole.setKeyboardTracking(False)
                whole.valueChanged.connect(change)
                return whole
            case "number":
                number = NumberBox(field.title, field.low, field.high, 0, field.unit, 3, field.tip)
                number.valueChanged.connect(change)
                return number
            case "flag":
                flag = check_box(field.title, field.tip)
                flag.toggled.connect(change)
                return flag
            case _:
                line = named(QLineEdit(), field.title, field.tip)
                line.editingFinished.connect(lambda: change(line.text()))
                return line


def _show(control: QWidget, value: Any) -> None:
    with quiet(control):
        match control:
            case ChoiceBox():
                control.choose(value)
            case WholeBox() | NumberBox():
                control.setValue(value)
            case QCheckBox():
                control.setChecked(value)
            case QLineEdit() if control.text() != value:
                control.setText(value)
