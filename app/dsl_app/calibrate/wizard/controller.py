"""What a wizard decides: one calibration, a step after the other. No Qt."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

from dsl_app.calibrate.wizard.jobs import WizardJobs
from dsl_app.calibrate.wizard.look import Looking
from dsl_app.calibrate.wizard.state import Doing, WizardState
from dsl_app.calibrate.wizard.verdict import Library, Verdict
from dsl_app.calibrate.wizard.work import Captured, Opened, Recipes, WizardWork
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link
from dsl_app.shared.jobs.base import JobRunner
from dsl_app.shared.notify import sentence_of
from dsl_core.devices.base import DeviceRig


class WizardController:
    """Runs one calibration on the rig; `take_news` brings what happens in jobs to the state.

    ``library`` says under which name (None: not) and where a rig is kept that is complete now.
    """

    def __init__(
        self,
        state: WizardState,
        path: Path,
        rig: RigController,
        runner: JobRunner,
        recipes: Recipes,
        library: Library,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.state, self._path, self._rig = state, path, rig
        self._recipes = recipes
        self._work: WizardWork | None = None
        self._jobs = WizardJobs(state, rig, runner)
        self._looking = Looking(state, self._jobs, clock)
        self._verdict = Verdict(state, self._jobs, library)
        self._devices: DeviceRig | None = None
        self._unfollow: Callable[[], None] = lambda: None

    # Open and leave --------------------------------------------------------------------------------

    def open(self, done: Callable[[], object], failed: Callable[[Exception], object]) -> None:
        """Read the calibration from disk."""
        devices = self._rig.state.devices.value
        assert devices is not None

        def opened(found: Opened) -> None:
            self._take(found)
            self._unfollow = self._rig.state.devices.changed.connect(self._follow_devices)
            done()

        self._attach(devices)
        self._jobs.start(Doing.OPENING, "Open", self._the_work.open, opened, failed=failed)

    def _attach(self, devices: DeviceRig) -> None:
        self._devices = devices
        self._work = WizardWork(self.state.name, self._path, devices, self._recipes)

    @property
    def _the_work(self) -> WizardWork:
        assert self._work is not None
        return self._work

    def _take(self, found: Opened) -> None:
        """Show what was read from disk, at the first page that wants something."""
        state = self.state
        state.places_itself.set(found.places_itself)
        state.settings.set(found.settings)
        state.misfit.set(None)
        state.statuses.set(found.statuses)
        state.fit.set(found.fit)
        is_new = all(each.state == "missing" for each in found.statuses)
        state.at.set(0 if is_new else next(iter(state.lacking), state.last))

    def leave(self) -> None:
        """End what runs and close; everything captured so far stays."""
        self._unfollow()
        self._jobs.leave()

    def _follow_devices(self, devices: DeviceRig | None) -> None:
        """Go on with devices that were connected anew."""
        if devices is None or devices is self._devices or not self._jobs.is_free:
            return
        self._attach(devices)
        self._jobs.start(Doing.OPENING, "Open", self._the_work.open, self._reopened)

    def _reopened(self, found: Opened) -> None:
        at = self.state.at.value
        self._take(found)
        self.state.at.set(at)
        self.state.can_reconnect.set(False)

    def reconnect(self) -> None:
        """Open the rig anew after a device was lost."""
        if self._jobs.is_free and self._rig.state.link.value is not Link.OPENING:
            self._rig.connect(self._rig.state.choice.value)

    # Go through the pages --------------------------------------------------------------------------

    def go_to(self, page: int) -> None:
        """Show a page; checks follow to the step that is shown."""
        state = self.state
        if state.doing.value is Doing.OPENING:
            # Settings are being read, which takes a moment; nobody should have to click twice.
            self._jobs.after_look(lambda: self.go_to(page))
            return
        if state.doing.value.is_long or not 0 <= page <= state.last or page == state.at.value:
            return
        was_checking = state.is_checking.value
        state.look.set(None)
        state.note.set("")
        state.at.set(page)
        status = state.status
        # A person who goes on wants to see the next target; what is captured needs no look.
        wanted = status is not None and status.state != "captured"
        state.is_checking.set(wanted and (was_checking or state.places_itself.value))

    def check(self, on: bool) -> None:
        """Look at the step again and again, or stop that."""
        self._looking.check(on, self._the_work)

    def take_news(self) -> None:
        """Bring frames and progress to the state and look again when it is time; called by a clock."""
        self._jobs.take_news()
        if self._work is not None:
            self._looking.take_news(self._work)

    # Capture ---------------------------------------------------------------------------------------

    def capture(self) -> None:
        """Capture the step that is shown, or capture it anew."""
        if self.state.doing.value is Doing.LOOKING:
            self.state.note.set("Captures as soon as the look at hand has ended.")
        self._jobs.after_look(self._capture)

    def capture_all(self) -> None:
        """Capture every step that lacks captures and fit, where the rig places targets itself."""
        if self.state.places_itself.value:
            self._jobs.after_look(self._go_on_automatically)

    def _go_on_automatically(self) -> None:
        state = self.state
        state.is_automatic.set(True)
        page = next(iter(state.lacking), state.last)
        state.look.set(None)
        state.at.set(page)
        if page == state.last:
            state.is_automatic.set(False)
            self.fit()
        else:
            self._capture()

    def _capture(self) -> None:
        status, work = self.state.status, self._the_work
        if status is None:
            return
        step, anew, is_checked = status.step, status.state == "captured", self.state.is_automatic.value
        self.state.note.set("")
        self._jobs.start(
            Doing.CAPTURING,
            f"Capture {step.title}",
            lambda progress: work.capture(step, anew, is_checked, progress),
            lambda found: self._captured(found, step.title),
        )

    def _captured(self, found: Captured, title: str) -> None:
        state = self.state
        state.statuses.set(found.statuses)
        if found.error is not None:
            self._jobs.fail(found.error)
            return
        state.fit.set(None)
        state.misfit.set(None)
        if state.is_automatic.value:
            self._go_on_automatically()
            return
        following = next((page for page in state.lacking if page > state.at.value), None)
        page = following or next(iter(state.lacking), state.last)
        left = len(state.lacking)
        self.go_to(page)
        state.note.set(
            f"{title} is captured. " + (f"{left} to go." if left else "All steps are captured: fit them.")
        )

    def stop(self) -> None:
        """Stop a capture or fit at its next safe point; frames taken so far stay."""
        self._jobs.stop()

    # Fit and judge ---------------------------------------------------------------------------------

    def fit(self) -> None:
        """Calibrate from the captures of all steps."""
        self._verdict.fit(self._the_work)

    def accept(self) -> None:
        """Let the fit be the campaign's calibration, and write down the rig as far as it is known."""
        self._verdict.accept(self._the_work)

    def discard(self) -> None:
        """Forget the fit that waits; captures and the accepted calibration stay."""
        self._verdict.discard(self._the_work)

    # Settings --------------------------------------------------------------------------------------

    def change_settings(self, values: Mapping[str, str], then_fit: bool = False) -> None:
        """Use other settings of the recipe, as texts; those not named stay. They are kept when right."""

        def taken(found: Opened) -> None:
            at = self.state.at.value
            self.state.settings_trouble.set("")
            self._take(found)
            self.state.at.set(min(at, self.state.last))
            if then_fit:
                self.fit()

        def refused(error: Exception) -> None:
            self._jobs.forget_queued()
            self.state.settings_trouble.set(sentence_of(error))
            if then_fit:
                self._jobs.fail(error)

        work = self._the_work
        self._jobs.after_look(
            lambda: self._jobs.start(
                Doing.OPENING,
                "Settings",
                lambda p: work.change(values, p),
                taken,
                failed=refused,
            )
        )
