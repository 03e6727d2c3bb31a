"""What a wizard decides: one calibration, one step after the other. No Qt."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

from dsl_app.calibrate.calibrate_all import products_text
from dsl_app.calibrate.campaign_status import Recipes
from dsl_app.calibrate.wizard.background_work import BackgroundWork, Captured, Opened
from dsl_app.calibrate.wizard.ghost import keeps_still
from dsl_app.calibrate.wizard.jobs import WizardJobs
from dsl_app.calibrate.wizard.settings import trouble_in_titles
from dsl_app.calibrate.wizard.state import Doing, Fit, Look, Seen, WizardState
from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link
from dsl_app.shared.jobs.base import JobRunner
from dsl_app.shared.notify import sentence_of
from dsl_core.campaign.products import Products
from dsl_core.devices.base import DeviceRig
from dsl_core.io.calibration_library import CalibrationLibrary

#: Under which name (None: not at all) and in which library the rig is kept; asked in a job.
Library = Callable[[], tuple[str | None, CalibrationLibrary]]
#: Pause between two looks, s.
LOOK_PAUSE_S = 0.8
CONNECTING = "Connecting the rig again…"


class WizardController:
    """Runs one calibration on the rig; `take_news` brings what happens in jobs to the state.

    ``library`` says under which name (None: not at all) and where a rig is kept that is now complete.
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
        self._recipes, self._library, self._clock = recipes, library, clock
        self._work: BackgroundWork | None = None
        self._jobs = WizardJobs(state, rig, runner)
        self._devices: DeviceRig | None = None
        self._looked_at = 0.0
        self._is_hands_free = False
        self._unfollow: Callable[[], None] = lambda: None

    # Open and leave --------------------------------------------------------------------------------

    def open(self, done: Callable[[], object], failed: Callable[[Exception], object]) -> None:
        """Read the calibration from disk."""
        devices = self._rig.state.devices.value
        assert devices is not None

        def opened(found: Opened) -> None:
            self._take(found)
            self._unfollow = self._rig.state.devices.changed.connect(self._follow_devices)
            # Without the picture nobody sees where the outline is that the target is to come to.
            self.state.is_checking.set(self.state.waits_for_person)
            done()

        self._attach(devices)
        self._jobs.start(Doing.OPENING, "Open", self._the_work.open, opened, failed=failed)

    def _attach(self, devices: DeviceRig) -> None:
        self._devices = devices
        self._work = BackgroundWork(self.state.name, self._path, devices, self._recipes)

    @property
    def _the_work(self) -> BackgroundWork:
        assert self._work is not None
        return self._work

    def _take(self, found: Opened) -> None:
        """Show what was read from disk, at the first page where something is to be done."""
        state = self.state
        state.places_itself.set(found.places_itself)
        state.outlines.set(found.outlines)
        state.keeps_frames = found.keeps_frames
        state.settings.set(found.settings)
        state.misfit.set(None)
        state.statuses.set(found.statuses)
        state.fit.set(found.fit)
        state.at.set(self._next_lacking)

    @property
    def _next_lacking(self) -> int:
        """The page of the first step without good captures, else that of the fit."""
        return next(iter(self.state.lacking), self.state.last)

    def leave(self) -> None:
        """Stop what runs and close; everything captured so far is kept."""
        self._unfollow()
        self._jobs.leave()

    def _follow_devices(self, devices: DeviceRig | None) -> None:
        """Continue with devices that were connected again."""
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
        """Open the rig again after a device was lost; why it is still lost is said where the person looks."""
        if self._jobs.is_free and self._rig.state.link.value is not Link.OPENING:
            self.state.note.set(CONNECTING)
            self._rig.reconnect(
                self._rig.state.choice.value, lambda: self.state.note.set(""), self._still_lost
            )

    def _still_lost(self, reason: str) -> None:
        self.state.note.set("")
        self.state.trouble.set(f"The rig could not be connected again: {reason}")

    # Move between pages ----------------------------------------------------------------------------

    def go_to(self, page: int) -> None:
        """Show a page: 0 the settings, then the steps, then the fit; checks follow to the new step."""
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
        # A captured step needs no look; at any other the person places the next target.
        is_captured = status is not None and status.state == "captured"
        needs_look = status is not None and not is_captured
        state.is_checking.set(needs_look and (was_checking or state.places_itself.value))
        if not state.is_checking.value:
            # What was seen of another step is not what this one's outline is for.
            state.seen.set(None)
        if is_captured:
            self._jobs.after_look(self._show_capture)

    def _show_capture(self) -> None:
        """Show what the camera saw when the step that is shown was captured."""
        status, work = self.state.status, self._the_work
        if status is None or status.state != "captured":
            return

        def read(seen: Seen | None) -> None:
            if self.state.status is not None and self.state.status.step.key == status.step.key:
                self.state.seen.set(seen)

        self._jobs.start(Doing.READING, "Read", lambda _: work.kept_picture(status.step), read)

    # Look ------------------------------------------------------------------------------------------

    def check(self, on: bool) -> None:
        """Look at the step repeatedly, beginning now, or stop that."""
        if self.state.status is not None:
            self.state.is_checking.set(on)
            self.state.is_awaited.set(True)
            self._look_if_due(self._clock() + LOOK_PAUSE_S)

    def take_news(self) -> None:
        """Bring frames and progress to the state and look again when it is time; called by a timer."""
        self._jobs.take_news()
        if self._work is not None:
            self._show_frame(self._work)
            self._look_if_due(self._clock())

    def _show_frame(self, work: BackgroundWork) -> None:
        seen = work.camera.take_seen()
        if seen is not None:
            self.state.seen.set(seen)

    def _look_if_due(self, now: float) -> None:
        status, work = self.state.status, self._the_work
        due = self.state.is_checking.value and self._jobs.is_free and now - self._looked_at >= LOOK_PAUSE_S
        if not due or status is None:
            return
        step = status.step
        self._jobs.start(Doing.LOOKING, f"Look at {step.title}", lambda p: work.look(step, p), self._looked)

    def _looked(self, look: Look) -> None:
        self._looked_at = self._clock()
        state, status, before = self.state, self.state.status, self.state.look.value
        if status is None or status.step.key != look.key:
            return
        state.look.set(look)
        if not look.is_in_place:
            # One that lies there already may have been left: with the film still on, for what is known.
            state.is_awaited.set(True)
        if before is not None and self._is_still_right(before, look):
            self._begin_capture(hands_free=True)

    def _is_still_right(self, before: Look, look: Look) -> bool:
        """Whether a person holds the target where it is wanted, and has since the look before."""
        is_right = look.is_good and look.is_in_place
        return self.state.will_capture_itself and is_right and keeps_still(before.points_px, look.points_px)

    def capture_itself(self, on: bool) -> None:
        """Whether a target that is right and still is captured without a click."""
        self.state.captures_itself.set(on)

    # Capture ---------------------------------------------------------------------------------------

    def capture(self) -> None:
        """Capture the step that is shown, or capture it again."""
        if self.state.doing.value is Doing.LOOKING:
            self.state.note.set("The capture starts as soon as the current look has ended.")
        self._begin_capture(hands_free=False)

    def _begin_capture(self, hands_free: bool) -> None:
        self._is_hands_free = hands_free
        wanted = self.state.status

        def capture() -> None:
            # A person may have moved on during the look: the target stands where the other step wants it.
            status = self.state.status
            if wanted is not None and status is not None and status.step.key == wanted.step.key:
                self._capture()

        self._jobs.after_look(capture)

    def capture_all(self) -> None:
        """Capture every step that lacks captures and fit, where the rig places targets itself."""
        if self.state.places_itself.value:
            self._is_hands_free = False
            self._jobs.after_look(self._continue_automatically)

    def _continue_automatically(self) -> None:
        state, page = self.state, self._next_lacking
        state.is_automatic.set(True)
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
        step, again, is_checked = status.step, status.state == "captured", self.state.is_automatic.value
        self.state.note.set("")
        self._jobs.start(
            Doing.CAPTURING,
            f"Capture {step.title}",
            lambda progress: work.capture(step, again, is_checked, progress),
            lambda found: self._captured(found, step.title),
        )

    def _captured(self, found: Captured, title: str) -> None:
        state, goes_on, look = self.state, self._is_hands_free, self.state.look.value
        state.statuses.set(found.statuses)
        if found.error is not None:
            self._jobs.fail(found.error)
            return
        if look is not None:
            state.covered.set((*state.covered.value, *look.points_px))
        state.fit.set(None)
        state.misfit.set(None)
        if state.is_automatic.value:
            self._continue_automatically()
            return
        following = next((page for page in state.lacking if page > state.at.value), None)
        left = len(state.lacking)
        self.go_to(following or self._next_lacking)
        if goes_on and state.waits_for_person:
            # Hands hold the target; the next outline waits for it.
            state.is_checking.set(True)
        state.note.set(
            f"{title} is captured. " + (f"{left} to go." if left else "All steps are captured: fit them.")
        )

    def stop(self) -> None:
        """Stop a capture or fit at its next safe point; frames captured so far are kept."""
        self._jobs.stop()

    # Fit and judge ---------------------------------------------------------------------------------

    def fit(self) -> None:
        """Calibrate from the captures of all steps."""
        work = self._the_work

        def failed(error: Exception) -> None:
            self._jobs.fail(error)
            self.state.misfit.set(work.session)

        self._jobs.after_look(
            lambda: self._jobs.start(Doing.FITTING, "Fit", work.fit, self._fitted, failed=failed)
        )

    def _fitted(self, fit: Fit) -> None:
        state = self.state
        state.misfit.set(None)
        state.fit.set(fit)
        state.at.set(state.last)
        state.note.set("")

    def accept(self) -> None:
        """Make the fit the campaign's calibration, and write the rig as far as it is calibrated."""
        work = self._the_work
        if self._has_candidate:
            self._jobs.start(Doing.KEEPING, "Accept", lambda progress: work.accept(), self._accepted)

    def _accepted(self, fit: Fit) -> None:
        state, work = self.state, self._the_work
        state.fit.set(fit)
        state.note.set(f"{state.title}: accepted.")

        def written(made: Products) -> None:
            state.note.set(f"{state.title}: accepted. {products_text(made)}")

        self._jobs.start(
            Doing.KEEPING, "Write the rig", lambda progress: work.write(*self._library()), written
        )

    def discard(self) -> None:
        """Discard the fit that waits; captures and the accepted calibration are kept."""
        work = self._the_work
        if self._has_candidate:
            self._jobs.start(
                Doing.KEEPING, "Discard the fit", lambda progress: work.discard(), self.state.fit.set
            )

    @property
    def _has_candidate(self) -> bool:
        fit = self.state.fit.value
        return fit is not None and not fit.is_accepted and self._jobs.is_free

    # Settings --------------------------------------------------------------------------------------

    def change_settings(self, values: Mapping[str, str], then_fit: bool = False) -> None:
        """Use other settings of the recipe, as texts; the others stay. They are kept when right."""

        def taken(found: Opened) -> None:
            at = self.state.at.value
            self.state.settings_trouble.set("")
            self._take(found)
            self.state.at.set(min(at, self.state.last))
            if then_fit:
                self.fit()

        def refused(error: Exception) -> None:
            self._jobs.forget_queued()
            self.state.settings_trouble.set(trouble_in_titles(sentence_of(error), self.state.name))
            if then_fit:
                self._jobs.fail(error)

        work = self._the_work
        self._jobs.after_look(
            lambda: self._jobs.start(
                Doing.OPENING, "Settings", lambda p: work.change(values, p), taken, failed=refused
            )
        )
