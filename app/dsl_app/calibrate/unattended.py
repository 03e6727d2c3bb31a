"""Beside a calibration of everything, where the rig places its targets itself and nobody is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dsl_core.campaign.common.recipe import Step
from dsl_core.campaign.session import CalibrationSession
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure, failures
from dsl_core.progress import Progress


@dataclass
class Unattended:
    """Goes on while everything is within limits, and stops with the reason where it is not.

    It is a `Guide`, and a `Progress` that names the calibration at hand.
    """

    progress: Progress
    title: str = ""

    def report(self, stage: str, done: int, total: int) -> None:
        """Pass a report on under the calibration's title."""
        self.progress.report(": ".join(filter(None, (self.title, stage))), done, total)

    def begins(self, session: CalibrationSession, missing: int) -> None:
        """Remember which calibration it is."""
        self.title = session.recipe.title

    def place(self, step: Step) -> None:
        """A person would have to; there is none."""
        raise CalibrationError(
            f"{step.title}: this rig cannot place its targets itself. Run the calibrations one by one."
        )

    def looked(self, step: Step, figures: Sequence[Figure]) -> bool:
        """Go on with a good look; raises `CalibrationError` for another."""
        wrong = failures(tuple(figures))
        if wrong:
            advice = " ".join(f"{figure}: {figure.advice}" for figure in wrong)
            raise CalibrationError(f"{self.title}, {step.title}: it does not look right. {advice}")
        return True

    def judge(self, fitted: AcceptedCalibration) -> bool:
        """Accept what is within its limits; raises `CalibrationError` for what is not."""
        wrong = failures(fitted.figures)
        if wrong:
            told = "; ".join(f"{figure} ({figure.limits}): {figure.advice}".rstrip(": ") for figure in wrong)
            raise CalibrationError(f"{fitted.title} is outside its limits: {told} Its wizard shows the fit.")
        return True
