"""The dialog of a rig profile: a tab for each device, and beside them what trying the devices said."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFormLayout, QLineEdit, QWidget

from dsl_app.rig.profiles.controller import ProfileController
from dsl_app.rig.profiles.device_form import DeviceForm
from dsl_app.rig.profiles.draft import Draft
from dsl_app.rig.profiles.state import ProfileState, profile_view
from dsl_app.shared.evented import follow_any
from dsl_app.shared.widgets.ask_file import ask_file
from dsl_app.shared.widgets.dialogs import command_window, confirm, dialog_buttons, resize_within
from dsl_app.shared.widgets.forms import keep_height, label, named, push_button, set_role
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.inside import stop_following
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, tabs_of
from dsl_app.shared.widgets.read_table import ReadTable, cell
from dsl_core.devices.doctor import Finding, Grade
from dsl_core.devices.driver_table import KINDS, Kind

WIDTH_PX, HEIGHT_PX = 1060, 660
_ROLES = {Grade.GOOD: "good", Grade.WARNING: "warn", Grade.BAD: "bad"}


class ProfileDialog(QDialog):
    """Follows a `ProfileState`; the controller finds, tries and saves."""

    def __init__(self, state: ProfileState, commands: ProfileController, parent: QWidget) -> None:
        super().__init__(parent)
        self._state, self._commands, self._was_wrong = state, commands, False
        self.setWindowTitle("Rig profile")
        resize_within(self, QSize(WIDTH_PX, HEIGHT_PX))
        add_help_key(self, "connecting-devices")
        tip = "The name by which the rig is chosen, and that of the profile's file"
        self.name = named(QLineEdit(), "Name of the rig", tip)
        tip = "A file with the figures of the data sheets, from which a calibration starts; may be left empty"
        self.nominal = named(QLineEdit(), "Data sheets", tip)
        self.nominal.setPlaceholderText("not set")
        self.browse = push_button("&File…", "Choose the file of the data sheets", self._choose_nominal)
        self.note = named(QLineEdit(), "Note", "Anything worth knowing about this rig")
        drivers = state.drivers.value
        self.forms = {kind: DeviceForm(kind, drivers.get(kind, ()), commands) for kind in KINDS}
        self.look = push_button("&Look for devices", "Ask every driver which devices it sees", commands.look)
        self.test = push_button(
            "&Try", "Open every device, try it, and say what is wrong; nothing is moved", commands.try_devices
        )
        self.verdict = label("", "muted", wraps=True)
        self.findings = ReadTable(
            "What trying the devices said",
            "Good, warning or bad, with what to do",
            ("Device", "What was found"),
        )
        self.findings.wrap(1)
        self.trouble = label("", "bad", wraps=True)
        self.buttons = dialog_buttons(QDialogButtonBox.StandardButton.Cancel)
        self.buttons.button(QDialogButtonBox.StandardButton.Cancel).setToolTip("Close unsaved (Escape)")
        self.save = self.buttons.addButton("Save", QDialogButtonBox.ButtonRole.AcceptRole)
        self.save.setToolTip("Save the profile, whole or not at all")
        self.command = self.buttons.addButton("Show command line", QDialogButtonBox.ButtonRole.ActionRole)
        self.command.setToolTip("Show the command that tries the devices of the saved profile")
        keep_height(self.look, self.test)
        self._lay_out()
        self._connect()
        self.name.setFocus()

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.addRow("Name", self.name)
        form.addRow("Data sheets", row_of((self.nominal, 1), self.browse))
        form.addRow("Note", self.note)
        self.tabs = tabs_of("Devices", *((form, kind.capitalize(), "") for kind, form in self.forms.items()))
        right = boxed(column_of(row_of(self.test, STRETCH), self.verdict, (self.findings, 1), margins=0))
        left = boxed(column_of(row_of(self.look, STRETCH), (self.tabs, 1), margins=0))
        column_of(form, (row_of((left, 1), (right, 1), spacing=16), 1), self.trouble, self.buttons, on=self)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.name.textEdited.connect(lambda text: commands.change(name=text))
        self.nominal.textEdited.connect(lambda text: commands.change(nominal=text))
        self.note.textEdited.connect(lambda text: commands.change(note=text))
        self.command.clicked.connect(lambda: command_window(commands.command_line(), self).open())
        self.buttons.accepted.connect(self._save)
        self.buttons.rejected.connect(self.reject)
        self.stops = [
            state.draft.follow(self._show_draft),
            state.found.follow(self._show_found),
            state.findings.follow(self._show_findings),
            state.wrong.follow(self._show_wrong),
            *follow_any(self._show, state.draft, state.busy, state.trouble, state.findings, state.found),
        ]

    # Show ------------------------------------------------------------------------------------------

    def _show_draft(self, draft: Draft) -> None:
        for field, text in ((self.name, draft.name), (self.nominal, draft.nominal), (self.note, draft.note)):
            if field.text() != text:
                field.setText(text)
        for kind, form in self.forms.items():
            form.show_part(draft.part(kind))

    def _show_found(self, found: object) -> None:
        for form in self.forms.values():
            form.show_found(self._state.found.value)

    def _show_findings(self, findings: tuple[Finding, ...]) -> None:
        self.findings.show_rows([[cell(f.device), cell(f.text, _ROLES[f.grade])] for f in findings])

    def _show_wrong(self, wrong: Mapping[Kind, Mapping[str, str]]) -> None:
        for kind, form in self.forms.items():
            form.show_wrong(wrong.get(kind, {}))
        if wrong and not self._was_wrong:
            # The field may be on another tab than the one that is seen.
            self.tabs.setCurrentWidget(self.forms[next(iter(wrong))])
        self._was_wrong = bool(wrong)

    def _show(self) -> None:
        view = profile_view(self._state)
        self.verdict.setText(view.verdict)
        set_role(self.verdict, view.verdict_role)
        self.trouble.setText(view.trouble or view.remark)
        set_role(self.trouble, "bad" if view.trouble else "muted")
        for name, button in (("look", self.look), ("try", self.test), ("save", self.save)):
            button.setEnabled(view.can_act)
            set_role(button, "primary" if name == view.following else "")
            # The Return key in a field does what comes next, and saves nothing half done.
            button.setDefault(name == view.following)

    # Do --------------------------------------------------------------------------------------------

    def _choose_nominal(self) -> None:
        path = ask_file(self, "Choose the data sheets", "Rigs (*.json)")
        if path is not None:
            self._commands.change(nominal=str(path))

    def _save(self) -> None:
        if self._commands.save():
            self.accept()

    def reject(self) -> None:
        """Leave; what was not saved is dropped only if the person agrees."""
        if not self._state.is_unsaved or self._may_drop():
            super().reject()

    def _may_drop(self) -> bool:
        return confirm(
            self,
            "Unsaved rig profile",
            "This rig profile is not saved. Close it and lose what was changed?",
            go="Close unsaved",
            stay="Keep editing",
        )

    def done(self, result: int) -> None:
        """Disconnect from the state."""
        stop_following(self)
        super().done(result)
