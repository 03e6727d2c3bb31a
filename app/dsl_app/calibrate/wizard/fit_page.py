"""The fit: evidence, figures against their limits, and whether to accept it."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QCheckBox, QSplitter, QVBoxLayout, QWidget

from dsl_app.calibrate.evidence.base import Evidence, make_evidence
from dsl_app.calibrate.figures_table import FiguresTable
from dsl_app.calibrate.wizard.state import Doing, Fit, WizardState
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.deferred import call_deferred
from dsl_app.shared.widgets.forms import label, set_role
from dsl_core.campaign.session import CalibrationSession
from dsl_core.model.figure import failures


class FitPage(QWidget):
    """Follows the fit of a wizard; ``settings_wanted`` passes on what a person changed on the evidence."""

    settings_wanted = Signal(dict)
    #: Tells that the person allows, or no longer allows, figures outside their limits.
    allowed = Signal()

    def __init__(self, state: WizardState) -> None:
        super().__init__()
        self._state, self._theme = state, DARK
        self._shown: Fit | None = None
        self._evidence: Evidence | None = None
        self._due: Fit | None = None
        self.verdict = label("", "heading")
        self.verdict.setWordWrap(True)
        self.verdict.setAccessibleName("Verdict on the fit")
        self.figures = FiguresTable("Key figures of the fit")
        self.figures.setMinimumHeight(120)
        self.allow = QCheckBox("Accept although figures are outside their limits")
        self.allow.setToolTip("The report and the library keep showing these figures as missed")
        self.allow.toggled.connect(lambda _: self.allowed.emit())
        self._split = QSplitter(Qt.Orientation.Vertical)
        self._split.setChildrenCollapsible(False)
        self._split.addWidget(self.figures)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 0, 0, 0)
        column.addWidget(self.verdict)
        column.addWidget(self._split, 1)
        column.addWidget(self.allow)
        self.stops = [
            state.fit.follow(self._show_fit),
            state.misfit.follow(self._show_misfit),
            state.statuses.follow(lambda _: self._show_verdict()),
            state.doing.follow(lambda _: self._show_verdict()),
        ]

    @property
    def may_accept(self) -> bool:
        """Whether there is a fit to accept, and nothing speaks against it that nobody allowed."""
        fit = self._state.fit.value
        if fit is None or fit.is_accepted:
            return False
        return not failures(fit.fitted.figures) or self.allow.isChecked()

    def _show_fit(self, fit: Fit | None) -> None:
        if fit is not None and fit is not self._shown:
            self.figures.show_figures(fit.fitted.figures)
            self._due = fit
            if self.isVisible():
                self._show_due_soon()
        if fit is None or self._shown is None or fit.fitted.figures != self._shown.fitted.figures:
            self.allow.setChecked(False)
        self._shown = fit
        if fit is None:
            self._due = None
        for widget in (self._evidence, self.figures):
            if widget is not None:
                widget.setVisible(fit is not None)
        self._show_verdict()

    def showEvent(self, event: QShowEvent) -> None:
        """Make the evidence that waited for somebody to look: after the page itself, as it takes as long."""
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
            made.show_fit(fit.fitted, fit.record, fit.session)
            made.setVisible(True)

    @property
    def evidence(self) -> Evidence | None:
        """What the fit rests on; None while there is nothing to show."""
        self._show_due()
        return self._evidence

    def _show_misfit(self, session: CalibrationSession | None) -> None:
        """Show captures that no fit came of, where a look at them helps."""
        if session is None or self._state.fit.value is not None:
            return
        made = self._evidence or self._make_evidence()
        made.setVisible(made.show_captures(session))

    def _make_evidence(self) -> Evidence:
        self._evidence = made = make_evidence(self._state.name)
        made.apply_theme(self._theme)
        made.settings_wanted.connect(self.settings_wanted)
        made.setMinimumHeight(200)
        made.setEnabled(not self._state.doing.value.is_long)
        self._split.insertWidget(0, made)
        self._split.setStretchFactor(0, 3)
        self._split.setStretchFactor(1, 1)
        self._split.setSizes([420, 150])
        return made

    def _show_verdict(self) -> None:
        fit, doing = self._state.fit.value, self._state.doing.value
        self.allow.setVisible(fit is not None and not fit.is_accepted and bool(failures(fit.fitted.figures)))
        if self._evidence is not None:
            self._evidence.setEnabled(not doing.is_long)
        text, role = self._words(fit, doing)
        self.verdict.setText(text)
        set_role(self.verdict, role)

    def _words(self, fit: Fit | None, doing: Doing) -> tuple[str, str]:
        if doing is Doing.FITTING:
            return "Fitting…", "muted"
        if fit is None:
            lacking = self._state.lacking
            if not lacking:
                return "All steps are captured. Fit them to see how good they are.", "muted"
            titles = [self._state.statuses.value[page - 1].step.title for page in lacking]
            named = ", ".join(titles[:4]) + (f" and {len(titles) - 4} more" if len(titles) > 4 else "")
            return f"Not all steps are captured yet: {named}.", "warn"
        limited = [figure for figure in fit.fitted.figures if figure.limits]
        wrong = len(failures(fit.fitted.figures))
        count = f"{len(limited) - wrong} of {len(limited)} figures are within their limits."
        if fit.is_accepted:
            return f"✓ Accepted. {count}", "good" if not wrong else "warn"
        return (f"✓ {count} Accept the fit to use it.", "good") if not wrong else (f"✗ {count}", "bad")

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.figures.apply_theme(theme)
        if self._evidence is not None:
            self._evidence.apply_theme(theme)
