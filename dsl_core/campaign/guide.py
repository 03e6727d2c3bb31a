"""Running whole calibrations, with a guide that has targets placed and judges figures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Protocol

from dsl_core.campaign.assembly import accepted_calibrations, assemble, nominal_rig
from dsl_core.campaign.common.recipe import AnyRecipe, Step
from dsl_core.campaign.recipes import campaign_recipes
from dsl_core.campaign.session import CalibrationSession
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure, failures
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress


class Guide(Protocol):
    """Asks and informs a person while a calibration runs; may raise `Cancelled` to stop."""

    def begins(self, session: CalibrationSession, missing: int) -> None:
        """A calibration begins; ``missing`` of its steps have no captures yet."""

    def place(self, step: Step) -> None:
        """Return when a person has placed the target of a step; called where the rig cannot itself."""

    def looked(self, step: Step, figures: Sequence[Figure]) -> bool:
        """Whether to continue after a look; False for another look."""

    def judge(self, fitted: AcceptedCalibration) -> bool:
        """Whether to accept a fit; False ends with its figures named."""


@dataclass(frozen=True)
class Named:
    """Progress of one step, reported under its name."""

    progress: Progress
    name: str

    def report(self, stage: str, done: int, total: int) -> None:
        """Pass the report on."""
        self.progress.report(f"{self.name}: {stage}", done, total)


def run_calibration(
    session: CalibrationSession, guide: Guide, progress: Progress, redo: Sequence[str] = ()
) -> AcceptedCalibration:
    """Capture every missing or refused step, fit, and accept what the guide accepts.

    ``redo`` names steps that are captured again. What is captured already is kept, and a calibration that is
    complete and up to date is returned as it is. Raises `CalibrationError` when a look, a capture or a
    figure is not good enough; everything captured so far stays.
    """
    unknown = [key for key in redo if key not in [step.key for step in session.steps]]
    if unknown:
        known = ", ".join(step.key for step in session.steps)
        raise CalibrationError(f"{session.recipe.name} has no step {', '.join(unknown)}; it has {known}.")
    statuses = session.statuses()
    todo = [each.step for each in statuses if each.state != "captured" or each.step.key in redo]
    done = session.accepted()
    if done is not None and not todo:
        return done
    guide.begins(session, len(todo))
    for step in todo:
        _take(session, step, guide, Named(progress, step.title), step.key in redo)
    fitted = session.fit(Named(progress, session.recipe.title))
    if not guide.judge(fitted):
        raise CalibrationError(not_accepted(fitted))
    return session.accept()


def calibrate_all(
    campaign: CampaignFolder,
    devices: DeviceRig,
    guide: Guide,
    progress: Progress,
    name: str = "",
    recipes: Sequence[AnyRecipe] | None = None,
    stage: Callable[[str], AbstractContextManager[None]] | None = None,
) -> Rig:
    """Run every calibration in order and assemble the rig; resumes where it was interrupted.

    ``recipes`` are all calibrations, those of this installation if not given; ``stage`` surrounds each one
    under its title, to measure it. What is `omitted` of this rig is not run. However it ends, a rig that
    places targets puts back what was there.
    """
    recipes = campaign_recipes(campaign) if recipes is None else recipes
    without = omitted(recipes, devices)
    try:
        for recipe in (each for each in recipes if each.name not in without):
            with stage(recipe.title) if stage else nullcontext():
                run_calibration(CalibrationSession(recipe, devices, campaign, recipes), guide, progress)
    finally:
        if devices.put_back is not None:
            devices.put_back()
    return calibrated_rig(campaign, devices, name, recipes)


def omitted(recipes: Sequence[AnyRecipe], devices: DeviceRig) -> dict[str, str]:
    """The calibrations, by name, that all of a rig go without, and a sentence with the reason of each.

    Raises `CalibrationError` when nothing is known of the rig.
    """
    rig = nominal_rig(devices)
    reasons = {recipe.name: recipe.reason_to_omit(rig) for recipe in recipes}
    return {name: reason for name, reason in reasons.items() if reason}


def calibrated_rig(
    campaign: CampaignFolder, devices: DeviceRig, name: str = "", recipes: Sequence[AnyRecipe] | None = None
) -> Rig:
    """The rig as far as a campaign has calibrated it; raises `CalibrationError` when nothing is accepted."""
    recipes = campaign_recipes(campaign) if recipes is None else recipes
    accepted = accepted_calibrations(campaign, recipes)
    return assemble(accepted, nominal_rig(devices), recipes, name or campaign.path.name)


def _take(session: CalibrationSession, step: Step, guide: Guide, progress: Progress, again: bool) -> None:
    if not session.place(step):
        guide.place(step)
    while not guide.looked(step, session.look(step)):
        continue
    if again:
        session.redo(step, progress)
    else:
        session.capture(step, progress)


def not_accepted(fitted: AcceptedCalibration, kept: bool = True) -> str:
    """Why a fit was not accepted, with what its figures advise."""
    clauses = "; ".join(f"{figure}. {figure.advice}".rstrip(". ") for figure in failures(fitted.figures))
    why = f"{fitted.title} was not accepted: {clauses or 'you rejected it'}."
    return f"{why} The captures are kept." if kept else why
