"""What becomes of a wizard's captures: fit, judge, accept or discard. No Qt."""

from __future__ import annotations

from collections.abc import Callable

from dsl_app.calibrate.wizard.jobs import WizardJobs
from dsl_app.calibrate.wizard.state import Doing, Fit, WizardState
from dsl_app.calibrate.wizard.work import WizardWork
from dsl_core.campaign.products import Products
from dsl_core.io.calibration_library import CalibrationLibrary

#: Under which name, None for not at all, and in which library the rig is kept; asked in a job.
Library = Callable[[], tuple[str | None, CalibrationLibrary]]


class Verdict:
    """Fits all captures, and keeps or forgets what came of it.

    ``library`` says under which name (None: not) and where a rig is kept that is complete now.
    """

    def __init__(self, state: WizardState, jobs: WizardJobs, library: Library) -> None:
        self._state, self._jobs, self._library = state, jobs, library

    def fit(self, work: WizardWork) -> None:
        """Calibrate from the captures of all steps."""

        def failed(error: Exception) -> None:
            self._jobs.fail(error)
            self._state.misfit.set(work.session)

        self._jobs.after_look(
            lambda: self._jobs.start(Doing.FITTING, "Fit", work.fit, self._fitted, failed=failed)
        )

    def _fitted(self, fit: Fit) -> None:
        state = self._state
        state.misfit.set(None)
        state.fit.set(fit)
        state.at.set(state.last)
        state.note.set("")

    def accept(self, work: WizardWork) -> None:
        """Let the fit be the campaign's calibration, and write down the rig as far as it is known."""
        if self._waits:
            self._jobs.start(
                Doing.KEEPING, "Accept", lambda progress: work.accept(), lambda fit: self._accepted(fit, work)
            )

    def _accepted(self, fit: Fit, work: WizardWork) -> None:
        title = self._state.title
        self._state.fit.set(fit)
        self._state.note.set(f"{title} is accepted.")

        def written(made: Products) -> None:
            kept = f" In the library it is {made.entry!r}." if made.entry else ""
            self._state.note.set(f"{title} is accepted. The rig lies in {made.rig}.{kept}")

        self._jobs.start(
            Doing.KEEPING, "Write the rig", lambda progress: work.write(*self._library()), written
        )

    def discard(self, work: WizardWork) -> None:
        """Forget the fit that waits; captures and the accepted calibration stay."""
        if self._waits:
            self._jobs.start(
                Doing.KEEPING,
                "Discard the fit",
                lambda progress: work.discard(),
                lambda _: self._state.fit.set(None),
            )

    @property
    def _waits(self) -> bool:
        fit = self._state.fit.value
        return fit is not None and not fit.is_accepted and self._jobs.is_free
