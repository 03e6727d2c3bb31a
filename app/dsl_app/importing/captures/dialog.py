"""The dialog that imports captures: the guess from the pictures, shown, corrected, and made into a scan."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QFileDialog, QFormLayout, QLabel, QLineEdit, QMenu, QSizePolicy, QWidget

from dsl_app.importing.captures.parts_editor import PartsEditor
from dsl_app.importing.captures.pictures import DecodedPicture, FilesTable
from dsl_app.importing.captures.state import NOMINAL, NONE, CapturesState, Said, captures_view
from dsl_app.importing.captures.unit_box import unit_box
from dsl_app.shared.evented import follow_any
from dsl_app.shared.known_files import breakable
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.ask_file import ask_file
from dsl_app.shared.widgets.dialogs import JobDialog, use_room
from dsl_app.shared.widgets.forms import (
    ChoiceBox,
    WholeBox,
    check_box,
    label,
    named,
    push_button,
    quiet,
    set_role,
)
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shared.widgets.save_dialog import ask_place
from dsl_core.model.plan import MOST_PX

if TYPE_CHECKING:
    from dsl_app.importing.captures.controller import CapturesController

WIDTH_PX, HEIGHT_PX = 1000, 640
EDITOR_PX, PICTURE_PX = 330, 270
#: Lines that a sentence may take before the rest of it is in its tooltip only.
MOST_LINES = 2
MAPPINGS = "Mappings (*.json)"
CURVES = "Tables of curves (*.csv *.txt *.tsv *.xlsx);;All files (*)"
RIGS = "Calibrations (*.json *.xml *.yml *.yaml)"


class CapturesDialog(JobDialog):
    """Follows a `CapturesState`; the controller does what is asked."""

    def __init__(self, state: CapturesState, commands: CapturesController, parent: QWidget) -> None:
        super().__init__(commands.start, commands.command_line, parent)
        self._state, self._commands = state, commands
        self.setWindowTitle("Import captures")
        use_room(self, parent, QSize(WIDTH_PX, HEIGHT_PX))
        add_help_key(self, "importing#pictures-of-other-programs")
        self._make_top()
        self._make_middle()
        self._make_bottom()
        self._lay_out()
        self._connect()

    def open_folder(self, folder: Path) -> None:
        """Show what a folder is."""
        self._commands.open(folder)

    # Make ------------------------------------------------------------------------------------------

    def _make_top(self) -> None:
        self.folder = label("No folder", "heading")
        # A long path is no reason for a wide dialog.
        self.folder.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.choose = push_button("Choose &folder…", "Choose the folder of one capture", self._choose_folder)
        self.about_folder = _sentence()
        self.set_title = label("Set", "muted")
        self.set = ChoiceBox(
            "Set", "Which of the captures in the folder, such as one camera or one pose",
            (), self._commands.choose_set,
        )  # fmt: skip
        tip = "{} of the projector; a mapping as guessed is guessed again for it"
        self.width_px, self.height_px = (
            WholeBox(f"{what} of the projector", 0, MOST_PX, 0, "px", tip.format(what))
            for what in ("Width", "Height")
        )
        for box in (self.width_px, self.height_px):
            box.setSpecialValueText("not known")
            box.setKeyboardTracking(False)
        self.guess = push_button(
            "&Guess again", "Find out from the pictures again what they show", self._commands.guess
        )
        self.load = push_button("&Load mapping…", "Use the mapping of a file", self._load)
        self.save = push_button("&Save mapping…", "Keep the mapping in a file, for other folders", self._save)

    def _make_middle(self) -> None:
        self.editor = PartsEditor(self._commands)
        self.editor.setFixedWidth(EDITOR_PX)
        self.files = FilesTable()
        self.decoded = DecodedPicture()
        self.decoded.setMinimumWidth(PICTURE_PX)
        self.about_columns = _sentence(MOST_LINES + 1)
        self.about_mapping = _sentence(MOST_LINES + 2)
        self.about_values = _sentence()

    def _make_bottom(self) -> None:
        self.calibration = ChoiceBox(
            "Calibration", "Where camera and projector are; depth needs it",
            (
                ("None: columns only", NONE),
                *((name, name) for name in self._state.library.value),
                ("Nominal: the published rig", NOMINAL),
            ),
            self._commands.choose_calibration,
        )  # fmt: skip
        self.calibration.be_narrow()
        self.rig_file = push_button(
            "F&ile…", "Choose a rig's file, or lenses and pose of another program (XML, YAML, JSON)",
            self._choose_rig,
        )  # fmt: skip
        self.unit_mm = unit_box()
        self.from_projector = check_box(
            "From projector", "The pose of the file leads from the projector to the camera, not the usual way"
        )
        self.curves = push_button("C&urves…", "Choose tables of the curves of camera and LEDs (CSV)", None)
        menu = QMenu(self.curves)
        for device in ("camera", "LEDs"):
            menu.addAction(f"Curves of the {device}…").triggered.connect(partial(self._choose_curves, device))
            menu.addAction(f"No curves of the {device}").triggered.connect(partial(self._no_curves, device))
        self.curves.setMenu(menu)
        self.about_calibration = _sentence(MOST_LINES + 2)
        self.name = named(QLineEdit(), "Name", "Name of the imported scan; .dsl is added")
        self.home = named(QLineEdit(), "Folder to save in", "Folder of the imported scan")
        self.browse = push_button("C&hoose…", "Choose the folder to save in", self._choose_home)
        self.about_target = _sentence()
        self.name_buttons(
            "Import",
            "Make a scan of the pictures, completely or not at all",
            "Close without importing (Escape)",
        )

    def _lay_out(self) -> None:
        head = row_of((self.folder, 1), self.set_title, self.set, self.choose)
        tools = row_of(
            label("Projector", "muted"), self.width_px, label("×", "muted"), self.height_px,
            self.guess, STRETCH, self.load, self.save,
        )  # fmt: skip
        right = boxed(column_of((self.decoded, 1), self.about_columns, margins=0))
        middle = row_of(self.editor, (self.files, 3), (right, 2))
        form = QFormLayout()
        of_file = self.rig_file, self.unit_mm, self.from_projector, self.curves
        form.addRow("Calibration", row_of((self.calibration, 1), *of_file))
        form.addRow("", self.about_calibration)
        form.addRow("Name", row_of((self.name, 1), label("in", "muted"), (self.home, 2), self.browse))
        form.addRow("", self.about_target)
        for part in (head, self.about_folder, tools, self.about_mapping, self.about_values):
            self.column.addWidget(part) if isinstance(part, QLabel) else self.column.addLayout(part)
        self.column.addLayout(middle, 1)
        self.column.addLayout(form)
        self.column.addWidget(self.buttons)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        for box in (self.width_px, self.height_px):
            box.valueChanged.connect(lambda _: self._set_projector())
        self.unit_mm.valueChanged.connect(commands.set_unit)
        self.from_projector.toggled.connect(commands.set_direction)
        for field in (self.name, self.home):
            field.textEdited.connect(lambda _: commands.rename(self.name.text(), Path(self.home.text())))
        self.stops = [
            *follow_any(self._show_request, state.request),
            *follow_any(self._show_mapping, state.stated),
            *follow_any(self._show_sets, state.sets),
            *follow_any(self._show_files, state.listing),
            state.small.follow(self.files.show_small),
            state.decoded.follow(self.decoded.show_decoded),
            *follow_any(
                self._judge, state.busy, state.trouble, state.stated, state.listing, state.decoded,
                state.request, state.sets, state.is_importing,
            ),
            state.done.connect(lambda _: self.accept()),
        ]  # fmt: skip

    # Show ------------------------------------------------------------------------------------------

    def _show_request(self) -> None:
        request = self._state.request.value
        if request.folder is not None:
            self.folder.setText(breakable(request.folder))
            self.folder.setToolTip(plain_tip(str(request.folder)))
        if self.calibration.findData(request.calibration) < 0:
            self.calibration.addItem(Path(request.calibration).name, request.calibration)
        self.calibration.choose(request.calibration)
        for field, text in ((self.name, request.target.stem), (self.home, str(request.target.parent))):
            # Text that is being typed is not replaced.
            if not field.hasFocus():
                field.setText(text)

    def _set_projector(self) -> None:
        size_px = self.width_px.value(), self.height_px.value()
        self._commands.set_projector(size_px)
        if not all(size_px):
            # The size in the current mapping stays until another mapping is guessed.
            self._show_mapping()

    def _show_mapping(self) -> None:
        stated = self._state.stated.value
        self.editor.show_mapping(None if stated is None else stated.mapping)
        if stated is not None:
            with quiet(self.width_px, self.height_px):
                for box, size in zip(
                    (self.width_px, self.height_px), stated.mapping.projector_size_px, strict=True
                ):
                    box.setValue(size)

    def _show_sets(self) -> None:
        with quiet(self.set):
            self.set.clear()
            for name in self._state.sets.value:
                self.set.addItem(name, name)

    def _show_files(self) -> None:
        self.files.show_table(self._state.listing.value.table)

    def _judge(self) -> None:
        view = captures_view(self._state)
        for sentence, said in (
            (self.about_folder, view.folder),
            (self.about_mapping, view.mapping),
            (self.about_columns, view.columns),
            (self.about_values, view.values),
            (self.about_calibration, view.calibration),
            (self.about_target, view.target),
        ):
            _say(sentence, said)
        self.decoded.words.setText(view.no_picture)
        for part in (self.set, self.set_title):
            part.setVisible(view.asks_set)
        self.unit_mm.setVisible(view.asks_unit)
        self.from_projector.setVisible(view.asks_unit)
        self.curves.setVisible(view.asks_unit)
        self.guess.setEnabled(view.can_guess)
        of_calibration = self.calibration, self.rig_file, self.unit_mm, self.from_projector, self.curves
        for field in (self.choose, self.set, *of_calibration, self.name, self.home, self.browse):
            field.setEnabled(view.can_set)
        self.load.setEnabled(view.can_guess)
        for control in (self.editor, self.save, self.width_px, self.height_px):
            control.setEnabled(view.can_change)
        self.go.setEnabled(view.can_import)

    # Do --------------------------------------------------------------------------------------------

    def _choose_folder(self) -> None:
        folder = self._state.request.value.folder
        start = "" if folder is None else str(folder.parent)
        chosen = OpenDialog.ask_folder(self, "Choose the folder of a capture", start)
        if chosen is not None:
            self._commands.open(chosen)

    def _choose_home(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Save in", self.home.text())
        if name:
            self.home.setText(name)
            self._commands.rename(self.name.text(), Path(name))

    def _choose_rig(self) -> None:
        path = ask_file(self, "Choose a calibration", RIGS)
        if path is not None:
            self._commands.choose_calibration(str(path))

    def _choose_curves(self, device: str, _: bool = False) -> None:
        path = ask_file(self, f"Choose the curves of the {device}", CURVES)
        if path is not None:
            self._commands.set_curves(device, path)

    def _no_curves(self, device: str, _: bool = False) -> None:
        self._commands.set_curves(device, None)

    def _load(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Load a mapping", self.home.text(), MAPPINGS)
        if name:
            self._commands.load_mapping(Path(name))

    def _save(self) -> None:
        draft = str(Path(self.home.text()) / f"{self.name.text()}.mapping.json")
        path = ask_place(self, "Save the mapping", draft, MAPPINGS)
        if path is not None:
            self._commands.save_mapping(path)

    def done(self, result: int) -> None:
        """Stop what still runs for the dialog."""
        self._commands.stop()
        super().done(result)


def _sentence(lines: int = MOST_LINES) -> QLabel:
    """Lines for a sentence beside what it is about; one that is longer begins there, and its tip has all."""
    made = label(" ", "muted", wraps=True)
    made.setAlignment(Qt.AlignmentFlag.AlignTop)
    made.setMaximumHeight(made.fontMetrics().lineSpacing() * lines + 2)
    return made


def _say(sentence: QLabel, said: Said) -> None:
    sentence.setText(said.text or " ")
    sentence.setToolTip(plain_tip(said.text))
    set_role(sentence, said.role)
