"""The Effects tab: what each effect of light changes and costs, and why it is on or off."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QPushButton, QTableWidgetItem, QWidget

from dsl_app.scan.effects.controller import EffectsController
from dsl_app.scan.effects.state import EffectChoice, EffectsState, EffectsView
from dsl_app.shared.evented import follow_any
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, label, quiet
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from dsl_core.simulation.effects.tolerance import ONE_DN, Tolerance

if TYPE_CHECKING:
    from dsl_core.simulation.effects.planner import Decision

_COLUMNS = ("Effect", "At most", "In σ", "Per frame", "Why")
_CHOICES = (
    (EffectChoice.USUAL, "Default", "the effects of the plain renderer"),
    (
        EffectChoice.AUTO,
        "Auto",
        "what the scene calls for; the others change no pixel by more than the tolerance",
    ),
    (EffectChoice.ALL, "All", "including the expensive ones"),
    (EffectChoice.NONE, "None", "only those that cannot be left out"),
    (EffectChoice.CHOSEN, "Custom", "the effects ticked below"),
)
#: Signs and names of the units of a tolerance.
_UNITS = (("DN", "DN"), ("σ", "sigma"))


class EffectsPanel(QWidget):
    """Shows an `EffectsState` and calls its controller."""

    def __init__(self, state: EffectsState, controller: EffectsController) -> None:
        super().__init__()
        self._state, self._controller = state, controller
        self.choice = ChoiceBox("Effects", "Which effects of light the simulated rig renders")
        for wanted, title, what in _CHOICES:
            self.choice.addItem(title, wanted.value)
            self.choice.setItemData(
                self.choice.count() - 1, plain_tip(f"{title}: {what}"), Qt.ItemDataRole.ToolTipRole
            )
        self.tolerance = NumberBox(
            "Tolerance",
            0.001,
            1000,
            ONE_DN.value,
            decimals=3,
            tip="Effects left out change no pixel of any picture by more than this",
        )
        tip = "Counts, or standard deviations of a dark pixel"
        self.unit = ChoiceBox("Unit of the tolerance", tip, _UNITS)
        self._within = label("within", "muted")
        self.apply = QPushButton("Apply")
        self.apply.setToolTip("Reconnect the simulated rig with these effects; its scans record them")
        tip = "Tick effects to choose them by name"
        self.table = ReadTable("Effects of the simulated rig", tip, _COLUMNS)
        self.table.wrap(len(_COLUMNS) - 1)
        self._summary, self._saved = label("", wraps=True), label("", "muted", wraps=True)
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        row = row_of(self.choice, self._within, self.tolerance, self.unit, STRETCH, self.apply)
        column_of(row, (self.table, 1), self._summary, self._saved, on=self, margins=(0, 6, 0, 0))

    def _connect(self) -> None:
        state = self._state
        self.choice.currentIndexChanged.connect(lambda _: self._look())
        self.tolerance.valueChanged.connect(lambda _: self._look())
        self.unit.currentIndexChanged.connect(lambda _: self._look())
        self.table.itemChanged.connect(self._ticked)
        self.apply.clicked.connect(lambda: self._controller.apply(self._wanted(), self._chosen_tolerance()))
        self.stops = [
            *follow_any(self._show_in_use, state.in_use, state.tolerance),
            state.view.follow(self._show),
            state.busy.follow(lambda _: self._show_state()),
        ]

    def showEvent(self, event: QShowEvent) -> None:
        """Weigh the effects when the tab is shown."""
        super().showEvent(event)
        self._controller.look_again()

    # Ask -------------------------------------------------------------------------------------------

    def _wanted(self) -> str:
        """The choice in command-line form."""
        kind = str(self.choice.currentData())
        if kind != EffectChoice.CHOSEN.value:
            return kind
        items = (self.table.item(i, 0) for i in range(self.table.rowCount()))
        ticked = Qt.CheckState.Checked
        return ",".join(each.text() for each in items if each is not None and each.checkState() is ticked)

    def _chosen_tolerance(self) -> Tolerance:
        return Tolerance(self.tolerance.value(), str(self.unit.currentData()))

    def _look(self) -> None:
        if self.isVisible():
            self._controller.look(self._wanted(), self._chosen_tolerance())
        self._show_state()

    def _ticked(self, item: QTableWidgetItem) -> None:
        """Switch to a custom choice as soon as an effect is ticked."""
        if item.column() == 0:
            index = self.choice.findData(EffectChoice.CHOSEN.value)
            if self.choice.currentIndex() == index:
                self._look()
            else:
                self.choice.setCurrentIndex(index)

    # Show ------------------------------------------------------------------------------------------

    def _show_in_use(self) -> None:
        """Show what the rig renders now."""
        named = [wanted.value for wanted in EffectChoice]
        kind = self._state.in_use.value if self._state.in_use.value in named else EffectChoice.CHOSEN.value
        tolerance = self._state.tolerance.value
        with quiet(self.choice, self.tolerance, self.unit):
            self.choice.choose(kind)
            self.tolerance.setValue(tolerance.value)
            self.unit.choose(tolerance.unit)
        if self.isVisible():
            self._controller.look_again()
        self._show_state()

    def _show(self, view: EffectsView | None) -> None:
        rows = () if view is None else view.plan.decisions
        with quiet(self.table):
            self.table.show_rows([self._cells(row) for row in rows])
        self._show_state()

    def _cells(self, row: Decision) -> tuple[QTableWidgetItem, ...]:
        role = "text" if row.on else "muted"
        first = cell(row.effect.name, role)
        first.setToolTip(plain_tip(row.effect.summary))
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        first.setFlags(flags if row.effect.needed else flags | Qt.ItemFlag.ItemIsUserCheckable)
        first.setCheckState(Qt.CheckState.Checked if row.on else Qt.CheckState.Unchecked)
        cost = f"{1e3 * row.cost_s:.1f} ms" if row.cost_s else "–"
        numbers = tuple(
            cell(text, role, RIGHT)
            for text in (f"{number(row.bound.dn)} DN", f"{number(row.bound.sigmas)} σ", cost)
        )
        return (first, *numbers, cell(row.why, role))

    def _show_state(self) -> None:
        state, view = self._state, self._state.view.value
        is_auto = self.choice.currentData() == EffectChoice.AUTO.value
        for widget in (self._within, self.tolerance, self.unit):
            widget.setVisible(is_auto)
        self.apply.setEnabled(
            view is not None
            and not state.busy.value
            and (
                self._wanted() != state.in_use.value
                or (is_auto and self._chosen_tolerance() != state.tolerance.value)
            )
        )
        if view is None:
            self._summary.setText("Weighing…" if state.busy.value else "")
            self._saved.setText("")
            return
        self._summary.setText(view.summary)
        self._saved.setText(view.saved)


def number(value: float) -> str:
    """Three digits, without an exponent where it is large.

    >>> number(0.6667), number(94731.2)
    ('0.667', '94731')
    """
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
