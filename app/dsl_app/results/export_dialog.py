"""Which formats to write, where, and what that would replace."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from dsl_app.results.commands import ResultCommands
from dsl_app.results.state import ResultsState
from dsl_app.shared.widgets.forms import set_role
from dsl_app.shared.widgets.help_window import add_help_key

#: Format, ending, what it is for, and whether it needs spectra.
FORMATS = (
    ("ply", ".ply", "PLY – points with normals, colours, spectra and deviations", False),
    ("envi", ".hdr", "ENVI – spectral cube and its deviation", True),
    ("exr", ".exr", "OpenEXR – spectral image", True),
    ("csv", ".csv", "CSV – spectra of the pins, with deviations", True),
    ("tiff", ".tiff", "TIFF – depth in mm as numbers, its deviation and flags beside it", False),
    ("npy", ".npy", "NumPy – the same as arrays", False),
    ("png", ".png", "PNG – pictures of colour, depth, the band shown, and flags", False),
)


class ExportDialog(QDialog):
    """Asks for formats, folder and name; the controller writes."""

    def __init__(self, state: ResultsState, commands: ResultCommands, parent: QWidget) -> None:
        super().__init__(parent)
        self._state, self._commands = state, commands
        result = state.result.value
        assert result is not None
        self.setWindowTitle("Export")
        self.resize(560, 360)
        add_help_key(self, "exporting")
        self.folder = QLineEdit(str(result.path.parent))
        self.folder.setAccessibleName("Folder")
        self.folder.setToolTip("Where the files are written")
        self.name = QLineEdit(result.path.stem)
        self.name.setAccessibleName("Name without ending")
        self.name.setToolTip("Each format adds its own ending")
        browse = QPushButton("Choose…")
        browse.setToolTip("Choose the folder to write to")
        browse.clicked.connect(self._browse)
        pins = any(mark.kind == "pin" and not mark.trouble for mark in state.marks.value)
        self.formats: dict[str, QCheckBox] = {}
        for form, _, text, needs_spectra in FORMATS:
            box = QCheckBox(text)
            box.setToolTip(text)
            possible = (result.has_spectra or not needs_spectra) and (form != "csv" or pins)
            box.setEnabled(possible)
            if not possible:
                box.setToolTip("Pin a pixel first" if form == "csv" else "This result holds depth only")
            box.toggled.connect(lambda _: self._check())
            self.formats[form] = box
        self.replace = QCheckBox("Replace files that exist")
        self.replace.setToolTip("Without this, nothing that exists is touched")
        self.replace.toggled.connect(lambda _: self._check())
        self.text = QLabel()
        self.text.setWordWrap(True)
        self.buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Cancel)
        self.write = self.buttons.addButton("Export", QDialogButtonBox.ButtonRole.AcceptRole)
        self.write.setToolTip("Write the chosen formats")
        self.buttons.button(QDialogButtonBox.StandardButton.Cancel).setToolTip("Write nothing (Escape)")
        self.buttons.accepted.connect(self._export)
        self.buttons.rejected.connect(self.reject)
        self.folder.textChanged.connect(lambda _: self._check())
        self.name.textChanged.connect(lambda _: self._check())
        self._lay_out(browse)
        self.formats["ply"].setChecked(True)

    def _lay_out(self, browse: QPushButton) -> None:
        row = QHBoxLayout()
        row.addWidget(self.folder, 1)
        row.addWidget(browse)
        form = QFormLayout()
        form.addRow("Folder", row)
        form.addRow("Name", self.name)
        column = QVBoxLayout(self)
        column.addLayout(form)
        for box in self.formats.values():
            column.addWidget(box)
        column.addSpacing(6)
        column.addWidget(self.replace)
        column.addWidget(self.text)
        column.addStretch(1)
        column.addWidget(self.buttons)

    @property
    def targets(self) -> dict[str, Path]:
        """Format and path of everything that is ticked."""
        folder, name = Path(self.folder.text()), self.name.text().strip()
        ticked = ((form, suffix) for form, suffix, _, _ in FORMATS if self.formats[form].isChecked())
        return {form: folder / f"{name}{suffix}" for form, suffix in ticked}

    def _browse(self) -> None:
        folder = QFileDialog.getExistingDirectory(self, "Export to", self.folder.text())
        if folder:
            self.folder.setText(folder)

    def _check(self) -> None:
        trouble = self._trouble()
        self.text.setText(trouble or ", ".join(path.name for path in self.targets.values()))
        set_role(self.text, "warn" if trouble else "muted")
        self.write.setEnabled(not trouble)

    def _trouble(self) -> str:
        """Why nothing can be written as it stands; empty when it can."""
        if not self.targets:
            return "Tick at least one format."
        if not self.name.text().strip():
            return "Give the files a name."
        if not Path(self.folder.text()).is_dir():
            return f"{self.folder.text()} is no folder. Choose one that exists."
        taken = self._commands.taken(self.targets)
        if taken and not self.replace.isChecked():
            names = ", ".join(path.name for path in taken[:4]) + (" and more" if len(taken) > 4 else "")
            return f"{names} exists already. Choose another name, or allow it to be replaced."
        return ""

    def _export(self) -> None:
        self._commands.export(self.targets, self.replace.isChecked())
        self.accept()
