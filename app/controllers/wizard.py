"""What a wizard decides: one calibration, a step after the other. No Qt."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path

from app.controllers.rig import RigController
from app.controllers.scan_facts import sentence_of
from app.controllers.wizard_jobs import WizardJobs
from app.controllers.wizard_work import Captured, Opened, Recipes, WizardWork
from app.jobs.base import JobRunner
from app.state.rig import Link
from app.state.wizard import Doing, Fit, Look, Seen, WizardState
from dsl_core.campaign.products import Products
from dsl_core.capture.preview import quick_picture, statistics
from dsl_core.devices.base import DeviceRig
from dsl_core.io.calibration_library import CalibrationLibrary

#: Under which name, None for not at all, and in which library the rig is kept; asked in a job.
Library = Callable[[], tuple[str | None, CalibrationLibrary]]
#: Pause between two looks, s.
LOOK_PAUSE_S = 0.8


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
        self._recipes, self._library, self._clock = recipes, library, clock
        self._work: WizardWork | None = None
        self._jobs = WizardJobs(state, rig, runner)
        self._looked_at = 0.0
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
        if self.state.status is not None:
            self.state.is_checking.set(on)
            self._look_if_due(self._clock() + LOOK_PAUSE_S)

    def take_news(self) -> None:
        """Bring frames and progress to the state and look again when it is time; called by a clock."""
        self._show_frame()
        self._jobs.take_news()
        self._look_if_due(self._clock())

    def _show_frame(self) -> None:
        frame = None if self._work is None else self._work.camera.take_frame()
        if frame is None or self._devices is None:
            return
        info = self._devices.camera.info
        full_scale = 2**info.bit_depth - 1
        picture = quick_picture(frame.pixels, info.bayer, full_scale, show_saturation=True)
        self.state.seen.set(Seen(picture, max(statistics(frame.pixels, info.bayer, full_scale).saturated)))

    def _look_if_due(self, now: float) -> None:
        status = self.state.status
        due = self.state.is_checking.value and self._jobs.is_free and now - self._looked_at >= LOOK_PAUSE_S
        if not due or status is None:
            return
        step, work = status.step, self._the_work
        self._jobs.start(Doing.LOOKING, f"Look at {step.title}", lambda p: work.look(step, p), self._looked)

    def _looked(self, look: Look) -> None:
        self._looked_at = self._clock()
        status = self.state.status
        if status is not None and status.step.key == look.key:
            self.state.look.set(look)

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
        self._jobs.after_look(
            lambda: self._jobs.start(
                Doing.FITTING, "Fit", self._the_work.fit, self._fitted, failed=self._not_fitted
            )
        )

    def _not_fitted(self, error: Exception) -> None:
        self._jobs.fail(error)
        self.state.misfit.set(self._the_work.session)

    def _fitted(self, fit: Fit) -> None:
        self.state.misfit.set(None)
        self.state.fit.set(fit)
        self.state.at.set(self.state.last)
        self.state.note.set("")

    def accept(self) -> None:
        """Let the fit be the campaign's calibration, and write down the rig as far as it is known."""
        fit, work = self.state.fit.value, self._the_work
        if fit is not None and not fit.is_accepted and self._jobs.is_free:
            self._jobs.start(Doing.KEEPING, "Accept", lambda progress: work.accept(), self._accepted)

    def _accepted(self, fit: Fit) -> None:
        work, title = self._the_work, self.state.title
        self.state.fit.set(fit)
        self.state.note.set(f"{title} is accepted.")
        self._jobs.start(
            Doing.KEEPING,
            "Write the rig",
            lambda progress: self._write(work),
            self._written,
        )

    def _write(self, work: WizardWork) -> Products:
        name, library = self._library()
        return work.write(name, library)

    def _written(self, made: Products) -> None:
        kept = f" In the library it is {made.entry!r}." if made.entry else ""
        self.state.note.set(f"{self.state.title} is accepted. The rig lies in {made.rig}.{kept}")

    def discard(self) -> None:
        """Forget the fit that waits; captures and the accepted calibration stay."""
        fit, work = self.state.fit.value, self._the_work
        if fit is not None and not fit.is_accepted and self._jobs.is_free:
            self._jobs.start(
                Doing.KEEPING,
                "Discard the fit",
                lambda progress: work.discard(),
                lambda _: self.state.fit.set(None),
            )

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
