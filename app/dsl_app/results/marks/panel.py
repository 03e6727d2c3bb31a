"""The list of pins, regions and references, and the comparison of the selected one."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QModelIndex, QSize, Qt, QTimer
from PySide6.QtGui import QBrush, QColor, QGuiApplication, QKeySequence, QShortcut, QTextOption
from PySide6.QtWidgets import (
    QAbstractItemView,
    QFrame,
    QHeaderView,
    QTextBrowser,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

from dsl_app.results.marks.comparison import comparison_html
from dsl_app.results.marks.controller import MarksController
from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.settings import folder_for
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.ask_file import ask_file
from dsl_app.shared.widgets.forms import allow, label, named, push_button, quiet
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.icons import SWATCH_PX, swatch
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.save_dialog import ask_target
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.io.spectra.catalogue import formats, suffixes

KEY = Qt.ItemDataRole.UserRole
#: Height of the list at least, px: its head and a row.
LEAST_TREE_PX = 60
EMPTY = (
    "Click the picture to pin a spectrum, draw a region with the tools above it, or drop a file with a"
    " reference spectrum here."
)


def _filter(name: str, suffixes: Iterable[str]) -> str:
    return f"{name} ({' '.join(f'*{suffix}' for suffix in suffixes)})"


def _filters() -> str:
    """Every format that files can be chosen by."""
    each_one = (_filter(each.name, each.suffixes) for each in formats() if each.suffixes)
    return ";;".join([_filter("Spectra", suffixes()), *each_one, "All files (*)"])


class MarksPanel(QWidget):
    """Follows the marks of a state and asks their controller."""

    def __init__(self, state: ResultsState, control: MarksController) -> None:
        super().__init__()
        self._state, self._control, self._theme = state, control, DARK
        #: Marks as they are listed, each with its row, by key.
        self._rows: dict[int, tuple[Mark, QTreeWidgetItem]] = {}
        self.tree = named(
            QTreeWidget(),
            "Pins, regions and references",
            "Tick to show; F2 or double-click to rename; Delete to remove; Ctrl or Shift selects several; the"
            " one selected last is compared",
        )
        self.tree.setColumnCount(3)
        self.tree.setHeaderLabels(["Spectrum", "Where", "Pixels"])
        self.tree.setRootIsDecorated(False)
        self.tree.setUniformRowHeights(True)
        self.tree.setIconSize(QSize(SWATCH_PX, SWATCH_PX))
        self.tree.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.tree.setEditTriggers(
            QAbstractItemView.EditTrigger.EditKeyPressed | QAbstractItemView.EditTrigger.DoubleClicked
        )
        header = self.tree.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        # A tick, a swatch and a name: where places are long words, these scroll, and names stay.
        header.setMinimumSectionSize(header.fontMetrics().horizontalAdvance("region 00") + 3 * SWATCH_PX)
        for column in (1, 2):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        self.hint = label(EMPTY, "muted", wraps=True)
        # A label would lay out a long table several times.
        tip = "The selected mark compared with other marks and references, and its distance from other pins"
        self.figures = named(QTextBrowser(), "Comparison of the selected mark", tip)
        FocusRing(self.figures)
        # In a narrow panel a figure is scrolled to, not broken in two.
        self.figures.setWordWrapMode(QTextOption.WrapMode.WordWrap)
        self.figures.setFrameShape(QFrame.Shape.NoFrame)
        self.figures.viewport().setAutoFillBackground(False)
        self.reference = push_button(
            "Add reference…",
            "Open a file with reflectance to compare with: text, CSV, ENVI, ASD, SVC, JCAMP-DX, CGATS",
        )
        self.remove = push_button("Remove", "Remove the selected pins, regions and references (Delete)")
        self.copy = push_button(
            "Copy spectra",
            "Copy the ticked spectra for a spreadsheet: nm, mean, deviation, n, uncertainty (Ctrl+C)",
        )
        self.export = push_button(
            "Export spectra…", "Write the same table as CSV, with the origin of the result"
        )
        # Two rows, as the smallest window is too narrow for one.
        add, put = row_of(self.reference, self.remove, STRETCH), row_of(self.copy, self.export, STRETCH)
        column_of(self.hint, (self.tree, 1), add, put, (self.figures, 1), on=self, margins=0)
        # A new mark is added, then selected: its table is made once.
        self._later = QTimer(self)
        self._later.setSingleShot(True)
        self._later.setInterval(0)
        self._later.timeout.connect(self._compare)
        self._connect()

    def _connect(self) -> None:
        self.tree.itemChanged.connect(self._item_changed)
        self.tree.currentItemChanged.connect(self._current_changed)
        self.tree.itemSelectionChanged.connect(self._show_removable)
        self.reference.clicked.connect(self.choose_reference)
        self.remove.clicked.connect(self.remove_selected)
        delete = QShortcut(QKeySequence(Qt.Key.Key_Delete), self.tree, self.remove_selected)
        copy = QShortcut(QKeySequence(QKeySequence.StandardKey.Copy), self.tree, self.copy_spectra)
        for shortcut in (delete, copy):
            shortcut.setContext(Qt.ShortcutContext.WidgetShortcut)
        self.copy.clicked.connect(self.copy_spectra)
        self.export.clicked.connect(self.export_spectra)
        self._state.marks.follow(lambda _: self._fill())
        self._state.result.changed.connect(lambda _: self._show_hint())
        self._state.selected.follow(lambda _: self._show_selection())
        self._state.band.changed.connect(lambda _: self._show_band())

    def choose_reference(self) -> None:
        """Ask for a file with a spectrum."""
        path = ask_file(self, "Add a reference spectrum", _filters())
        if path is not None:
            self._control.add_reference(path)

    def remove_selected(self) -> None:
        """Remove the selected marks."""
        self._control.remove(*self._chosen)

    @property
    def _chosen(self) -> list[int]:
        """The keys of the selected marks."""
        return [int(item.data(0, KEY)) for item in self.tree.selectedItems()]

    def copy_spectra(self) -> None:
        """Copy the spectra shown, as a table."""
        self._control.copy_spectra(QGuiApplication.clipboard().setText)

    def export_spectra(self) -> None:
        """Ask for a file and write the spectra shown."""
        # Another result may be opened while a person chooses.
        result, spectra = self._state.result.value, self._control.shown()
        if result is None or not spectra:
            return
        draft = str(folder_for(result.path) / f"{result.path.stem}_spectra.csv")
        target = ask_target(self, "Export spectra", draft, "Spectra (*.csv)")
        if target is not None:
            self._control.export_spectra(result, spectra, *target)

    def _fill(self) -> None:
        """Change only the rows that differ: if all were replaced, each pin would take longer than the last.

        Marks are added, changed and removed, never moved.
        """
        marks = self._state.marks.value
        with quiet(self.tree):
            for key in self._rows.keys() - {mark.key for mark in marks}:
                _, item = self._rows.pop(key)
                self.tree.takeTopLevelItem(self.tree.indexOfTopLevelItem(item))
            for place, mark in enumerate(marks):
                self._put(place, mark)
        self._show_hint()
        self._show_selection()

    def _show_hint(self) -> None:
        """Say what to do while nothing is marked, or why nothing can be."""
        self.hint.setText(self._state.no_spectra or EMPTY)
        is_empty = not self._state.marks.value
        self.hint.setVisible(is_empty)
        # On a small screen the hint has the room of an empty list: a layout counts one line of it.
        self.tree.setMinimumHeight(0 if is_empty else LEAST_TREE_PX)

    def _put(self, place: int, mark: Mark) -> None:
        shown, item = self._rows.get(mark.key, (None, None))
        if item is None:
            item = QTreeWidgetItem()
            item.setData(0, KEY, mark.key)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable | Qt.ItemFlag.ItemIsUserCheckable)
            item.setTextAlignment(2, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            self.tree.insertTopLevelItem(place, item)
        if shown is not mark:
            self._rows[mark.key] = mark, item
            self._show_row(item, mark)

    def _show_row(self, item: QTreeWidgetItem, mark: Mark) -> None:
        cells = mark.name, where(mark, self._state.result.value), count(mark)
        for column, text in enumerate(cells):
            item.setText(column, text)
            item.setToolTip(column, plain_tip(mark.trouble))
        item.setIcon(0, swatch(self._theme.pin(mark.colour)))
        item.setCheckState(0, Qt.CheckState.Checked if mark.shown else Qt.CheckState.Unchecked)
        item.setForeground(1, QColor(self._theme.warn) if mark.trouble else QBrush())

    def _item_changed(self, item: QTreeWidgetItem, column: int) -> None:
        key = int(item.data(0, KEY))
        if column != 0 or key not in self._rows:
            return
        mark, _ = self._rows[key]
        shown = item.checkState(0) == Qt.CheckState.Checked
        if mark.shown != shown:
            # One of several that are selected takes them all along.
            chosen = self._chosen
            self._control.show(shown, *(chosen if key in chosen else (key,)))
        elif item.text(0) != mark.name:
            self._control.rename(key, item.text(0))
            with quiet(self.tree):
                # The name that it has now, which is the old one where none was given.
                item.setText(0, self._rows[key][0].name)

    def _current_changed(self, item: QTreeWidgetItem | None, _before: object) -> None:
        self._state.selected.set(0 if item is None else int(item.data(0, KEY)))

    def _show_selection(self) -> None:
        key = self._state.selected.value
        chosen = self._rows.get(key)
        index = QModelIndex() if chosen is None else self.tree.indexFromItem(chosen[1])
        # Making an item current that is so already would give up the others that are selected.
        if index != self.tree.currentIndex():
            with quiet(self.tree):
                self.tree.setCurrentIndex(index)
        self._show_removable()
        self._later.start()

    def _show_removable(self) -> None:
        allow(self.remove, bool(self._chosen), "Select a pin, region or reference first.")

    def _show_band(self) -> None:
        mark = self._state.selected_mark
        if mark is not None and mark.kind == "region":
            self._later.start()

    def _compare(self) -> None:
        text = comparison_html(self._state, self._theme)
        self.figures.setVisible(bool(text))
        self.figures.setHtml(text)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        with quiet(self.tree):
            for mark, item in self._rows.values():
                self._show_row(item, mark)
        self._show_selection()


def where(mark: Mark, result: ResultArrays | None) -> str:
    """Where a mark is, in a few words, or that it has no spectrum now."""
    if mark.trouble:
        return "no spectrum"
    if mark.pixel is not None:
        x_px, y_px = mark.pixel if result is None else result.in_picture(mark.pixel)
        return f"{x_px}, {y_px}"
    if mark.file is not None:
        return mark.file.name if len(mark.file.name) <= 18 else mark.file.name[:17] + "…"
    return "lasso in 3D" if mark.runs else "outline"


def count(mark: Mark) -> str:
    """Pixels of a region that have a spectrum."""
    return f"{mark.used}" if mark.kind == "region" and not mark.trouble else ""
