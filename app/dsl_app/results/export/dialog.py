"""The export dialog: formats, folder and name."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QLineEdit,
    QPushButton,
    QWidget,
)

from dsl_app.results.export.controller import ExportController
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.settings import folder_for
from dsl_app.shared.widgets.dialogs import dialog_buttons
from dsl_app.shared.widgets.forms import check_box, label, named, push_button, set_role
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of


class ExportDialog(QDialog):
    """Asks for formats, folder and name; the controller writes."""

    def __init__(self, control: ExportController, parent: QWidget) -> None:
        # What writes files is imported when somebody wants to.
        from dsl_core.io.export import formats

        super().__init__(parent)
        self._control, result = control, control.result
        self._offered = [form for form in formats().values() if form.listed]
        self.setWindowTitle("Export")
        self.resize(560, 360)
        add_help_key(self, "exporting")
        self.folder = named(QLineEdit(str(folder_for(result.path))), "Folder", "Where to write the files")
        tip = "Each format adds its own suffix"
        self.name = named(QLineEdit(result.path.stem), "Name without suffix", tip)
        browse = push_button("Choose…", "Choose the folder to write to", self._browse)
        self.formats: dict[str, QCheckBox] = {}
        for form in self._offered:
            box = self.formats[form.key] = QCheckBox(form.about)
            refusal = control.refusal(form)
            box.setEnabled(not refusal)
            box.setToolTip(plain_tip(refusal or form.about))
            box.toggled.connect(lambda _: self._check())
        self.replace = check_box("Replace existing files", "If not ticked, existing files are never replaced")
        self.replace.toggled.connect(lambda _: self._check())
        self.text = label("", wraps=True)
        self.buttons = dialog_buttons(QDialogButtonBox.StandardButton.Cancel)
        self.write = self.buttons.addButton("Export", QDialogButtonBox.ButtonRole.AcceptRole)
        self.write.setToolTip("Write the selected formats")
        set_role(self.write, "primary")
        self.buttons.button(QDialogButtonBox.StandardButton.Cancel).setToolTip("Write nothing (Escape)")
        self.buttons.accepted.connect(self._export)
        self.buttons.rejected.connect(self.reject)
        self.folder.textChanged.connect(lambda _: self._check())
        self.name.textChanged.connect(lambda _: self._check())
        self._lay_out(browse)
        self.formats["ply"].setChecked(True)

    def _lay_out(self, browse: QPushButton) -> None:
        row = row_of((self.folder, 1), browse)
        form = QFormLayout()
        form.addRow("Folder", row)
        form.addRow("Name", self.name)
        column_of(form, *self.formats.values(), 6, self.replace, self.text, STRETCH, self.buttons, on=self)

    @property
    def targets(self) -> dict[str, Path]:
        """Path by key of every selected format."""
        folder, name = Path(self.folder.text()), self.name.text().strip()
        return {
            form.key: folder / f"{name}{form.suffix}"
            for form in self._offered
            if self.formats[form.key].isChecked()
        }

    def _browse(self) -> None:
        folder = QFileDialog.getExistingDirectory(self, "Export to", self.folder.text())
        if folder:
            self.folder.setText(folder)

    def _check(self) -> None:
        targets = self.targets
        trouble = self._control.trouble(
            self.folder.text(), self.name.text().strip(), targets, self.replace.isChecked()
        )
        self.text.setText(trouble or ", ".join(path.name for path in targets.values()))
        set_role(self.text, "warn" if trouble else "muted")
        self.write.setEnabled(not trouble)

    def _export(self) -> None:
        self._control.write(self.targets, self.replace.isChecked())
        self.accept()
