"""The plan of a scan: a preset, or code, patterns and settings of one's own."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFormLayout, QGroupBox, QWidget

from app.panels.setting_rows import SettingRows
from app.state.scan import preset_of
from app.widgets.forms import ChoiceBox, WholeBox, label
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, NoCode, ScanLines
from dsl_core.model.presets import PRESETS

OWN = "Own plan"
OWN_PURPOSE = "Not one of the presets; nothing is known of its accuracy."
WIDEST_PX = 4096


class PlanEditor(QGroupBox):
    """Shows a plan; ``preset_chosen`` and ``plan_changed`` tell what a person wants instead."""

    preset_chosen = Signal(str)
    plan_changed = Signal(object)

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
        self.code.addItem("Columns and rows", True)
        self.code.addItem("Columns only", False)
        self.code.addItem("None", None)
        self.patterns = ChoiceBox("Patterns", "One line a frame, or several at once")
        self.patterns.addItem("Single lines", "lines")
        self.patterns.addItem("Comb of lines", "comb")
        self.line_width = WholeBox("Line width", 1, WIDEST_PX, 5, "px", "Columns that a line lights")
        self.step = WholeBox("Step", 1, WIDEST_PX, 2, "px", "How far lines move from frame to frame")
        self.period = WholeBox("Period", 2, WIDEST_PX, 106, "px", "Distance of the lines of a comb")
        self.settings = SettingRows()
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

    def _connect(self) -> None:
        self.preset.activated.connect(self._choose)
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
        self._purpose.setText(OWN_PURPOSE if preset is None else preset.purpose)
        rows = None if isinstance(plan.code, NoCode) else plan.code.rows
        self.code.setCurrentIndex((True, False, None).index(rows))
        comb, lines = isinstance(plan.spectral, LineComb), isinstance(plan.spectral, ScanLines | LineComb)
        for widget in (self.patterns, self.line_width, self.step):
            widget.setEnabled(lines)
        self.period.setEnabled(comb)
        if isinstance(plan.spectral, ScanLines | LineComb):
            self._show_lines(plan.spectral)
        self.settings.set_settings(plan.settings, period_ms)

    def _show_lines(self, lines: ScanLines | LineComb) -> None:
        self.patterns.setCurrentIndex(1 if isinstance(lines, LineComb) else 0)
        values: list[tuple[WholeBox, int]] = [(self.line_width, lines.width_px), (self.step, lines.step_px)]
        if isinstance(lines, LineComb):
            values.append((self.period, lines.period_px))
        for box, value in values:
            box.blockSignals(True)
            box.setValue(value)
            box.blockSignals(False)
        self.period.setSingleStep(lines.step_px)

    def _edited(self) -> None:
        rows = self.code.currentData()
        width, step = self.line_width.value(), self.step.value()
        spectral: ScanLines | LineComb
        if self.patterns.currentData() == "comb":
            # Whole steps a period, and room for a gap: only such combs can be reconstructed.
            period = max(round(self.period.value() / step), 2 + width // step) * step
            spectral = LineComb(width_px=width, step_px=step, period_px=period)
        else:
            spectral = ScanLines(width_px=width, step_px=step)
        self._tell(code=NoCode() if rows is None else GrayCode(rows=rows), spectral=spectral)

    def _tell(self, **changes: object) -> None:
        self.plan_changed.emit(self._plan.model_copy(update={**changes, "name": "own plan"}))
