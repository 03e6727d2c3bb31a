"""The head of the Calibrate page: which campaign is open, and what is done with all of it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QFileDialog, QFormLayout, QFrame, QLineEdit, QWidget

from dsl_app.calibrate.presentation import campaign_head
from dsl_app.calibrate.state import CalibrateState
from dsl_app.connection.state import RigState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.known_files import first_free
from dsl_app.shared.paths import expanded, place_trouble, there
from dsl_app.shared.widgets.dialogs import dialog_buttons
from dsl_app.shared.widgets.forms import label, push_button, set_role, show_parts
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_core.io.campaign_folder import is_lost_campaign

if TYPE_CHECKING:
    from dsl_app.calibrate.controller import CalibrateController


class NewCampaignDialog(QDialog):
    """Asks for the name and place of a campaign's folder."""

    def __init__(self, home: Path, rig: str, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("New campaign")
        self.name = QLineEdit(first_free(home, f"campaign-{datetime.now():%Y%m%d}").name)
        self.name.setAccessibleName("Name of the campaign")
        self.name.setToolTip("Name of the folder, and of the calibrated rig in the library")
        self.folder = QLineEdit(str(home))
        self.folder.setAccessibleName("Folder of campaigns")
        self.folder.setToolTip("Folder that will contain the campaign's own folder")
        self.browse = push_button("Choose…", "Choose the folder of campaigns", self._browse)
        self._text = label("", "warn", wraps=True)
        buttons = dialog_buttons(QDialogButtonBox.StandardButton.Cancel)
        self.begin = buttons.addButton("Begin", QDialogButtonBox.ButtonRole.AcceptRole)
        self.begin.setToolTip("Create the folder and start the campaign")
        set_role(self.begin, "primary")
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        row = row_of((self.folder, 1), self.browse)
        form = QFormLayout()
        form.addRow("Name", self.name)
        form.addRow("In folder", row)
        form.addRow("Rig", label(rig, "muted"))
        column_of(form, self._text, STRETCH, buttons, on=self)
        for field in (self.name, self.folder):
            field.textChanged.connect(lambda _: self._check())
        self.name.setFocus()
        self.name.selectAll()
        self.resize(540, self.sizeHint().height())
        self._check()

    @property
    def target(self) -> Path:
        """The folder of the campaign."""
        return expanded(Path(self.folder.text())) / self.name.text().strip()

    def _browse(self) -> None:
        name = QFileDialog.getExistingDirectory(self, "Folder of campaigns", self.folder.text())
        if name:
            self.folder.setText(name)

    def _check(self) -> None:
        trouble = told = ""
        if not self.name.text().strip() or "/" in self.name.text():
            trouble = "Give the campaign a name without slashes."
        elif barred := place_trouble(self.target):
            trouble = barred
        elif is_lost_campaign(self.target):
            told = "Captures of a campaign are in this folder. It begins again with them, for this rig."
        elif there(self.target):
            trouble = f"{self.target.name} already exists in this folder. Choose another name, or open it."
        self._text.setText(trouble or told)
        self.begin.setEnabled(not trouble)


class CampaignBox(QFrame):
    """Which campaign is open; buttons for a new one, another one, everything, and the library.

    ``home`` is the folder where new campaigns are proposed.
    """

    def __init__(
        self, state: CalibrateState, rig: RigState, commands: CalibrateController, home: Path
    ) -> None:
        super().__init__()
        self._state, self._rig, self._commands, self._home = state, rig, commands, home
        self.title, self.place = label("", "title"), label("", "muted", wraps=True, can_be_copied=True)
        self.new = push_button("&New campaign…", "Start a campaign for the chosen rig in a new folder")
        self.open = push_button("&Open campaign…", "Continue an existing campaign", self._ask_open)
        self.everything = push_button(
            "Calibrate everythin&g",
            "Run all calibrations in order, without questions, on a rig that places targets itself",
        )
        self.scan = push_button("P&lan a scan…", "Open the Scan page; scans use this calibration")
        self.cancel = push_button("Sto&p", "Stop at the next safe point; everything captured is kept")
        self.keep = push_button(
            "&Keep in library", "Assemble the rig as far as it is calibrated and save it in the library"
        )
        self.progress = label("", wraps=True, name="Progress of calibrating everything")
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        words = column_of(self.title, self.place, self.progress, spacing=2)
        row_of(
            (words, 1),
            *(
                (button, 0, Qt.AlignmentFlag.AlignTop)
                for button in (self.new, self.open, self.keep, self.cancel, self.everything, self.scan)
            ),
            on=self,
            margins=0,
        )

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.new.clicked.connect(lambda: self.ask_new())
        self.everything.clicked.connect(commands.run_everything)
        self.cancel.clicked.connect(commands.cancel_everything)
        self.keep.clicked.connect(commands.keep)
        shown = (state.campaign, state.everything, state.outcome, state.refused, state.rows, state.foreign)
        self.stops = follow_any(self._show, *shown, state.library, state.in_use, self._rig.usable)

    def ask_new(self) -> bool:
        """Ask for a new campaign; whether one was begun."""
        dialog = NewCampaignDialog(self._home, self._rig.choice.value.words, self)
        before = self._state.campaign.value
        accepted, target = dialog.exec() == QDialog.DialogCode.Accepted, dialog.target
        # Otherwise it would live as long as the page; it must not go before its answer is read.
        dialog.deleteLater()
        if not accepted:
            return False
        self._commands.begin_campaign(target)
        return self._state.campaign.value != before

    def _ask_open(self) -> None:
        facts = self._state.campaign.value
        start = self._home if facts is None else facts.path.parent
        path = OpenDialog.ask(self, "Open a campaign", str(start), takes_folders=True)
        if path is not None:
            self._commands.open_campaign(path)

    def _show(self) -> None:
        show_parts(self, campaign_head(self._state, self._rig.usable.value))
