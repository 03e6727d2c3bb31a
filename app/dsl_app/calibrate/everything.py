"""All calibrations in order, unattended, on a rig that places its targets itself. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from dsl_app.calibrate.campaign import Kinds
from dsl_app.calibrate.state import CalibrateState
from dsl_app.calibrate.unattended import Unattended
from dsl_app.connection.controller import RIG, RigController
from dsl_app.shared.jobs.base import Job
from dsl_core.campaign.guide import calibrate_all
from dsl_core.campaign.products import Products, write_products
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DslError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.progress import Progress

#: Told how it ended: a sentence, and why it failed, None when it did not.
Ended = Callable[[str, Exception | None], object]


class Everything:
    """Runs one campaign at a time; ``state.everything`` says where it is."""

    def __init__(
        self, state: CalibrateState, rig: RigController, kinds: Kinds, store: CalibrationLibrary, ended: Ended
    ) -> None:
        self._state, self._rig, self._kinds, self._store, self._told = state, rig, kinds, store, ended
        self._job: Job[Products] | None = None

    @property
    def is_running(self) -> bool:
        """Whether it is at work."""
        return self._job is not None

    def run(self, path: Path, devices: DeviceRig, name: str) -> None:
        """Go on where a campaign stood; its rig gets a name in the library."""
        own = replace(devices)  # scans of a calibration must not change the rig of the window
        job = Job(
            "Calibrate everything",
            lambda progress: self._all(path, own, name, progress),
            lambda made: self._ended(f"Everything is calibrated. {words_of(made)}"),
            lambda error: self._ended("", error),
            lambda: self._ended("Stopped. Everything captured is kept; start again to go on."),
            exclusive=RIG,
        )
        self._job = job
        self._state.everything.set("starting")
        self._rig.run(job, lambda text: self._ended("", DslError(text)))

    def _all(self, path: Path, devices: DeviceRig, name: str, progress: Progress) -> Products:
        campaign = CampaignFolder.open(path)
        guide, recipes = Unattended(progress), self._kinds.recipes(campaign)
        rig = calibrate_all(campaign, devices, guide, guide, name, recipes)
        guide.title = "Report"
        guide.report("write", 0, 0)
        return write_products(campaign, rig, name, recipes=recipes, library=self._store)

    def cancel(self) -> None:
        """Stop at the next safe point; everything captured stays."""
        if self._job is not None:
            self._job.cancel()
            self._state.everything.set("stopping")

    def take_news(self) -> None:
        """Say how far it is; called by the window's clock."""
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


def words_of(made: Products) -> str:
    """Where a rig and its report lie."""
    kept = f" It is in the library as {made.entry!r}." if made.entry else ""
    return f"The rig lies in {made.rig}, its report in {made.report}.{kept}"
