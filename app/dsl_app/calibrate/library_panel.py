"""The library of calibrations: named, dated, with serial numbers, settings and errors."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QGroupBox,
    QMessageBox,
    QTableWidgetItem,
    QTextBrowser,
    QVBoxLayout,
    QWidget,
)

from dsl_app.calibrate.figures_table import FiguresTable
from dsl_app.calibrate.presentation import kept_version, library_selection, main_button, version_texts
from dsl_app.calibrate.state import CalibrateState, DriftVerdict
from dsl_app.shared.evented import follow_any
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.theme import Theme
from dsl_app.shared.widget_state import LabelState
from dsl_app.shared.widgets.ask_file import ask_file, start_folder
from dsl_app.shared.widgets.dialogs import dialog_buttons, resize_within
from dsl_app.shared.widgets.forms import allow, label, push_button, set_role, show_label
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.inside import apply_theme_inside, apply_theme_to
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of, splitter
from dsl_app.shared.widgets.read_table import ReadTable, cell
from dsl_app.shared.widgets.save_dialog import with_ending
from dsl_core.io.calibration_library import LibraryLine

if TYPE_CHECKING:
    from dsl_app.calibrate.library import LibraryController

LIBRARY = "Library of calibrations"
_COLUMNS = ("Name", "Stored", "Use", "Camera", "Projector", "Outside limits")
#: Filters of the export dialog, and the forms they mean.
FORMS = {
    "Everything, for another computer (*.json)": "entry",
    "The rig alone (*.json)": "rig",
    "Published layout, a folder (*)": "published",
}
WHAT_TO_DO = (
    "The table says what to do about each figure that misses its limit. Correct it and check again, or repeat"
    " the calibration that it names. You can still scan with this calibration, but scans share its error."
)


class LibraryPanel(QGroupBox):
    """Lists every version, describes the selected one, and acts on it."""

    def __init__(self, state: CalibrateState, commands: LibraryController) -> None:
        super().__init__(LIBRARY)
        self._state, self._commands = state, commands
        self.table = _table()
        # What the table shows: the state may have others already.
        self._lines: tuple[LibraryLine, ...] = ()
        # The version that was selected as the next one to use.
        self._offered: LibraryLine | None = None
        self._told = ""
        self.details = QTextBrowser()
        FocusRing(self.details)
        self.details.setAccessibleName("Details of the calibration")
        self.details.setToolTip("Conditions, dates and figures of the selected calibration")
        self._note = label("", "muted", wraps=True)
        self.use = push_button("Use for sc&ans", "Scan with this calibration from now on")
        self.report = push_button("Show repor&t", "Open its report in the browser")
        self.restore = push_button(
            "&Make current", "Make this older version the current one; no version is lost", self._restore
        )
        self.check = push_button(
            "Check for &drift…",
            "Check with one quick capture of a flat target whether the rig still matches its calibration",
        )
        self.export = push_button("E&xport…", "Export it for another computer or program", self._export)
        self.import_ = push_button("&Import…", "Import a calibration's file into the library", self._import)
        self._drift_window: DriftWindow | None = None
        self._lay_out()
        self._connect()

    def _connect(self) -> None:
        state = self._state
        self.use.clicked.connect(lambda: self._commands.use(self.key))
        self.report.clicked.connect(lambda: self._commands.report(self.key))
        self.check.clicked.connect(self._check)
        self.table.itemSelectionChanged.connect(self._select)
        self.table.itemActivated.connect(lambda _: self.report.click())
        self.stops = [
            state.library.follow(self._list),
            state.in_use.changed.connect(lambda _: self._list(state.library.value)),
            state.note.follow(lambda text: show_label(self._note, LabelState(text, "muted"))),
            state.drift.changed.connect(self._show_drift),
            *follow_any(self._mark_next, state.library, state.rows, state.campaign, state.in_use),
            state.opened.connect(lambda path: QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))),
        ]

    def _lay_out(self) -> None:
        self._split = splitter(Qt.Orientation.Horizontal, (self.table, 3), (self.details, 2))
        row = row_of(self.use, self.report, self.restore, self.check, self.export, STRETCH, self.import_)
        self.table.setMinimumHeight(110)
        column_of((self._split, 1), row, self._note, on=self, margins=(0, 4, 0, 0))

    def stack(self, on: bool) -> None:
        """Show the details below the list, for a panel that is higher than wide, or next to it."""
        self._split.setOrientation(Qt.Orientation.Vertical if on else Qt.Orientation.Horizontal)
        self._split.setSizes([1000, 2000] if on else [3000, 2000])

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme, to the list wherever it is."""
        apply_theme_to(self.table, theme)
        apply_theme_inside(self, theme)

    def place_table(self, elsewhere: QWidget | None) -> None:
        """Put the list on another widget with a layout, or back before the details for None."""
        self.setTitle("Selected calibration" if elsewhere is not None else LIBRARY)
        if elsewhere is not None:
            layout = elsewhere.layout()
            assert layout is not None
            layout.addWidget(self.table)
        elif self.table.parentWidget() is not self._split:
            self._split.insertWidget(0, self.table)
            self._split.setStretchFactor(0, 3)
            self._split.setStretchFactor(1, 2)
        self.table.show()

    # The list --------------------------------------------------------------------------------------

    @property
    def line(self) -> LibraryLine | None:
        """The version that is selected."""
        rows = {index.row() for index in self.table.selectedIndexes()}
        return self._lines[min(rows)] if rows and min(rows) < len(self._lines) else None

    @property
    def key(self) -> str:
        """What names the selected version: its name, with the stamp unless it is the current one."""
        return library_selection(self.line).key

    def _list(self, lines: tuple[LibraryLine, ...]) -> None:
        before, row = self.line, min(max(self.table.currentRow(), 0), len(lines) - 1)
        if before is not None:
            # The same version stays selected, wherever it is now.
            version = before.name, before.stamp
            row = next((i for i, each in enumerate(lines) if (each.name, each.stamp) == version), row)
        self._lines = lines
        self.table.show_rows([self._items(line) for line in lines])
        if lines:
            self.table.selectRow(row)
        self._select()

    def _mark_next(self) -> None:
        """What the campaign has put here is used for scans next: its version is selected, its button blue."""
        kept = self._next
        if kept is not None and kept != self._offered:
            self.table.selectRow(self._state.library.value.index(kept))
        self._offered = kept
        self._select()

    @property
    def _next(self) -> LibraryLine | None:
        """The version to use for scans next."""
        return kept_version(self._state) if main_button(self._state, None) == "use" else None

    def _items(self, line: LibraryLine) -> list[QTableWidgetItem]:
        items = [cell(text) for text in version_texts(line, self._state.in_use.value)]
        if line.error:
            for item in items:
                item.setToolTip(plain_tip(line.error))
        return items

    def _select(self) -> None:
        shown = library_selection(self.line)
        for button in (self.use, self.report, self.check, self.export):
            allow(button, shown.can_use, "Select a calibration of the list first.")
        allow(self.restore, shown.can_restore, "Select an older version of the list first.")
        set_role(self.use, "primary" if self._next is not None and self.line == self._next else "")
        # It takes a while to lay out, and a list that is read selects its version several times.
        if shown.details != self._told:
            self._told = shown.details
            self.details.setHtml(shown.details)

    # Actions ---------------------------------------------------------------------------------------

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
        box.setTextFormat(Qt.TextFormat.PlainText)
        box.setText(
            "Mount the film and place a flat, matt target that fills the picture. Which target is it?"
        )
        spectralon = box.addButton("The &Spectralon", QMessageBox.ButtonRole.AcceptRole)
        other = box.addButton("&Another target", QMessageBox.ButtonRole.AcceptRole)
        other.setToolTip("Brightness is then not judged, because the brightness of the target is not known")
        box.addButton(QMessageBox.StandardButton.Cancel)
        box.exec()
        chosen = box.clickedButton()
        # Otherwise it would live as long as the page; it must not go before its answer is read.
        box.deleteLater()
        if chosen in (spectralon, other):
            self._commands.check(self.key, chosen is spectralon)

    def _export(self) -> None:
        line = self.line
        if line is None:
            return
        kinds, draft = ";;".join(FORMS), str(Path(start_folder()) / f"{line.name}.json")
        name, chosen = QFileDialog.getSaveFileName(self, "Export a calibration", draft, kinds)
        if name:
            path, may_replace = with_ending(name, chosen or kinds, kinds)
            form = FORMS.get(chosen, "entry")
            if form == "published" and path.suffix.lower() == ".json":
                # The name that the dialog proposes is that of a file; it asked about no folder.
                path, may_replace = path.with_suffix(""), False
            self._commands.export(self.key, path, form, overwrite=may_replace)

    def _import(self) -> None:
        path = ask_file(self, "Import a calibration", "Calibrations (*.json)")
        if path is not None:
            self._commands.import_file(path)

    def _show_drift(self, verdict: DriftVerdict | None) -> None:
        if verdict is not None:
            # Without a name it is now and then gone before it is seen.
            self._drift_window = DriftWindow(verdict, self._commands, self.table.theme, self)
            self._drift_window.open()


class DriftWindow(QDialog):
    """What a quick shot of a flat target showed about a calibration, and what to do about it."""

    def __init__(
        self, verdict: DriftVerdict, commands: LibraryController, theme: Theme, parent: QWidget
    ) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(f"Drift check of {verdict.name}")
        resize_within(self, QSize(860, 420))
        add_help_key(self, "calibrating#what-the-drift-check-measures")
        self.table = FiguresTable("Figures of the drift check")
        self.table.apply_theme(theme)
        self.table.show_figures(verdict.figures)
        column = QVBoxLayout(self)
        column.addWidget(label(verdict.sentence, "good" if verdict.passed else "bad"))
        if verdict.overridden:
            column.addWidget(label(f"Checked although {'; '.join(verdict.overridden)}.", "warn", wraps=True))
        column.addWidget(self.table, 1)
        if not verdict.passed:
            column.addWidget(label(WHAT_TO_DO, "muted", wraps=True))
        column.addWidget(self._buttons(verdict, commands))

    def _buttons(self, verdict: DriftVerdict, commands: LibraryController) -> QDialogButtonBox:
        buttons = dialog_buttons(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        tip = "Repeat the quick capture; the target must still be in place"
        check = lambda: commands.check(verdict.name, verdict.spectralon, bool(verdict.overridden))  # noqa: E731
        self.again = push_button("Check &again", tip, check)
        tip = "Scan with this calibration from now on, despite the drift"
        self.use = push_button("&Use anyway", tip, lambda: commands.use(verdict.name))
        set_role(self.again, "" if verdict.passed else "primary")
        for button in (self.again, self.use):
            buttons.addButton(button, QDialogButtonBox.ButtonRole.ActionRole)
            button.clicked.connect(self.accept)
            button.setVisible(not verdict.passed)
        return buttons


def _table() -> ReadTable:
    table = ReadTable(
        "Calibrations on this computer", "Every version of every calibration, the newest first", _COLUMNS
    )
    table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    table.horizontalHeader().setStretchLastSection(True)
    return table
