"""The editor of a plan: a preset, or a custom combination of code, patterns and settings."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFormLayout, QGridLayout, QGroupBox, QWidget

from dsl_app.scan.state import LONGEST_MS, preset_of
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, WholeBox, label, push_button, quiet
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.layouts import row_of, tab_in_place
from dsl_core.model.plan import (
    CUSTOM,
    LEAST_LEVEL,
    CapturePlan,
    Columns,
    LineComb,
    NoCode,
    ScanLines,
    Setting,
)
from dsl_core.model.presets import CODE_CHOICES, PRESETS, code_of, name_of, whole_cycles

OWN = "Custom plan"
OWN_PURPOSE = "Not a preset; the table shows what to expect."
LINES, COMB, COLOURS, FILE = "lines", "comb", "colours", "file"
WIDEST_PX = 4096
MOST_SETTINGS = 4
SHORTEST_MS = 0.1
#: An hour: some cameras name no longest exposure.
MOST_MS = 3_600_000.0
_EXPOSURE_TIP = "Exposures are whole LED cycles, so that each contains all colours of the projector."


class PlanEditor(QGroupBox):
    """Shows a plan; ``preset_chosen`` and ``plan_changed`` report what the person chose instead.

    ``open_requested`` and ``save_requested`` ask for files.
    """

    preset_chosen = Signal(str)
    plan_changed = Signal(object)
    open_requested = Signal()
    save_requested = Signal()

    def __init__(self) -> None:
        super().__init__("Plan")
        self._plan = CapturePlan()
        presets = [*((each.title, each.key) for each in PRESETS), (OWN, "")]
        tip = "Named plans, from a quick preview to the published one"
        self.preset = ChoiceBox("Preset", tip, presets, self._choose)
        self._purpose = label("", "muted", wraps=True)
        codes = [*((choice.title, choice.name) for choice in CODE_CHOICES), ("None", "")]
        tip = "Finds the projector column and row that light each pixel"
        self.code = ChoiceBox("Binary code", tip, codes, lambda _: self._edited())
        kinds = [("Single lines", LINES), ("Comb of lines", COMB), ("Combs, one per colour", COLOURS)]
        tip = "One line per frame, or several at once"
        self.patterns = ChoiceBox("Patterns", tip, kinds, lambda _: self._edited())
        set_help(self.patterns, "designed-patterns")
        self.line_width = WholeBox("Line width", 1, WIDEST_PX, 5, "px", "Projector columns per line")
        self.step = WholeBox("Step", 1, WIDEST_PX, 2, "px", "Shift of the lines from frame to frame")
        self.period = WholeBox("Period", 2, WIDEST_PX, 106, "px", "Distance between the lines of a comb")
        self.settings = SettingRows()
        tip = "Open a plan or pattern set, saved here or by dsl-scan plan, tradeoff or design"
        self.open = push_button("&Open plan…", tip, self.open_requested)
        tip = "Save this plan to a file, for this page or for the command line"
        self.save = push_button("S&ave plan…", tip, self.save_requested)
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        form = QFormLayout(self)
        form.addRow("Preset", self.preset)
        form.addRow(self._purpose)
        form.addRow("Code", self.code)
        form.addRow("Patterns", self.patterns)
        form.addRow("Line width", self.line_width)
        form.addRow("Step", self.step)
        form.addRow("Period", self.period)
        form.addRow(label("Settings", "heading"))
        form.addRow(self.settings)
        form.addRow(row_of(self.open, self.save))

    def _connect(self) -> None:
        for number in (self.line_width, self.step, self.period):
            number.setKeyboardTracking(False)
            number.valueChanged.connect(lambda _: self._edited())
        self.settings.changed.connect(
            lambda settings: self._tell(settings=settings, code_settings=tuple(range(len(settings))))
        )

    def _choose(self, key: str) -> None:
        if key:
            self.preset_chosen.emit(key)
        else:
            # A plan becomes a custom one by being changed, and is none by its name alone.
            self._show_preset()

    def _show_preset(self) -> None:
        self.preset.choose("" if self._preset is None else self._preset.key)

    def set_plan(self, plan: CapturePlan, period_ms: float, longest_ms: float = LONGEST_MS) -> None:
        """Show a plan on a projector with this frame period and a camera with this longest exposure."""
        self._plan = plan
        self._preset = preset = preset_of(plan, period_ms)
        self._show_preset()
        self._purpose.setText(_purpose_of(plan) if preset is None else preset.purpose)
        self.code.choose(name_of(plan.code) or "")
        lines = isinstance(plan.spectral, ScanLines | LineComb)
        self._offer_file(not lines)
        for widget in (self.line_width, self.step):
            widget.setEnabled(lines)
        self.period.setEnabled(isinstance(plan.spectral, LineComb))
        if isinstance(plan.spectral, ScanLines | LineComb):
            self._show_lines(plan.spectral)
        self.settings.set_settings(plan.settings, period_ms, longest_ms)

    def _offer_file(self, on: bool) -> None:
        """List designed patterns only while they are in use: they come from a file or the curve."""
        index = self.patterns.findData(FILE)
        if on and index < 0:
            self.patterns.addItem("Designed", FILE)
        elif not on and index >= 0:
            self.patterns.removeItem(index)
        if on:
            self.patterns.choose(FILE)

    def _show_lines(self, lines: ScanLines | LineComb) -> None:
        kind = LINES
        if isinstance(lines, LineComb):
            kind = COLOURS if any(lines.shifts_px) else COMB
        self.patterns.choose(kind)
        values: list[tuple[WholeBox, int]] = [(self.line_width, lines.width_px), (self.step, lines.step_px)]
        if isinstance(lines, LineComb):
            values.append((self.period, lines.period_px))
        for box, value in values:
            with quiet(box):
                box.setValue(value)
        self.period.setSingleStep(lines.step_px)

    def _edited(self) -> None:
        width, step = self.line_width.value(), self.step.value()
        kind, spectral = self.patterns.currentData(), self._plan.spectral
        if kind in (COMB, COLOURS):
            # Whole steps per period, and room for a gap: only such combs can be reconstructed.
            period = max(round(self.period.value() / step), 2 + width // step) * step
            third = round(period / 3)
            shifts = (0, third, 2 * third) if kind == COLOURS else (0, 0, 0)
            spectral = LineComb(width_px=width, step_px=step, period_px=period, shifts_px=shifts)
        elif kind == LINES:
            spectral = ScanLines(width_px=width, step_px=step)
        self._tell(code=code_of(self.code.currentData()) or NoCode(), spectral=spectral)

    def _tell(self, **changes: object) -> None:
        self.plan_changed.emit(self._plan.model_copy(update={**changes, "name": CUSTOM}))


def _purpose_of(plan: CapturePlan) -> str:
    """What describes a plan that is not a preset."""
    if isinstance(plan.spectral, Columns):
        return f"{plan.spectral_count} designed patterns. {OWN_PURPOSE}"
    return OWN_PURPOSE


class SettingRows(QWidget):
    """Rows of exposure and drive level; emits ``changed`` with a tuple of `Setting` when edited."""

    changed = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._period_ms = 1.0
        self._settings: tuple[Setting, ...] = ()
        self._rows: list[tuple[NumberBox, NumberBox]] = []
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setVerticalSpacing(4)
        self._grid.setColumnStretch(0, 1)

    def set_settings(self, settings: tuple[Setting, ...], period_ms: float, longest_ms: float) -> None:
        """Show settings for a projector with this frame period and a camera with this longest exposure."""
        same = len(settings) == len(self._settings) and self._rows
        self._settings, self._period_ms = settings, period_ms
        if not same:
            self._build()
        for i, setting in enumerate(settings):
            exposure, level = self._rows[i]
            exposure.setSingleStep(period_ms)
            cycles = whole_cycles(setting.exposure_ms, period_ms)
            exposure.setToolTip(plain_tip(f"{cycles} LED cycles of {period_ms:.2f} ms. {_EXPOSURE_TIP}"))
            with quiet(exposure, level):
                # A plan of another rig is shown as it is, too.
                exposure.setMinimum(min(SHORTEST_MS, setting.exposure_ms))
                exposure.setMaximum(max(min(longest_ms, MOST_MS), setting.exposure_ms))
                exposure.setValue(setting.exposure_ms)
                level.setMinimum(min(LEAST_LEVEL, setting.level))
                level.setValue(setting.level)

    def _build(self) -> None:
        while (item := self._grid.takeAt(0)) is not None:
            widget = item.widget()
            if widget is not None:
                widget.hide()
                widget.deleteLater()
        self._rows = []
        self._grid.addWidget(label("Exposure", "muted"), 0, 0)
        self._grid.addWidget(label("Level", "muted"), 0, 1)
        for i in range(len(self._settings)):
            self._add_row(i)
        tip = "Capture all patterns at another exposure and level too, for brighter or darker parts"
        add = push_button("Add setting", tip, self._add)
        add.setEnabled(len(self._settings) < MOST_SETTINGS)
        self._grid.addWidget(add, len(self._settings) + 1, 0, 1, 3)
        tab_in_place(self)

    def _add_row(self, i: int) -> None:
        exposure = NumberBox(
            f"Exposure of setting {i + 1}", SHORTEST_MS, LONGEST_MS, 1, "ms", 1, _EXPOSURE_TIP
        )
        level = NumberBox(
            f"Level of setting {i + 1}",
            LEAST_LEVEL,
            1,
            1,
            decimals=3,
            tip="Drive level of lit columns, 0 to 1",
        )
        level.setSingleStep(0.05)
        remove = push_button("×", "Remove this setting from the plan", lambda: self._remove(i))
        remove.setFixedWidth(28)
        remove.setAccessibleName(f"Remove setting {i + 1}")
        remove.setEnabled(len(self._settings) > 1)
        exposure.valueChanged.connect(lambda shown_ms: self._expose(i, shown_ms))
        level.valueChanged.connect(lambda shown: self._edit(i, level=round(shown, 3)))
        for column, widget in enumerate((exposure, level, remove)):
            self._grid.addWidget(widget, i + 1, column)
        self._rows.append((exposure, level))

    def _expose(self, i: int, shown_ms: float) -> None:
        self._edit(i, exposure_ms=whole_cycles(shown_ms, self._period_ms) * self._period_ms)

    def _edit(self, i: int, **changes: float) -> None:
        """Change one figure of a setting: the other one may be shown rounded."""
        made = Setting.model_validate(self._settings[i].model_dump() | changes)
        self.changed.emit((*self._settings[:i], made, *self._settings[i + 1 :]))

    def _add(self) -> None:
        last = self._settings[-1]
        longer = Setting(exposure_ms=2 * last.exposure_ms, level=last.level)
        self.changed.emit((*self._settings, longer))

    def _remove(self, i: int) -> None:
        self.changed.emit((*self._settings[:i], *self._settings[i + 1 :]))
