"""One calibration, step by step: what a wizard and the command line both drive.

The object holds nothing that is not on disk: captures are in the folders of their steps, a fit waits as a
candidate, accepted calibrations are files of the campaign. So a session can be dropped at any moment, and a
new one resumes where it stopped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

from dsl_core.campaign.assembly import (
    accepted_calibrations,
    apply_records,
    nominal_rig,
    record_of,
    require_needs,
    require_same_devices,
)
from dsl_core.campaign.common.captures import (
    CaptureNote,
    other_conditions,
    read_note,
    recover,
    replacing,
    scan_settings,
)
from dsl_core.campaign.common.recipe import AnyRecipe, Bench, Found, Step
from dsl_core.campaign.recipes import campaign_recipes
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.conditions import current_conditions
from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.campaign_folder import NOTE_NAME, CampaignFolder, later_than, now
from dsl_core.io.records import replace_record
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.figure import Figure
from dsl_core.progress import NoProgress, Progress

State = Literal["missing", "captured", "refused"]
#: What an accepted calibration states as well as the settings of its recipe.
ADDED_SETTINGS = ("rig", "exposures")


@dataclass(frozen=True)
class StepStatus:
    """The state of a step; ``reason`` says why its captures are refused, or which settings they lack."""

    step: Step
    state: State
    reason: str = ""


class CalibrationSession:
    """Drives one recipe on open devices in a campaign's folder."""

    def __init__(
        self,
        recipe: AnyRecipe,
        devices: DeviceRig,
        campaign: CampaignFolder,
        recipes: Sequence[AnyRecipe] | None = None,
    ) -> None:
        """``recipes`` are all calibrations in order, those of this installation if not given.

        Raises `CalibrationError` when a calibration that this one needs is missing from the campaign, when
        one before it was captured with other devices or settings, or when nothing is known of the rig.
        """
        self.recipe, self.devices, self.campaign = recipe, devices, campaign
        recipes = campaign_recipes(campaign) if recipes is None else recipes
        names = [each.name for each in recipes]
        before = recipes[: names.index(recipe.name)] if recipe.name in names else recipes
        accepted = accepted_calibrations(campaign, before)
        require_needs(recipe, accepted)
        require_same_devices(accepted, devices)
        self.based_on = {name: each.accepted for name, each in accepted.items()}
        rig = apply_records(accepted, nominal_rig(devices), before)
        self.bench = Bench(devices, campaign.home(recipe.name), rig)
        self._stood = self._standing()
        for step in self.steps:
            recover(self._folder(step))

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """The steps in their order."""
        return self.recipe.steps(self.bench)

    def statuses(self) -> tuple[StepStatus, ...]:
        """The state of every step, read from disk."""
        return tuple(self.status(step) for step in self.steps)

    def status(self, step: Step) -> StepStatus:
        """The state of a step, read from disk; damaged files are a reason to refuse it."""
        folder = self._folder(step)
        try:
            note = read_note(folder)
            if note is not None and note.refused:
                return StepStatus(step, "refused", note.refused)
            found = other_conditions(folder, current_conditions(self.devices))
            if found:
                reason = f"it was captured with other devices or settings: {'; '.join(found)}"
                return StepStatus(step, "refused", reason)
            state: State = "captured" if self.recipe.is_captured(self.bench, step) else "missing"
            return StepStatus(step, state, self._without(step, note))
        except StoreError as error:
            return StepStatus(step, "refused", str(error))

    def _without(self, step: Step, note: CaptureNote | None) -> str:
        """Which settings of today the captures of a step were made without; empty where there are none."""
        then = {} if note is None else note.settings
        now = self.recipe.acts_at_capture(step)
        other = [f"{name}={then[name]:g}" for name in now if then.get(name, now[name]) != now[name]]
        return (
            f"it was captured with {', '.join(other)}; other values act on new captures only" if other else ""
        )

    def place(self, step: Step) -> bool:
        """Let the rig place the target of a step; False when a person has to."""
        if self.devices.place is None:
            return False
        self.devices.place(step.placement)
        self._stood = self._standing()
        return True

    def _standing(self) -> str:
        return "" if self.devices.standing is None else self.devices.standing()

    def _place_again(self, step: Step) -> None:
        """A scan may have come since the target was placed, and have put back what was there before."""
        if self._stood != self._standing():
            self.place(step)

    def look(self, step: Step, found: Found | None = None) -> tuple[Figure, ...]:
        """Check with a few frames whether the target is right; nothing is kept.

        ``found`` is told where points of the target are, such as the corners of a board.
        """
        self._place_again(step)
        return self.recipe.look(self.bench if found is None else replace(self.bench, found=found), step)

    def capture(self, step: Step, progress: Progress | None = None) -> None:
        """Capture a step, or resume it; refused captures are replaced.

        Raises `CalibrationError` when the captures show that something is wrong: then the step is refused and
        says why, and all other steps are as they were. A fit that waits is forgotten.
        """
        if self.status(step).state == "refused":
            self.redo(step, progress)
            return
        self._capture(step, progress or NoProgress())

    def redo(self, step: Step, progress: Progress | None = None) -> None:
        """Capture a step again; the old captures go only when the new ones are complete."""
        with replacing(self._folder(step)):
            self._capture(step, progress or NoProgress())

    def _capture(self, step: Step, progress: Progress) -> None:
        folder = self._folder(step)
        note = read_note(folder) or CaptureNote(
            conditions=current_conditions(self.devices),
            started=now(),
            settings=self.recipe.acts_at_capture(step),
        )
        note = note.model_copy(update={"steps": len(self.steps)})
        replace_record(folder / NOTE_NAME, note)
        before = max(self._captured(), self._captured_before())
        self.campaign.discard(self.recipe.name)
        self._place_again(step)
        try:
            self.recipe.capture(self.bench, step, progress)
        except CalibrationError as error:
            replace_record(folder / NOTE_NAME, note.model_copy(update={"refused": str(error)}))
            raise
        if not self.recipe.is_captured(self.bench, step):
            raise CalibrationError(
                f"The step {step.title!r} is not complete yet. Capture it again to continue."
            )
        finished = later_than(before)
        replace_record(folder / NOTE_NAME, note.model_copy(update={"finished": finished, "refused": ""}))

    def fit(self, progress: Progress | None = None) -> AcceptedCalibration:
        """Calibrate from the captures of all steps; the outcome waits on disk to be accepted.

        Raises `CalibrationError` naming every step that is missing or refused, or what the recipe says.
        """
        self._require_captures()
        record = self.recipe.fit(self.bench, progress or NoProgress())
        fitted = AcceptedCalibration(
            name=self.recipe.name,
            title=self.recipe.title,
            captured=self._captured(),
            light=min(self._finished([s for s in self.steps if self.recipe.measures_light(s)]), default=""),
            conditions=current_conditions(self.devices),
            settings=self._settings(),
            based_on=self.based_on,
            figures=self.recipe.figures(record, self.based_on),
            record=record.model_dump(mode="json"),
        )
        self.campaign.propose(fitted)
        return fitted

    def candidate(self) -> AcceptedCalibration | None:
        """The fit that waits to be accepted; None without one."""
        return self.campaign.candidate(self.recipe.name)

    def record(self, of: AcceptedCalibration) -> Record:
        """The recipe's own record of a fit."""
        record: Record = record_of(self.recipe, of)
        return record

    def accept(self) -> AcceptedCalibration:
        """Make the fit that waits the campaign's calibration; raises `StoreError` without one."""
        return self.campaign.accept(self.recipe.name)

    def discard(self) -> None:
        """Forget the fit that waits; captures and the accepted calibration stay."""
        self.campaign.discard(self.recipe.name)

    def accepted(self) -> AcceptedCalibration | None:
        """The accepted calibration while it is good.

        It was fitted on those before it, with these settings and the files that they name, and from the
        captures that are there now.
        """
        found = self.campaign.accepted(self.recipe.name)
        if found is None or found.based_on != self.based_on or found.captured != self._captured():
            return None
        # What the session adds to the recipe's settings follows from captures, which are looked at elsewhere.
        own = {name: text for name, text in found.settings.items() if name not in ADDED_SETTINGS}
        same = own == self.campaign.info.settings.get(self.recipe.name, {})
        return found if same and self.recipe.is_current(found.record) else None

    def _folder(self, step: Step) -> Path:
        return self.bench.step_folder(step)

    def _captured(self) -> str:
        """When the newest captures were finished; empty where there are none, or it is not known."""
        try:
            return max(self._finished(self.steps), default="")
        except StoreError:
            return ""

    def _finished(self, steps: Sequence[Step]) -> list[str]:
        """When the captures of each of these steps were finished, as far as there are any."""
        notes = [read_note(self._folder(step)) for step in steps]
        return [note.finished for note in notes if note is not None]

    def _captured_before(self) -> str:
        """The same of what the accepted calibration was fitted to: a step that is redone is moved aside."""
        try:
            known = self.campaign.accepted(self.recipe.name)
        except StoreError:
            return ""
        return "" if known is None else known.captured

    def _require_captures(self) -> None:
        lacking = [each for each in self.statuses() if each.state != "captured"]
        if lacking:
            clauses = "; ".join(
                f"the step {each.step.title!r} "
                + (f"is refused ({each.reason})" if each.state == "refused" else "is not captured")
                for each in lacking
            )
            raise CalibrationError(
                f"{self.recipe.title} cannot be fitted yet: {clauses}. Capture them first."
            )

    def _settings(self) -> dict[str, str]:
        """Rig, its options, the recipe's settings and the exposures: what a repetition needs."""
        info = self.campaign.info
        rig = " ".join([info.rig, *(f"{key}={value}" for key, value in info.options.items())])
        exposures = ", ".join(scan_settings(self.bench.folder))
        added = dict(zip(ADDED_SETTINGS, (rig, exposures), strict=True))
        return info.settings.get(self.recipe.name, {}) | {name: text for name, text in added.items() if text}
