"""What a quick shot of a flat target said of a calibration, and what to do about it."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QPushButton, QVBoxLayout, QWidget

from dsl_app.calibrate.figures_table import FiguresTable
from dsl_app.calibrate.state import DriftVerdict
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_core.model.figure import failures

WHAT_TO_DO = (
    "What to do stands beside each figure that misses its limit. Put it right and check again, or calibrate"
    " again what is named. Scans with this calibration stay possible, but share its error."
)


class DriftWindow(QDialog):
    """Shows a verdict; ``again_wanted`` asks for another check, ``use_wanted`` for scans all the same."""

    again_wanted = Signal()
    use_wanted = Signal()

    def __init__(self, verdict: DriftVerdict, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(f"Drift check of {verdict.name}")
        self.resize(860, 420)
        add_help_key(self, "calibrating#what-the-quick-check-sees")
        wrong = failures(verdict.figures)
        self.table = FiguresTable("Figures of the drift check")
        self.table.apply_theme(theme)
        self.table.show_figures(verdict.figures)
        column = QVBoxLayout(self)
        text = f"The rig is {'not ' if wrong else ''}as {verdict.name} says."
        column.addWidget(label(text, "bad" if wrong else "good"))
        if verdict.overridden:
            column.addWidget(_wrapped(f"Checked although {'; '.join(verdict.overridden)}.", "warn"))
        column.addWidget(self.table, 1)
        if wrong:
            column.addWidget(_wrapped(WHAT_TO_DO, "muted"))
        column.addWidget(self._buttons(bool(wrong)))

    def _buttons(self, wrong: bool) -> QDialogButtonBox:
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        self.again, self.use = QPushButton("Check &again"), QPushButton("&Use it all the same")
        self.again.setToolTip("Take the quick shot once more; the target must still be in place")
        self.use.setToolTip("Scan with this calibration from now on, in spite of what has drifted")
        for button, wanted in ((self.again, self.again_wanted), (self.use, self.use_wanted)):
            buttons.addButton(button, QDialogButtonBox.ButtonRole.ActionRole)
            button.clicked.connect(wanted)
            button.clicked.connect(self.accept)
            button.setVisible(wrong)
        return buttons


def _wrapped(text: str, role: str) -> QWidget:
    made = label(text, role)
    made.setWordWrap(True)
    return made
