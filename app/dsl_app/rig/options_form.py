"""The options of a rig: the scene and size of the simulated one as choices, all others as text."""

from __future__ import annotations

import shlex
from collections.abc import Callable

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFormLayout, QLineEdit, QWidget

from dsl_app.shared.widgets.forms import ChoiceBox, named, quiet
from dsl_core.words import quoted

#: The longest label of the form around this one.
LONGEST_LABEL = "Projector"
#: The rig that scene and size are options of, and its scene if none is chosen.
SIMULATED, FIRST_SCENE = "twin", "color-checker"
#: Options that are chosen from lists.
CHOSEN = ("scene", "size")
#: Sizes of the camera's image, by what they are called; an empty one is the camera's own.
SIZES = (("Full, 890 × 580 px", ""), ("Half, 445 × 290 px", "445x290"), ("Quarter, 222 × 145 px", "222x145"))
#: Names and descriptions of scenes.
Scenes = tuple[tuple[str, str], ...]


def known_scenes() -> Scenes:
    """The scenes of the simulated rig; takes a moment."""
    from dsl_core.simulation.scenes.catalogue import scene_catalogue

    return tuple((entry.name, entry.description) for entry in scene_catalogue())


class SceneBox(ChoiceBox):
    """Knows the scene that is chosen, and reads the others when its list is opened."""

    def __init__(self, scenes: Callable[[], Scenes]) -> None:
        super().__init__("Scene", "What stands in front of the simulated camera")
        self._scenes: Callable[[], Scenes] | None = scenes

    def showPopup(self) -> None:
        """Open the list, filled."""
        self.fill()
        super().showPopup()

    def fill(self) -> None:
        """Add all scenes to the list, once."""
        if self._scenes is None:
            return
        scenes, self._scenes = self._scenes(), None
        chosen = self.currentData()
        with quiet(self):
            for name, about in scenes:
                if self.findData(name) < 0:
                    self.addItem(name, name)
                self.setItemData(self.findData(name), about, 3)
            self.choose(chosen)

    def show_scene(self, name: str) -> None:
        """Show a scene as the chosen one."""
        with quiet(self):
            if self.findData(name) < 0:
                self.addItem(name, name)
            self.choose(name)


class OptionsForm(QWidget):
    """Rows of a form: scene and size of the simulated rig are chosen, ``text`` holds all other options.

    Text is as the command line takes it; a scene or size that is typed there counts. ``chosen`` tells that
    another scene or size was chosen.
    """

    chosen = Signal()

    def __init__(self, scenes: Callable[[], Scenes] = known_scenes) -> None:
        super().__init__()
        self._is_simulated, self._picked = True, dict[str, str]()
        self.scene = SceneBox(scenes)
        self.scene.activated.connect(lambda _: self._choose("scene", str(self.scene.currentData())))
        tip = "Size of the simulated camera's image: smaller ones are quicker"
        self.size_px = ChoiceBox("Size", tip, SIZES, lambda size: self._choose("size", size))
        tip = (
            "Other options as name=value, separated by spaces, in quotes where they contain some; the help on"
            " this page (F1) lists them"
        )
        self.text = named(QLineEdit(), "Options of the rig", tip)
        self.text.setPlaceholderText("none")
        self.text.textChanged.connect(lambda _: self._show())
        self.form = QFormLayout(self)
        self.form.setContentsMargins(0, 0, 0, 0)
        self.form.addRow("Scene", self.scene)
        self.form.addRow("Size", self.size_px)
        self.form.addRow("Options", self.text)
        # In line with the fields of the form around it.
        for field in (self.scene, self.size_px, self.text):
            name = self.form.labelForField(field)
            name.setMinimumWidth(name.fontMetrics().horizontalAdvance(LONGEST_LABEL))
        self._show()

    def set_rig(self, name: str) -> None:
        """Show what a rig of this name has."""
        self._is_simulated = name == SIMULATED
        for box in (self.scene, self.size_px):
            self.form.setRowVisible(box, self._is_simulated)

    @property
    def options(self) -> tuple[tuple[str, str], ...]:
        """The options: what is chosen, then what is typed, in its order."""
        typed = parse_options(self.text.text())
        picked = self._picked.items() if self._is_simulated else ()
        return (*(pair for pair in picked if pair[0] not in dict(typed)), *typed)

    def show_options(self, options: tuple[tuple[str, str], ...]) -> None:
        """Show options, each in one place."""
        chosen = CHOSEN if self._is_simulated else ()
        self._picked = {key: value for key, value in sorted(options) if key in chosen}
        self.text.setText(" ".join(quoted(f"{key}={value}") for key, value in options if key not in chosen))
        self.text.setCursorPosition(0)
        self._show()

    def _choose(self, key: str, value: str) -> None:
        others = tuple(pair for pair in self.options if pair[0] != key)
        self.show_options(((key, value), *others) if value else others)
        self.chosen.emit()

    def _show(self) -> None:
        known = dict(self.options)
        self.scene.show_scene(known.get("scene", FIRST_SCENE))
        size = known.get("size", "")
        with quiet(self.size_px):
            if self.size_px.findData(size) < 0:
                self.size_px.addItem(size.replace("x", " × ") + " px", size)
            self.size_px.choose(size)


def parse_options(text: str) -> tuple[tuple[str, str], ...]:
    """Options from ``key=value`` texts separated by spaces; a word without ``=`` means ``on``.

    Quotes hold a value with spaces together, as in a terminal; one without its other half is a character.

    >>> parse_options("noise 'scan=/data/Max M/a b.dsl'")
    (('noise', 'on'), ('scan', '/data/Max M/a b.dsl'))
    """
    pairs = [part.partition("=") for part in _words(text)]
    return tuple((key, value if sign else "on") for key, sign, value in pairs)


def _words(text: str) -> list[str]:
    reader = shlex.shlex(text, posix=True, punctuation_chars=False)
    # Paths of Windows have backslashes, and values may have any sign.
    reader.whitespace_split, reader.escape, reader.commenters = True, "", ""
    try:
        return list(reader)
    except ValueError:
        return text.split()
