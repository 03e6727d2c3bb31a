"""The form of one device: what was found, its driver, and a field for each of the driver's settings."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtWidgets import QFormLayout, QLabel, QLineEdit, QWidget

from dsl_app.rig.profiles.controller import ProfileController
from dsl_app.rig.profiles.draft import NEEDED, DraftPart, caption, text_of
from dsl_app.rig.profiles.state import Found
from dsl_app.shared.widgets.forms import ChoiceBox, label, named, quiet, set_role
from dsl_app.shared.widgets.layouts import boxed, column_of, scrolled
from dsl_app.shared.wording import in_window
from dsl_core.devices.driver_table import Kind, find_driver
from dsl_core.errors import DeviceError
from dsl_core.words import capitalised, sentence

NOTHING_FOUND, NOT_LOOKED = "nothing found", "not looked for yet"


class DeviceForm(QWidget):
    """Shows a `DraftPart` and asks the controller."""

    def __init__(self, kind: Kind, drivers: tuple[str, ...], commands: ProfileController) -> None:
        super().__init__()
        self.kind, self._commands = kind, commands
        self._shown: DraftPart | None = None
        self._abouts: dict[str, str] = {}
        self.fields: dict[str, QLineEdit] = {}
        #: What a setting is, or what is wrong with it, below its field.
        self.notes: dict[str, QLabel] = {}
        tip = "Devices that the drivers see now; choosing one fills in its driver and its address"
        self.found = ChoiceBox(f"Found {kind}", tip, (), self._choose)
        none = "Choose a driver" if kind in NEEDED else f"No {kind}"
        choices = [(none, ""), *((name, name) for name in drivers)]
        tip = f"The driver of the {kind}"
        self.driver = ChoiceBox(
            f"Driver of the {kind}", tip, choices, lambda name: commands.set_driver(kind, name)
        )
        self.about = label("", "muted", wraps=True)
        top = QFormLayout()
        top.addRow("Found", self.found)
        top.addRow("Driver", self.driver)
        top.addRow("", self.about)
        self.form = QFormLayout()
        area = scrolled(boxed(self.form))
        column_of(top, (area, 1), on=self)
        self.show_found(None)

    def _choose(self, found: Found | None) -> None:
        if found is not None:
            self._commands.choose_device(found)

    def show_found(self, found: tuple[Found, ...] | None) -> None:
        """List the devices of this kind; None before anybody looked for them."""
        none = NOT_LOOKED if found is None else NOTHING_FOUND
        own = [each for each in found or () if each.kind == self.kind]
        with quiet(self.found):
            self.found.clear()
            self.found.addItem(f"{len(own)} found: choose one" if own else none, None)
            for each in own:
                self.found.addItem(f"{each.device.words} ({each.driver})", each)
        self.found.setEnabled(bool(own))

    def show_part(self, part: DraftPart) -> None:
        """Show the device of a draft; fields are made again only for another driver."""
        self.driver.choose(part.driver)
        if self._shown is None or part.driver != self._shown.driver:
            self._make_fields(part.driver)
        self._shown = part
        for name, field in self.fields.items():
            text = part.texts.get(name, "")
            # What is being typed stays as it is.
            if field.text() != text:
                field.setText(text)

    def _make_fields(self, driver: str) -> None:
        while self.form.rowCount():
            self.form.removeRow(0)
        self.fields, self.notes, self._abouts = {}, {}, {}
        self.about.clear()
        if not driver:
            return
        try:
            found = find_driver(self.kind, driver)
        except DeviceError as error:
            self.about.setText(str(error))
            return
        needs = in_window(f". Needs {found.brings}") if found.brings else ""
        self.about.setText(capitalised(found.summary) + needs)
        for name, setting in found.settings.model_fields.items():
            field = named(QLineEdit(), caption(name), setting.description or name)
            default = setting.get_default(call_default_factory=True)
            if setting.is_required() or default in (None, "", {}):
                field.setPlaceholderText("needed" if setting.is_required() else "not set")
            else:
                # To be read: a frame period is 1000 / 60 ms.
                rounded = float(f"{default:.6g}") if isinstance(default, float) else default
                field.setPlaceholderText(text_of(rounded))
            field.textEdited.connect(lambda text, name=name: self._commands.set_text(self.kind, name, text))
            self.fields[name] = field
            self._abouts[name] = capitalised(setting.description or "")
            self.notes[name] = note = label(self._abouts[name], "muted", wraps=True)
            self.form.addRow(caption(name), column_of(field, note, 4, margins=0, spacing=2))

    def show_wrong(self, wrong: Mapping[str, str]) -> None:
        """Say below each field what is wrong with its setting, which is told by its name."""
        for name, note in self.notes.items():
            about = self._abouts[name]
            note.setText(f"{sentence(wrong[name])} {sentence(about)}" if name in wrong else about)
            set_role(note, "bad" if name in wrong else "muted")
