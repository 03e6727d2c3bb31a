"""The settings of a plan: exposure in whole LED cycles and drive level, a row each."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QGridLayout, QPushButton, QWidget

from dsl_app.shared.widgets.forms import NumberBox, label
from dsl_core.model.plan import Setting
from dsl_core.model.presets import whole_cycles

MOST = 4
LONGEST_MS = 30_000.0
_TIP = "Exposures are whole LED cycles, so that each holds all of the projector's coloured light."


class SettingRows(QWidget):
    """Emits ``changed`` with a tuple of `Setting` when a person edits it."""

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

    def set_settings(self, settings: tuple[Setting, ...], period_ms: float) -> None:
        """Show settings for a projector of this frame period."""
        same = len(settings) == len(self._settings) and self._rows
        self._settings, self._period_ms = settings, period_ms
        if not same:
            self._build()
        for i, setting in enumerate(settings):
            exposure, level = self._rows[i]
            exposure.setSingleStep(period_ms)
            cycles = whole_cycles(setting.exposure_ms, period_ms)
            exposure.setToolTip(f"{cycles} LED cycles of {period_ms:.2f} ms. {_TIP}")
            for box, value in ((exposure, setting.exposure_ms), (level, setting.level)):
                box.blockSignals(True)
                box.setValue(value)
                box.blockSignals(False)

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
        add = QPushButton("Add setting")
        add.setToolTip("Another exposure and drive level of every pattern, for brighter or darker parts")
        add.setEnabled(len(self._settings) < MOST)
        add.clicked.connect(self._add)
        self._grid.addWidget(add, len(self._settings) + 1, 0, 1, 3)

    def _add_row(self, i: int) -> None:
        exposure = NumberBox(f"Exposure of setting {i + 1}", 0.1, LONGEST_MS, 1, "ms", 1, _TIP)
        level = NumberBox(
            f"Level of setting {i + 1}", 0.01, 1, 1, decimals=2, tip="Drive level of lit columns, 0 to 1"
        )
        level.setSingleStep(0.05)
        remove = QPushButton("×")
        remove.setFixedWidth(28)
        remove.setAccessibleName(f"Remove setting {i + 1}")
        remove.setToolTip("Take this setting out of the plan")
        remove.setEnabled(len(self._settings) > 1)
        remove.clicked.connect(lambda: self._remove(i))
        exposure.valueChanged.connect(lambda _: self._edited(i))
        level.valueChanged.connect(lambda _: self._edited(i))
        for column, widget in enumerate((exposure, level, remove)):
            self._grid.addWidget(widget, i + 1, column)
        self._rows.append((exposure, level))

    def _edited(self, i: int) -> None:
        exposure, level = self._rows[i]
        cycles = whole_cycles(exposure.value(), self._period_ms)
        made = Setting(exposure_ms=cycles * self._period_ms, level=round(level.value(), 2))
        self.changed.emit((*self._settings[:i], made, *self._settings[i + 1 :]))

    def _add(self) -> None:
        last = self._settings[-1]
        longer = Setting(exposure_ms=2 * last.exposure_ms, level=last.level)
        self.changed.emit((*self._settings, longer))

    def _remove(self, i: int) -> None:
        self.changed.emit((*self._settings[:i], *self._settings[i + 1 :]))
