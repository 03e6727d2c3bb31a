"""What a wizard's jobs do in their thread: open, look, capture, fit, accept. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dsl_app.calibrate.wizard.settings import changed_settings, setting_rows
from dsl_app.calibrate.wizard.state import Fit, Look, SettingRow
from dsl_app.calibrate.wizard.watched_camera import WatchedCamera
from dsl_core.campaign.common.recipe import Recipe, Step
from dsl_core.campaign.guide import calibrated_rig
from dsl_core.campaign.products import Products, write_products
from dsl_core.campaign.session import CalibrationSession, StepStatus
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError, Cancelled, DslError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.figure import failures
from dsl_core.progress import Progress

#: Makes all recipes of a campaign, in order.
Recipes = Callable[[CampaignFolder], Sequence[Recipe]]


@dataclass(frozen=True)
class Opened:
    """A calibration as it was found on disk."""

    title: str
    statuses: tuple[StepStatus, ...]
    settings: tuple[SettingRow, ...]
    fit: Fit | None
    places_itself: bool


@dataclass(frozen=True)
class Captured:
    """Where the steps stand after a capture; ``error`` is why it failed, None when it did not."""

    statuses: tuple[StepStatus, ...]
    error: Exception | None = None


class WizardWork:
    """One calibration on open devices; `open` comes first. Only one job at a time may use it."""

    def __init__(self, name: str, path: Path, devices: DeviceRig, recipes: Recipes) -> None:
        self._name, self._path, self._recipes = name, path, recipes
        self.camera = WatchedCamera(devices.camera)
        # A copy, so that the rig of the window keeps its own camera.
        self._devices = replace(devices, camera=self.camera)
        self._session: CalibrationSession | None = None
        self._all: Sequence[Recipe] = ()
        self._placed = ""

    @property
    def session(self) -> CalibrationSession:
        """The session that is open."""
        assert self._session is not None
        return self._session

    def open(self, progress: Progress) -> Opened:
        """Read the calibration from disk; raises `CalibrationError` and `StoreError`."""
        progress.report("read the campaign", 0, 0)
        return self._take(CampaignFolder.open(self._path))

    def change(self, values: Mapping[str, str], progress: Progress) -> Opened:
        """Read it anew with other settings, which the campaign keeps if they are right."""
        progress.report("read the campaign", 0, 0)
        campaign = CampaignFolder.open(self._path)
        wanted = self._recipe(self._recipes(campaign))
        rows = setting_rows(wanted, campaign.info.settings.get(self._name, {}))
        changed = campaign.with_settings(self._name, changed_settings(rows, values))
        opened = self._take(changed)
        changed.save()
        return opened

    def _take(self, campaign: CampaignFolder) -> Opened:
        everyone = self._recipes(campaign)
        recipe = self._recipe(everyone)
        session = CalibrationSession(recipe, self._devices, campaign, everyone)
        statuses = session.statuses()
        # Nothing is taken over before all of it has proved right.
        self._session, self._all = session, everyone
        settings = setting_rows(recipe, campaign.info.settings.get(self._name, {}))
        places = self._devices.place is not None
        return Opened(recipe.title, statuses, settings, self._found(), places)

    def _recipe(self, everyone: Sequence[Recipe]) -> Recipe:
        return next(recipe for recipe in everyone if recipe.name == self._name)

    def _found(self) -> Fit | None:
        """The fit that waits, else the accepted one that is good; None if its record cannot be read."""
        waits, accepted = self.session.candidate(), self.session.accepted()
        fitted = waits or accepted
        if fitted is None:
            return None
        try:
            return Fit(fitted, self.session.record(fitted), self.session, waits is None)
        except CalibrationError:
            return None

    def place(self, step: Step) -> None:
        """Let the rig place what it can by itself, once."""
        if self._placed != step.key:
            self._placed = ""
            self.session.place(step)
            self._placed = step.key

    def look(self, step: Step, progress: Progress) -> Look:
        """Look once; what keeps from measuring is part of the look, a lost device is not."""
        progress.report(step.title, 0, 0)
        self.place(step)
        try:
            return Look(step.key, self.session.look(step))
        except CalibrationError as error:
            return Look(step.key, (), str(error))

    def capture(self, step: Step, anew: bool, is_checked: bool, progress: Progress) -> Captured:
        """Capture a step, or capture it anew; ``is_checked`` looks first and refuses what is not right.

        Says where all steps stand, whatever happens; only `Cancelled` passes.
        """
        try:
            self.place(step)
            if is_checked:
                _require_good(step, self.look(step, progress))
            if anew:
                self.session.redo(step, progress)
            else:
                self.session.capture(step, progress)
        except Cancelled:
            raise
        except (DslError, OSError) as error:
            return Captured(self.session.statuses(), error)
        return Captured(self.session.statuses())

    def fit(self, progress: Progress) -> Fit:
        """Fit the captures of all steps."""
        fitted = self.session.fit(progress)
        return Fit(fitted, self.session.record(fitted), self.session)

    def accept(self) -> Fit:
        """Accept the fit that waits."""
        accepted = self.session.accept()
        return Fit(accepted, self.session.record(accepted), self.session, is_accepted=True)

    def write(self, library_name: str | None, library: CalibrationLibrary) -> Products:
        """Assemble the rig of everything accepted so far and write it with its report."""
        campaign = self.session.campaign
        rig = calibrated_rig(campaign, self._devices, library_name or "", self._all)
        return write_products(campaign, rig, library_name, recipes=self._all, library=library)

    def discard(self) -> None:
        """Forget the fit that waits."""
        self.session.discard()


def _require_good(step: Step, look: Look) -> None:
    if look.trouble:
        raise CalibrationError(look.trouble)
    wrong = failures(look.figures)
    if wrong:
        advice = " ".join(f"{figure}: {figure.advice}" for figure in wrong)
        raise CalibrationError(f"The step {step.title!r} does not look right: {advice}")
