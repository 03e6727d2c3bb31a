"""Asks which spectra of a library to compare with."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QDialogButtonBox,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QWidget,
)

from dsl_app.results.marks.controller import MarksController
from dsl_app.results.state import Library
from dsl_app.shared.widgets.dialogs import dialog_buttons, resize_within
from dsl_app.shared.widgets.forms import label, named, set_role
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.layouts import column_of
from dsl_core.io.spectra.reference_file import Reference

ENTRY = Qt.ItemDataRole.UserRole
#: Width of the dialog, its height around the list, and the most that the list asks for, px.
WIDTH_PX, LEAST_PX, MOST_ROWS_PX = 460, 160, 420


class LibraryDialog(QDialog):
    """Lists the spectra of a library; the controller adds the selected ones."""

    def __init__(self, library: Library, control: MarksController, parent: QWidget) -> None:
        super().__init__(parent)
        self._library, self._control = library, control
        self.setWindowTitle(f"Spectra of {library.path.name}")
        add_help_key(self, "numbers#pins-regions-references")
        tip = "Lists only spectra whose names contain all of these words"
        self.filter = named(QLineEdit(), "Filter", tip)
        self.filter.setPlaceholderText("Filter by words in the name")
        self.filter.setClearButtonEnabled(True)
        self.list = named(QListWidget(), "Spectra", "Select one or more; double-click adds one at once")
        self.list.setUniformItemSizes(True)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        for reference in library.content.references:
            nm = reference.curve.wavelengths_nm
            item = QListWidgetItem(f"{reference.name}   {nm[0]:g}–{nm[-1]:g} nm")
            item.setData(ENTRY, reference.name)
            self.list.addItem(item)
        self.text = label("", "muted", wraps=True)
        self.buttons = dialog_buttons(QDialogButtonBox.StandardButton.Cancel)
        self.add = self.buttons.addButton("Add", QDialogButtonBox.ButtonRole.AcceptRole)
        self.add.setToolTip("Compare with the selected spectra")
        set_role(self.add, "primary")
        self.buttons.button(QDialogButtonBox.StandardButton.Cancel).setToolTip("Add none (Escape)")
        column_of(self.filter, self.list, self.text, self.buttons, on=self)
        self.filter.textChanged.connect(lambda _: self._show())
        self.list.itemSelectionChanged.connect(self._show)
        self.list.itemDoubleClicked.connect(lambda _: self.accept())
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)
        self.finished.connect(self._finish)
        self._show()
        # As high as the list needs, within bounds.
        rows = self.list.sizeHintForRow(0) * self.list.count()
        resize_within(self, QSize(WIDTH_PX, LEAST_PX + min(rows, MOST_ROWS_PX)))

    @property
    def chosen(self) -> list[Reference]:
        """The spectra selected and listed, in the order of the library."""
        items = (self.list.item(i) for i in range(self.list.count()))
        names = {item.data(ENTRY) for item in items if item.isSelected() and not item.isHidden()}
        return [each for each in self._library.content.references if each.name in names]

    def _show(self) -> None:
        filters, listed = self.filter.text().lower().split(), 0
        for i in range(self.list.count()):
            item = self.list.item(i)
            is_listed = all(word in item.data(ENTRY).lower() for word in filters)
            item.setHidden(not is_listed)
            listed += is_listed
        chosen, empty = len(self.chosen), len(self._library.content.empty)
        left_out = f"; {empty} without values omitted" if empty else ""
        self.text.setText(f"{listed} of {self.list.count()} listed, {chosen} selected{left_out}.")
        self.add.setEnabled(chosen > 0)

    def _finish(self, result: int) -> None:
        accepted = result == QDialog.DialogCode.Accepted
        self._control.add_references(self._library.path, self.chosen if accepted else [])
