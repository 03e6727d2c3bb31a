"""The plan of a scan: a preset, or code, patterns and settings of one's own."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFormLayout, QGroupBox, QHBoxLayout, QPushButton, QWidget

from dsl_app.scan.setting_rows import SettingRows
from dsl_app.scan.state import preset_of
from dsl_app.shared.widgets.forms import ChoiceBox, WholeBox, label
from dsl_app.shared.widgets.help_window import set_help
from dsl_core.model.plan import CapturePlan, Columns, LineComb, NoCode, ScanLines
from dsl_core.model.presets import CODE_CHOICES, PRESETS, code_of, name_of

OWN = "Own plan"
OWN_PURPOSE = "Not one of the presets; the table beside says what to expect of it."
LINES, COMB, COLOURS, FILE = "lines", "comb", "colours", "file"
WIDEST_PX = 4096


class PlanEditor(QGroupBox):
    """Shows a plan; ``preset_chosen`` and ``plan_changed`` tell what a person wants instead.

    ``open_wanted`` and ``save_wanted`` ask for files.
    """

    preset_chosen = Signal(str)
    plan_changed = Signal(object)
    open_wanted = Signal()
    save_wanted = Signal()

    def __init__(self) -> None:
        super().__init__("Plan")
        self._plan = CapturePlan()
        self.preset = ChoiceBox("Preset", "Plans by name, from a quick look to what was published")
        for each in PRESETS:
            self.preset.addItem(each.title, each.key)
        self.preset.addItem(OWN, "")
        self._purpose = label("", "muted")
        self._purpose.setWordWrap(True)
        self.code = ChoiceBox("Binary code", "Finds the projector column, and row, that lights each pixel")
        for choice in CODE_CHOICES:
            self.code.addItem(choice.title, choice.name)
        self.code.addItem("None", "")
        self.patterns = ChoiceBox("Patterns", "One line a frame, or several at once")
        self.patterns.addItem("Single lines", LINES)
        self.patterns.addItem("Comb of lines", COMB)
        self.patterns.addItem("Combs, one a colour", COLOURS)
        set_help(self.patterns, "designed-patterns")
        self.line_width = WholeBox("Line width", 1, WIDEST_PX, 5, "px", "Columns that a line lights")
        self.step = WholeBox("Step", 1, WIDEST_PX, 2, "px", "How far lines move from frame to frame")
        self.period = WholeBox("Period", 2, WIDEST_PX, 106, "px", "Distance of the lines of a comb")
        self.settings = SettingRows()
        self.open = QPushButton("&Open plan…")
        self.open.setToolTip("Plan what a file says: of 'Save plan', or of dsl-scan plan, tradeoff or design")
        self.save = QPushButton("Sa&ve plan…")
        self.save.setToolTip("Write this plan into a file, for this page or 'dsl-scan scan --plan'")
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        form = QFormLayout(self)
        rows: list[tuple[str, QWidget]] = [
            ("Preset", self.preset),
            ("", self._purpose),
            ("Code", self.code),
            ("Patterns", self.patterns),
            ("Line width", self.line_width),
            ("Step", self.step),
            ("Period", self.period),
        ]
        for name, widget in rows:
            if name:
                form.addRow(name, widget)
            else:
                form.addRow(widget)
        form.addRow(label("Settings", "heading"))
        form.addRow(self.settings)
        files = QHBoxLayout()
        files.addWidget(self.open)
        files.addWidget(self.save)
        form.addRow(files)

    def _connect(self) -> None:
        self.preset.activated.connect(self._choose)
        self.open.clicked.connect(self.open_wanted)
        self.save.clicked.connect(self.save_wanted)
        for box in (self.code, self.patterns):
            box.activated.connect(lambda _: self._edited())
        for number in (self.line_width, self.step, self.period):
            number.setKeyboardTracking(False)
            number.valueChanged.connect(lambda _: self._edited())
        self.settings.changed.connect(
            lambda settings: self._tell(settings=settings, code_settings=tuple(range(len(settings))))
        )

    def _choose(self) -> None:
        key = self.preset.currentData()
        if key:
            self.preset_chosen.emit(key)

    def set_plan(self, plan: CapturePlan, period_ms: float) -> None:
        """Show a plan on a projector of this frame period."""
        self._plan = plan
        preset = preset_of(plan, period_ms)
        self.preset.setCurrentIndex(self.preset.findData("" if preset is None else preset.key))
        self._purpose.setText(_purpose_of(plan) if preset is None else preset.purpose)
        self.code.setCurrentIndex(self.code.findData(name_of(plan.code) or ""))
        lines = isinstance(plan.spectral, ScanLines | LineComb)
        self._offer_file(not lines)
        for widget in (self.line_width, self.step):
            widget.setEnabled(lines)
        self.period.setEnabled(isinstance(plan.spectral, LineComb))
        if isinstance(plan.spectral, ScanLines | LineComb):
            self._show_lines(plan.spectral)
        self.settings.set_settings(plan.settings, period_ms)

    def _offer_file(self, on: bool) -> None:
        """Name patterns that are no lines; there is no way to them but a file or the curve."""
        index = self.patterns.findData(FILE)
        if on and index < 0:
            self.patterns.addItem("Designed", FILE)
        elif not on and index >= 0:
            self.patterns.removeItem(index)
        if on:
            self.patterns.setCurrentIndex(self.patterns.findData(FILE))

    def _show_lines(self, lines: ScanLines | LineComb) -> None:
        kind = LINES
        if isinstance(lines, LineComb):
            kind = COLOURS if any(lines.shifts_px) else COMB
        self.patterns.setCurrentIndex(self.patterns.findData(kind))
        values: list[tuple[WholeBox, int]] = [(self.line_width, lines.width_px), (self.step, lines.step_px)]
        if isinstance(lines, LineComb):
            values.append((self.period, lines.period_px))
        for box, value in values:
            box.blockSignals(True)
            box.setValue(value)
            box.blockSignals(False)
        self.period.setSingleStep(lines.step_px)

    def _edited(self) -> None:
        width, step = self.line_width.value(), self.step.value()
        kind, spectral = self.patterns.currentData(), self._plan.spectral
        if kind in (COMB, COLOURS):
            # Whole steps a period, and room for a gap: only such combs can be reconstructed.
            period = max(round(self.period.value() / step), 2 + width // step) * step
            third = round(period / 3)
            shifts = (0, third, 2 * third) if kind == COLOURS else (0, 0, 0)
            spectral = LineComb(width_px=width, step_px=step, period_px=period, shifts_px=shifts)
        elif kind == LINES:
            spectral = ScanLines(width_px=width, step_px=step)
        self._tell(code=code_of(self.code.currentData()) or NoCode(), spectral=spectral)

    def _tell(self, **changes: object) -> None:
        self.plan_changed.emit(self._plan.model_copy(update={**changes, "name": "own plan"}))


def _purpose_of(plan: CapturePlan) -> str:
    """What is to be said of a plan that is no preset."""
    if isinstance(plan.spectral, Columns):
        return f"{plan.spectral_count} designed patterns. {OWN_PURPOSE}"
    return OWN_PURPOSE
