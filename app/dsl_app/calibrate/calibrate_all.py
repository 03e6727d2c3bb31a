"""All calibrations in order, unattended, on a rig that places its targets itself. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dsl_app.calibrate.campaign_status import Kinds
from dsl_app.calibrate.state import CalibrateState
from dsl_app.connection.controller import RIG, RigController
from dsl_app.shared.jobs.base import Job
from dsl_core.campaign.common.recipe import Step
from dsl_core.campaign.guide import calibrate_all
from dsl_core.campaign.products import Products, write_products
from dsl_core.campaign.session import CalibrationSession
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, DslError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure, failures
from dsl_core.progress import Progress

#: Told how it ended: a sentence, and why it failed, None when it did not.
Ended = Callable[[str, Exception | None], object]
CANNOT_PLACE = "This rig cannot place its targets itself. Run the calibrations one by one."


class CalibrateAll:
    """Runs one campaign at a time; ``state.everything`` says where it is."""

    def __init__(
        self, state: CalibrateState, rig: RigController, kinds: Kinds, store: CalibrationLibrary, ended: Ended
    ) -> None:
        self._state, self._rig, self._kinds, self._store, self._told = state, rig, kinds, store, ended
        self._job: Job[Products] | None = None

    @property
    def is_running(self) -> bool:
        """Whether it is running."""
        return self._job is not None

    def run(self, path: Path, devices: DeviceRig, name: str) -> None:
        """Continue a campaign where it stopped; its rig is kept in the library under ``name``."""
        own = replace(devices)  # scans of a calibration must not change the rig of the window
        job = Job(
            "Calibrate everything",
            lambda progress: self._all(path, own, name, progress),
            lambda made: self._ended(f"Everything is calibrated. {products_text(made)}"),
            lambda error: self._ended("", error),
            lambda: self._ended("Stopped. Everything captured is kept; start again to continue."),
            exclusive=RIG,
        )
        self._job = job
        self._state.everything.set("starting")
        self._rig.run(job, lambda text: self._ended("", DslError(text)))

    def _all(self, path: Path, devices: DeviceRig, name: str, progress: Progress) -> Products:
        campaign = CampaignFolder.open(path)
        guide, recipes = UnattendedGuide(progress), self._kinds.recipes(campaign)
        rig = calibrate_all(campaign, devices, guide, guide, name, recipes)
        guide.title = "Report"
        guide.report("write", 0, 0)
        return write_products(campaign, rig, name, recipes=recipes, library=self._store)

    def cancel(self) -> None:
        """Stop at the next safe point; everything captured is kept."""
        if self._job is not None:
            self._job.cancel()
            self._state.everything.set("stopping")

    def take_news(self) -> None:
        """Update how far it is; called by the window's timer."""
        job = self._job
        if job is None or job.token.is_cancelled:
            return
        told = job.progress
        count = f", {told.done} of {told.total}" if told.total else ""
        self._state.everything.set(f"{told.stage or 'starting'}{count}")

    def _ended(self, note: str, error: Exception | None = None) -> None:
        self._job = None
        self._state.everything.set("")
        self._told(note, error)


@dataclass
class UnattendedGuide:
    """Continues while everything is within limits, and stops with the reason where it is not.

    It is a `Guide`, and a `Progress` that names the calibration that is running.
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
        """Raise `CalibrationError`: no person is there to place a target."""
        raise CalibrationError(f"{step.title}: {CANNOT_PLACE}")

    def looked(self, step: Step, figures: Sequence[Figure]) -> bool:
        """Accept a good look; raises `CalibrationError` for any other."""
        wrong = failures(tuple(figures))
        if wrong:
            advice = " ".join(f"{figure}: {figure.advice}" for figure in wrong)
            raise CalibrationError(f"{self.title}, {step.title}: it does not look right. {advice}")
        return True

    def judge(self, fitted: AcceptedCalibration) -> bool:
        """Accept a fit within its limits; raises `CalibrationError` for any other."""
        wrong = failures(fitted.figures)
        if wrong:
            told = "; ".join(f"{figure} ({figure.limits}): {figure.advice}".rstrip(": ") for figure in wrong)
            raise CalibrationError(f"{fitted.title} is outside its limits: {told} Its wizard shows the fit.")
        return True


def products_text(made: Products) -> str:
    """Where a rig and its report were saved."""
    kept = f" It is in the library as {made.entry!r}." if made.entry else ""
    return f"The rig is saved in {made.rig}, next to its report.{kept}"
