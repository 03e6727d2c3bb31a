"""All calibrations in order, unattended, on a rig that places its targets itself. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from dsl_app.calibrate.campaign_status import Kinds
from dsl_app.calibrate.overall import LEAST_SHARE, Overall
from dsl_app.calibrate.state import CalibrateState
from dsl_app.calibrate.wizard.background_work import WatchedCamera
from dsl_app.connection.controller import RIG, RigController
from dsl_app.shared.jobs.base import Job
from dsl_app.shared.notify import describe_seconds
from dsl_core.campaign.assembly import nominal_rig
from dsl_core.campaign.common.recipe import AnyRecipe, Bench, Step
from dsl_core.campaign.guide import calibrate_all, omitted
from dsl_core.campaign.products import Products, write_products
from dsl_core.campaign.session import CalibrationSession
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, DslError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure, failures
from dsl_core.progress import Progress

#: Told how it ended: a sentence, why it failed (None: it did not), and the calibration it was at, if any.
Ended = Callable[[str, Exception | None, str], object]
CANNOT_PLACE = "This rig cannot place its targets itself. Run the calibrations one by one."


class CalibrateAll:
    """Runs one campaign at a time; ``state.everything`` says where it is.

    ``begins`` is called when the next calibration begins: the one before it is accepted by then.
    """

    def __init__(
        self,
        state: CalibrateState,
        rig: RigController,
        kinds: Kinds,
        store: CalibrationLibrary,
        ended: Ended,
        begins: Callable[[], object],
    ) -> None:
        self._state, self._rig, self._kinds, self._store, self._told = state, rig, kinds, store, ended
        self._begins = begins
        self._job: Job[Products] | None = None
        self._camera: WatchedCamera | None = None
        self._overall = Overall({})
        self._shown = ""
        self._omitted: dict[str, str] = {}

    @property
    def is_running(self) -> bool:
        """Whether it is running."""
        return self._job is not None

    def run(self, path: Path, devices: DeviceRig, name: str) -> None:
        """Continue a campaign where it stopped; its rig is kept in the library under ``name``."""
        self._camera = WatchedCamera(devices.camera)
        # Scans of a calibration must not change the rig of the window.
        own = replace(devices, camera=self._camera)
        self._overall, self._shown, self._omitted = Overall({}), "", {}
        job = Job(
            "Calibrate everything",
            lambda progress: self._all(path, own, name, progress),
            lambda made: self._ended(self._outcome(made)),
            lambda error: self._ended("", error),
            lambda: self._ended("Stopped. Everything captured is kept; start again to continue."),
            exclusive=RIG,
            time_left=lambda: self._overall.left_s(),
            share=lambda: self._overall.share,
        )
        self._job = job
        self._state.everything.set("starting")
        self._rig.run(job, lambda text: self._ended("", DslError(text)))

    def _all(self, path: Path, devices: DeviceRig, name: str, progress: Progress) -> Products:
        campaign = CampaignFolder.open(path)
        recipes = self._kinds.recipes(campaign)
        progress.report("prepare", 0, 0)
        self._omitted = omitted(recipes, devices)
        run = [recipe for recipe in recipes if recipe.name not in self._omitted]
        self._overall = Overall({recipe.name: _parts(recipe, devices, campaign) for recipe in run})
        guide = UnattendedGuide(progress, overall=self._overall)
        rig = calibrate_all(campaign, devices, guide, guide, name, recipes)
        guide.title = "Report"
        guide.report("write", 0, 0)
        return write_products(campaign, rig, name, recipes=recipes, library=self._store)

    def _outcome(self, made: Products) -> str:
        return " ".join(["Everything is calibrated.", products_text(made), *self._omitted.values()])

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
        told, overall = job.progress, self._overall
        count = f", {told.done} of {told.total}" if told.total else ""
        left = overall.left_s()
        rest = "" if left is None else f"  ·  about {describe_seconds(left)} left for everything"
        if overall.is_early:
            rest = f"  ·  the time left is told once {100 * LEAST_SHARE:.0f} % of everything is done"
        self._state.running.set(overall.name)
        self._state.everything.set(f"{told.stage or 'starting'}{count}{rest}")
        seen = None if self._camera is None else self._camera.take_seen()
        if seen is not None:
            self._state.seen.set(seen)
        if overall.name and overall.name != self._shown:
            # The one before it has been accepted and written by now.
            self._shown = overall.name
            self._begins()

    def _ended(self, note: str, error: Exception | None = None) -> None:
        self._job = self._camera = None
        self._state.running.set("")
        self._state.everything.set("")
        self._state.seen.set(None)
        self._told(note, error, self._overall.name)


@dataclass
class UnattendedGuide:
    """Continues while everything is within limits, and stops with the reason where it is not.

    It is a `Guide`, and a `Progress` that names the calibration that is running.
    """

    progress: Progress
    title: str = ""
    overall: Overall = field(default_factory=lambda: Overall({}))
    _is_fitting: bool = False

    def report(self, stage: str, done: int, total: int) -> None:
        """Pass a report on under the calibration's title."""
        if stage.startswith(f"{self.title}:") and not self._is_fitting:
            # The fit reports under the calibration's own title.
            self._is_fitting = True
            self.overall.next_part()
        self.overall.report(done, total)
        self.progress.report(_told_once(self.title, stage), done, total)

    def begins(self, session: CalibrationSession, missing: int) -> None:
        """Remember which calibration it is."""
        self.title, self._is_fitting = session.recipe.title, False
        self.overall.begins(session.recipe.name, missing)
        # Else its row would show the last that was told of the one before.
        self.progress.report(self.title, 0, 0)

    def place(self, step: Step) -> None:
        """Raise `CalibrationError`: no person is there to place a target."""
        raise CalibrationError(f"{step.title}: {CANNOT_PLACE}")

    def looked(self, step: Step, figures: Sequence[Figure]) -> bool:
        """Accept a good look; raises `CalibrationError` for any other."""
        wrong = failures(tuple(figures))
        if wrong:
            advice = " ".join(f"{figure}: {figure.advice}" for figure in wrong)
            raise CalibrationError(f"{self.title}, {step.title}: it does not look right. {advice}")
        self.overall.next_part()
        return True

    def judge(self, fitted: AcceptedCalibration) -> bool:
        """Accept a fit within its limits; raises `CalibrationError` for any other."""
        wrong = failures(fitted.figures)
        if wrong:
            told = "; ".join(f"{figure} ({figure.limits}): {figure.advice}".rstrip(": ") for figure in wrong)
            raise CalibrationError(f"{fitted.title} is outside its limits: {told} Its wizard shows the fit.")
        self.overall.ends()
        return True


def _told_once(title: str, stage: str) -> str:
    """A stage under the title of its calibration, in which no name follows itself.

    >>> _told_once("Self-test", "Self-test: self-test"), _told_once("Geometry", "pose 1: capture")
    ('Self-test', 'Geometry: pose 1: capture')
    """
    parts = [part for part in (title, *stage.split(": ")) if part]
    before = ["", *parts]
    return ": ".join(
        part for part, last in zip(parts, before, strict=False) if part.casefold() != last.casefold()
    )


def _parts(recipe: AnyRecipe, devices: DeviceRig, campaign: CampaignFolder) -> int:
    """The steps of a calibration, as far as the nominal rig tells them, and its fit."""
    try:
        return len(recipe.steps(Bench(devices, campaign.home(recipe.name), nominal_rig(devices)))) + 1
    except DslError:
        # It says what is wrong when its turn comes.
        return 2


def products_text(made: Products) -> str:
    """Where a rig and its report were saved, and in what the rig is unlike the usual."""
    kept = f" It is in the library as {made.entry!r}." if made.entry else ""
    return f"The rig is saved in {made.rig}, next to its report.{kept} {made.traits}".rstrip()
