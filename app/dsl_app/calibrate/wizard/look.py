"""How a wizard looks at its target: again and again while a person moves it. No Qt."""

from __future__ import annotations

import time
from collections.abc import Callable

from dsl_app.calibrate.wizard.jobs import WizardJobs
from dsl_app.calibrate.wizard.state import Doing, Look, Seen, WizardState
from dsl_app.calibrate.wizard.work import WizardWork
from dsl_core.capture.preview import quick_picture, statistics

#: Pause between two looks, s.
LOOK_PAUSE_S = 0.8


class Looking:
    """Looks at the step that is shown whenever it is time, and shows what the camera took last."""

    def __init__(
        self, state: WizardState, jobs: WizardJobs, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._state, self._jobs, self._clock = state, jobs, clock
        self._looked_at = 0.0

    def check(self, on: bool, work: WizardWork) -> None:
        """Look again and again, or stop that; the first look is at once."""
        if self._state.status is not None:
            self._state.is_checking.set(on)
            self._look_if_due(self._clock() + LOOK_PAUSE_S, work)

    def take_news(self, work: WizardWork) -> None:
        """Show the latest frame and look again when it is time."""
        self._show_frame(work)
        self._look_if_due(self._clock(), work)

    def _show_frame(self, work: WizardWork) -> None:
        frame = work.camera.take_frame()
        if frame is None:
            return
        info = work.camera.info
        full_scale = 2**info.bit_depth - 1
        picture = quick_picture(frame.pixels, info.bayer, full_scale, show_saturation=True)
        seen = Seen(picture, max(statistics(frame.pixels, info.bayer, full_scale).saturated))
        self._state.seen.set(seen)

    def _look_if_due(self, now: float, work: WizardWork) -> None:
        status = self._state.status
        due = self._state.is_checking.value and self._jobs.is_free and now - self._looked_at >= LOOK_PAUSE_S
        if not due or status is None:
            return
        step = status.step
        self._jobs.start(Doing.LOOKING, f"Look at {step.title}", lambda p: work.look(step, p), self._looked)

    def _looked(self, look: Look) -> None:
        self._looked_at = self._clock()
        status = self._state.status
        if status is not None and status.step.key == look.key:
            self._state.look.set(look)
