"""Which material is where: classes, limits that the picture follows at once, and a legend with areas."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from dsl_app.results.answers.controller import AnswersController, Way
from dsl_app.results.state import Materials, ResultsState
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.settings import folder_for
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.ask_file import ask_file, ask_folder
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, allow, check_box, label, push_button, quiet
from dsl_app.shared.widgets.icons import swatch
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_app.shared.widgets.save_dialog import ask_target
from dsl_core.analysis.classify import Brightness, Limits, Measure, Scores
from dsl_core.io.spectra.catalogue import suffixes
from dsl_core.words import capitalised, counted

HINT = (
    "Name the material of every pixel: choose a folder or file of spectra, or mark known materials and use"
    " those."
)
#: As many rows of the legend are seen without scrolling.
ROWS = 4
#: Lines of the hint, and of what a map rests on.
TEXT_LINES = 2
_MEASURES = (
    ("Probability", Measure.PROBABILITY),
    ("Spectral angle", Measure.ANGLE),
    ("Difference", Measure.RMSE),
)
_GROUPINGS = (
    ("Subfolders, or names", "auto"),
    ("Names without numbers", "name"),
    ("Folders", "folder"),
    ("Files", "file"),
    ("Each spectrum", "none"),
)
#: With a larger share of undecided pixels, what to do about them matters more than any note.
MOSTLY = 0.5
#: Name, range, decimals, unit and explanation of the first limit.
_WORST = {
    Measure.PROBABILITY: (
        (0.0, 0.5, 3, ""),
        "Share of the pixels of a class that may be called 'none of these', by the stated deviations",
    ),
    Measure.ANGLE: ((0.0, 1.5, 3, " rad"), "Largest spectral angle; beyond it a pixel is none of these"),
    Measure.RMSE: ((0.0, 1.0, 3, ""), "Largest difference of reflectance; beyond it, none of these"),
}
_MARGIN = {
    True: "Least probability of the class; below it a pixel is undecided between two",
    False: "By which share the second class must be worse; else a pixel is undecided between two",
}


class MaterialsPanel(QWidget):
    """Follows the materials of a state and asks their controller."""

    def __init__(self, state: ResultsState, control: AnswersController) -> None:
        super().__init__()
        self._state, self._control, self._theme = state, control, DARK
        #: The library, None for marks, and the way of what was asked for last, and of the map that is shown.
        self._asked: tuple[Path | None, Way] | None = None
        self._shown: tuple[Path | None, Way] | None = None
        self._shown_scores: Scores | None = None
        self.measure = ChoiceBox(
            "By",
            "How spectra are compared: the probability by the deviations of the bands, the spectral angle, or"
            " the difference",
            _MEASURES,
            lambda _: self._new_measure(),
        )
        self.free = check_box("Any brightness", "Compare the shape of spectra and not their level")
        self.error = NumberBox(
            "Library error",
            0,
            50,
            0,
            "%",
            1,
            "What spectra of a library may be off by (standard deviation), such as 2 % where another"
            " instrument measured them; it widens what the probability allows",
        )
        self.grouping = ChoiceBox(
            "Classes of a library",
            "What of a folder or file becomes a class: each subfolder and, of spectra in none, each name;"
            " 'leaf 1' and 'leaf 2' are one class by names without numbers",
            _GROUPINGS,
            lambda _: self._by_library_again(),
        )
        self.grouping.be_narrow()
        self.worst = NumberBox("Limit", 0, 1, 0.01, "", 3)
        self.margin = NumberBox("Margin", 0, 1, 0.95, "", 2)
        self.folder = push_button("Folder…", "Classes are the spectra of a folder; its subfolders are groups")
        self.file = push_button("File…", "Classes are the spectra of a file: CSV, ENVI, ASD, JCAMP, ...")
        self.marks = push_button("From marks", "Classes are the ticked pins, regions and references")
        self.clear = push_button("Clear", "Show the picture without materials", control.clear)
        self.write = push_button(
            "Write…", "Write the map as ENVI classification, as points (PLY), or the areas as CSV"
        )
        self.table = ReadTable(
            "Materials",
            "Classes with their pixels, shares and areas, ± one deviation; an area counts half of the pixels"
            " next to it that are of no class, as edges run through them",
            ("Material", "Pixels", "Share", "Area, mm²"),
        )
        self.table.widen(0)
        self.table.be_dense()
        self.text = label(HINT, "muted", wraps=True)
        self.text.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.error.setPrefix("± ")
        self._lay_out()
        self._keep_room()
        self._connect()
        self._new_measure()
        state.materials.follow(self._show)

    def _lay_out(self) -> None:
        sources = row_of(self.marks, self.folder, self.file, STRETCH)
        # "By" is not written: the smallest window has no room for it next to its picture.
        ways = row_of((self.measure, 1), self.free)
        limits = row_of(label("Limit"), self.worst, label("Margin"), self.margin, STRETCH)
        error = row_of(label("Library error"), self.error, STRETCH)
        classes = row_of(label("Classes of a library"), (self.grouping, 1))
        map_row = row_of(self.write, self.clear, STRETCH)
        column_of(
            sources, classes, ways, error, limits, self.text, (self.table, 1), map_row, on=self, margins=0
        )

    def _connect(self) -> None:
        self.folder.clicked.connect(self.choose_folder)
        self.file.clicked.connect(self.choose_file)
        self.marks.clicked.connect(self.use_marks)
        self.write.clicked.connect(self.choose_target)
        for box in (self.worst, self.margin):
            box.setKeyboardTracking(True)
            box.valueChanged.connect(lambda _: self._limit())
        self.free.toggled.connect(lambda _: self._compare_again())
        self.error.valueChanged.connect(lambda _: self._by_library_again(self._is_of_chosen_measure))

    def _keep_room(self) -> None:
        """Keep the room of the legend and of its notes: nothing moves under a click when they come."""
        # A layout takes one line of a text that breaks for enough, and draws the rest over the table.
        self.text.setMinimumHeight(TEXT_LINES * self.text.fontMetrics().lineSpacing())
        self.table.keep_room(ROWS)

    @property
    def way(self) -> Way:
        """How to compare, as it is chosen."""
        brightness: Brightness = "free" if self.free.isChecked() else "stated"
        error, grouping = self.error.value() / 100, self.grouping.currentData()
        limits = Limits(self.worst.value(), self.margin.value())
        return Way(Measure(self.measure.currentData()), brightness, error, grouping, limits)

    def choose_folder(self) -> None:
        """Ask for the folder of a library."""
        folder = ask_folder(self, "A folder of spectra; its subfolders are groups")
        if folder is not None:
            self.use_library(folder)

    def choose_file(self) -> None:
        """Ask for the file of a library."""
        kinds = " ".join(f"*{suffix}" for suffix in suffixes())
        kinds = f"Spectra ({kinds});;All files (*)"
        path = ask_file(self, "A file of spectra", kinds)
        if path is not None:
            self.use_library(path)

    def use_marks(self) -> None:
        """Look for the spectra of what is marked."""
        before, self._asked = self._asked, (None, self.way)
        if not self._control.from_marks(self.way, self._put_back):
            self._asked = before

    def use_library(self, path: Path) -> None:
        """Look for the spectra of a file or folder."""
        self._asked = path, self.way
        self._control.from_library(path, self.way, self._put_back)

    def _put_back(self) -> None:
        """Choose again what the map is by that stays, as its successor was cancelled."""
        self._asked = self._shown
        if self._shown is None:
            return
        way = self._shown[1]
        with quiet(self.free, self.error):
            self.free.setChecked(way.brightness == "free")
            self.error.setValue(100 * way.library_error)
        self.grouping.choose(way.grouping)
        self.measure.choose(way.measure)
        self._new_measure()

    @property
    def _library(self) -> Path | None:
        """The library that was asked for last; None for marks."""
        return None if self._asked is None else self._asked[0]

    @property
    def _is_of_chosen_measure(self) -> bool:
        """Whether the map that is shown is by the measure that is chosen for the next one."""
        materials = self._state.materials.value
        return materials is not None and materials.found.scores.measure is self.way.measure

    def _limit(self) -> None:
        """Put the map under the limits, unless they are for the next one, by another measure."""
        if self._is_of_chosen_measure:
            self._control.set_limits(self.worst.value(), self.margin.value())

    def _by_library_again(self, wanted: bool = True) -> None:
        """Show the map by other classes of the same library, if it is by one."""
        library = self._library
        if wanted and library is not None and self._state.materials.value is not None:
            self.use_library(library)

    def _compare_again(self) -> None:
        """Show the map by the other kind of comparison, from the classes that it has."""
        if self._is_of_chosen_measure and self._library is None:
            self.use_marks()
        else:
            self._by_library_again(self._is_of_chosen_measure)

    def choose_target(self) -> None:
        """Ask for a file and write the map."""
        # Another result may be opened while a person chooses.
        result, materials = self._state.result.value, self._state.materials.value
        if result is None or materials is None:
            return
        draft = str(folder_for(result.path) / f"{result.path.stem}_materials.hdr")
        kinds = "ENVI classification (*.hdr);;Points with their class (*.ply);;Table of areas (*.csv)"
        target = ask_target(self, "Write the map of materials", draft, kinds)
        if target is not None:
            self._control.write(result, materials, *target)

    def _new_measure(self) -> None:
        """Other limits belong to another measure; a map that is shown keeps its own."""
        measure, materials = Measure(self.measure.currentData()), self._state.materials.value
        limits = Limits.usual(measure)
        if materials is not None and materials.found.scores.measure is measure:
            limits = materials.found.limits
        self._offer(measure, limits)
        self._tell(materials)

    def _tell(self, materials: Materials | None) -> None:
        """Say what the map rests on, or that its measure is not the chosen one, whose limits are shown."""
        if materials is None:
            self.text.setText(HINT)
        else:
            tell = materials_text if self._is_of_chosen_measure else other_measure_text
            self.text.setText(tell(materials))

    def _offer(self, measure: Measure, limits: Limits) -> None:
        """Offer what belongs to a measure."""
        for box in (self.free, self.error):
            allow(box, measure is Measure.PROBABILITY, "Belongs to the probability; choose that above.")
        self._offer_limits(measure, limits)

    def _offer_limits(self, measure: Measure, limits: Limits) -> None:
        (low, high, decimals, unit), tip = _WORST[measure]
        with quiet(self.worst, self.margin):
            self.worst.setRange(low, high)
            self.worst.setDecimals(decimals)
            self.worst.setSuffix(unit)
            self.worst.setSingleStep(0.005)
            self.margin.setSingleStep(0.01)
            self.worst.setToolTip(plain_tip(tip))
            self.margin.setToolTip(plain_tip(_MARGIN[measure is Measure.PROBABILITY]))
            self.worst.setValue(limits.worst)
            self.margin.setValue(limits.margin)

    def _show(self, materials: Materials | None) -> None:
        for button in (self.clear, self.write):
            allow(button, materials is not None, "Name the materials first.")
        self.table.setVisible(materials is not None)
        self.text.setToolTip(plain_tip("" if materials is None else _method(materials)))
        if materials is not None:
            self._follow_scores(materials.found.scores, materials.found.limits)
        self._tell(materials)
        if materials is None:
            return
        rows, colours = [], materials.found.shown.palette(self._theme.ground)
        for row in materials.found.rows:
            if not row.pixels and len(materials.found.rows) > 20:
                continue
            first = cell(row.label)
            first.setIcon(swatch(colours[row.value] if row.value else "transparent"))
            figures = (cell(text, "", RIGHT) for text in (row.pixels_text, row.share_text, row.area_text))
            rows.append((first, *figures))
        self.table.show_rows(rows)

    def _follow_scores(self, scores: Scores, limits: Limits) -> None:
        """Choose the measure of a new map; other limits or colours leave what is chosen for the next one."""
        if scores is self._shown_scores:
            # A box that is written to while a person types in it loses what is typed.
            return
        self._shown_scores, self._shown = scores, self._asked
        self.measure.choose(scores.measure)
        self._offer(scores.measure, limits)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.table.apply_theme(theme)
        self._show(self._state.materials.value)


def materials_text(materials: Materials) -> str:
    """What the map rests on, and what is doubtful of it: two lines at most, since the legend needs the room.

    A note is told up to its reason; pointing at the text tells all of them whole.
    """
    classes = len(materials.found.shown.names)
    text = f"{counted(classes, 'class', 'classes')} by {materials.name}."
    undecided = _undecided(materials)
    if undecided > MOSTLY:
        return f"{text} {100 * undecided:.0f} % undecided: classes are alike. Choose above what is one class."
    if materials.notes:
        # The file that a note is about was named just before.
        note, of_file = materials.notes[0], f"{materials.name}: "
        if note.startswith(of_file):
            note = capitalised(note.removeprefix(of_file))
        first, colon, _ = note.partition(": ")
        others = f" and {counted(len(materials.notes) - 1, 'more note')}" if len(materials.notes) > 1 else ""
        text += f" {first.rstrip('.')}{others}" + ("; point here for why." if colon or others else ".")
    return text


def other_measure_text(materials: Materials) -> str:
    """What a map is by, where the panel shows the measure and limits of the next one."""
    found = materials.found
    measure = next(text for text, measure in _MEASURES if measure is found.scores.measure).lower()
    limit = f"{found.limits.worst:g}{_WORST[found.scores.measure][0][3]}"
    return f"This map is by {measure}, limit {limit}. The measure above is that of the next map."


def _undecided(materials: Materials) -> float:
    """The share of judged pixels that are undecided."""
    shown = materials.found.shown
    return next((row.share or 0.0 for row in materials.found.rows if row.value == shown.unsure), 0.0)


def _method(materials: Materials) -> str:
    """How the map was made, in whole, and its first notes."""
    return "\n".join((f"By {materials.name}: {materials.found.method}.", *materials.notes[:20]))
