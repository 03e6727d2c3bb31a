"""The parts of a mapping as a list, and the fields of the one that is selected."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QListWidget, QMenu, QSizePolicy, QWidget

from dsl_app.importing.captures.fields import KINDS, part_fields, part_words, picture_fields
from dsl_app.importing.captures.fields_form import FieldsForm
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import named, push_button, quiet
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, scrolled, tabs_of

if TYPE_CHECKING:
    from dsl_app.importing.captures.controller import CapturesController
    from dsl_core.io.pictures.mapping import Mapping

#: Height of the list of parts, and the least, px.
LIST_PX, LEAST_LIST_PX = 118, 70


class PartsEditor(QWidget):
    """Shows a mapping; its controller changes it."""

    def __init__(self, commands: CapturesController) -> None:
        super().__init__()
        self._commands = commands
        self._mapping: Mapping | None = None
        tip = "What the pictures show, one part after the other in the order of the files"
        self.parts = named(QListWidget(), "Parts of the capture", tip)
        self.parts.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.parts.setTextElideMode(Qt.TextElideMode.ElideRight)
        # Less on a small screen, where the buttons of the dialog would else be beyond its edge.
        self.parts.setMinimumHeight(LEAST_LIST_PX)
        self.parts.setMaximumHeight(LIST_PX)
        self.parts.currentRowChanged.connect(lambda _: self._show_part())
        self.add = push_button("Add", "Add a part before the selected one")
        self.kinds = QMenu(self.add)
        for kind in KINDS:
            self.kinds.addAction(kind).triggered.connect(partial(self._add, kind))
        self.add.setMenu(self.kinds)
        self.remove = push_button("Remove", "Remove the selected part", self._remove)
        self.up = push_button("Up", "Move the selected part up", lambda: self._move(-1))
        self.down = push_button("Down", "Move the selected part down", lambda: self._move(1))
        for button in (self.add, self.remove, self.up, self.down):
            button.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.part = FieldsForm(self._change_part)
        self.pictures = FieldsForm(commands.change_pictures)
        buttons = row_of(self.add, self.remove, self.up, self.down, STRETCH, spacing=4)
        below = scrolled(boxed(column_of(self.part, STRETCH, margins=(0, 0, 4, 0))))
        parts = boxed(column_of(self.parts, buttons, (below, 1), margins=(0, 6, 0, 0)))
        files = scrolled(boxed(column_of(self.pictures, STRETCH, margins=(0, 6, 4, 0))))
        self.tabs = tabs_of(
            "Parts of the mapping",
            (parts, "&Parts", "What the pictures show, one after the other"),
            (files, "&Files", "Which files there are, and how they are read"),
        )
        column_of(self.tabs, on=self, margins=0)

    def show_mapping(self, mapping: Mapping | None) -> None:
        """Show a mapping, or nothing; the selected part stays selected."""
        self._mapping = mapping
        if mapping is None:
            return
        row = self._place()
        words = [part_words(part) for part in mapping.parts]
        with quiet(self.parts):
            self.parts.clear()
            self.parts.addItems(words)
            for place, text in enumerate(words):
                self.parts.item(place).setToolTip(plain_tip(text))
            self.parts.setCurrentRow(min(row, len(words) - 1))
        self.pictures.show_fields(picture_fields(mapping))
        self._show_part()

    def _place(self) -> int:
        return max(self.parts.currentRow(), 0)

    def _show_part(self) -> None:
        mapping, place = self._mapping, self._place()
        if mapping is None:
            return
        self.part.show_fields(part_fields(mapping.parts[place]))
        self.remove.setEnabled(len(mapping.parts) > 1)
        self.up.setEnabled(place > 0)
        self.down.setEnabled(place < len(mapping.parts) - 1)

    def _change_part(self, key: str, value: Any) -> None:
        self._commands.change_part(self._place(), key, value)

    def _add(self, kind: str, _: bool = False) -> None:
        self._commands.add_part(self._place(), kind)

    def _remove(self) -> None:
        self._commands.remove_part(self._place())

    def _move(self, steps: int) -> None:
        place = self._place()
        with quiet(self.parts):
            # The selection goes with the part.
            self.parts.setCurrentRow(place + steps)
        self._commands.move_part(place, steps)
