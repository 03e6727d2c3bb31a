"""The fit: evidence, figures against their limits, and whether to accept it."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QCheckBox, QWidget

from dsl_app.calibrate.evidence.base import Evidence, make_evidence
from dsl_app.calibrate.figures_table import FiguresTable
from dsl_app.calibrate.wizard.presentation import fit_display
from dsl_app.calibrate.wizard.state import Fit, WizardState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.deferred import call_deferred
from dsl_app.shared.widgets.forms import label, quiet, set_role
from dsl_app.shared.widgets.inside import apply_theme_inside
from dsl_app.shared.widgets.layouts import column_of, splitter
from dsl_core.campaign.session import CalibrationSession

NO_FIT = (
    "A fit takes seconds to minutes and changes nothing yet. Its figures are listed here against their"
    " limits, below pictures of what they rest on; then you accept it, or redo a step."
)


class FitPage(QWidget):
    """Follows the fit of a wizard; ``settings_requested`` passes on what a person changed on the evidence."""

    settings_requested = Signal(dict)

    def __init__(self, state: WizardState) -> None:
        super().__init__()
        self._state, self._theme = state, DARK
        self._evidence: Evidence[Any] | None = None
        self._due: Fit | None = None
        self.verdict = label("", "heading", wraps=True)
        self.verdict.setAccessibleName("Verdict on the fit")
        self.figures = FiguresTable("Key figures of the fit")
        self.figures.setMinimumHeight(120)
        self.figures.empty_text = NO_FIT
        self.allow = QCheckBox("Accept although figures are outside their limits")
        self.allow.setToolTip("The report and the library continue to show that these figures are missed")
        self.allow.toggled.connect(self._allow)
        self._split = splitter(Qt.Orientation.Vertical, (self.figures, 0))
        column_of(self.verdict, (self._split, 1), self.allow, on=self, margins=(8, 0, 0, 0))
        self.stops = [
            state.fit.follow(self._show_fit),
            state.misfit.follow(self._show_misfit),
            *follow_any(self._show, state.statuses, state.doing, state.allowed),
        ]

    def _allow(self, on: bool) -> None:
        fit = self._state.fit.value
        self._state.allowed.set(fit.fitted.figures if on and fit is not None else ())

    def _show(self) -> None:
        shown = fit_display(self._state)
        self.verdict.setText(shown.verdict)
        set_role(self.verdict, shown.role)
        # A misfit has evidence of its own, which needs the room.
        self.figures.setVisible(shown.has_fit or self._state.misfit.value is None)
        self.allow.setVisible(shown.can_allow)
        with quiet(self.allow):
            self.allow.setChecked(shown.is_allowed)
        if self._evidence is not None:
            self._evidence.setEnabled(shown.can_edit)

    def _show_fit(self, fit: Fit | None) -> None:
        self._due = fit
        self.figures.show_figures(() if fit is None else fit.fitted.figures)
        if self._evidence is not None:
            self._evidence.setVisible(fit is not None)
        if fit is not None and self.isVisible():
            self._show_due_soon()
        self._show()

    def showEvent(self, event: QShowEvent) -> None:
        """Make the evidence that waited to be seen: after the page itself, as it takes as long."""
        super().showEvent(event)
        self._show_due_soon()

    def _show_due_soon(self) -> None:
        call_deferred(self, self._take_turn)

    def _take_turn(self) -> None:
        # Making evidence takes as long as filling it: a turn each.
        if self._due is not None and self._evidence is None:
            self._make_evidence()
            self._show_due_soon()
        else:
            self._show_due()

    def _show_due(self) -> None:
        fit, self._due = self._due, None
        if fit is not None:
            made = self._evidence or self._make_evidence()
            made.show_fit(fit)
            made.setVisible(True)

    @property
    def evidence(self) -> Evidence[Any] | None:
        """What the fit rests on; None while there is nothing to show."""
        self._show_due()
        return self._evidence

    def _show_misfit(self, session: CalibrationSession | None) -> None:
        """Show captures that gave no fit, where a look at them helps."""
        self._show()
        if session is None or self._state.fit.value is not None:
            return
        made = self._evidence or self._make_evidence()
        made.setVisible(made.show_captures(session))

    def _make_evidence(self) -> Evidence[Any]:
        self._evidence = made = make_evidence(self._state.name)
        made.apply_theme(self._theme)
        made.settings_requested.connect(self.settings_requested)
        made.setMinimumHeight(200)
        made.setEnabled(not self._state.doing.value.is_long)
        self._split.insertWidget(0, made)
        self._split.setStretchFactor(0, 3)
        self._split.setStretchFactor(1, 1)
        self._split.setSizes([420, 150])
        return made

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        apply_theme_inside(self, theme)
