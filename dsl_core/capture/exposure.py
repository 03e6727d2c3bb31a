"""One frame of one shot, whatever it takes: retries, late frames, only what changed is sent."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.again import Again
from dsl_core.capture.frame_order import FrameOrder, StaleFrameError
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.plausible import require_exposure, require_mosaic
from dsl_core.errors import Cancelled, DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot, describe_shot
from dsl_core.optics.sensor import as_if_exposed
from dsl_core.progress import CancelToken
from dsl_core.words import ended

PatternImage = Callable[[CapturePlan, Shot], NDArray[np.uint8]]
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RetryPolicy:
    """How patient a runner is with a shot.

    ``attempts`` exposures at most, ``wait_ms`` between them after a lost frame; ``timeout_ms`` is added to
    the exposure before a frame counts as lost: long for any camera, and short for a person who cancels.
    """

    attempts: int = 4
    wait_ms: float = 200.0
    timeout_ms: float = 1500.0


class ShotTaker:
    """Takes shots with a rig and remembers what projector and camera are set to."""

    def __init__(
        self,
        rig: DeviceRig,
        plan: CapturePlan,
        pattern_image: PatternImage,
        policy: RetryPolicy,
        token: CancelToken | None = None,
        now: Callable[[], float] = time.time,
        again: Again = Again.SCAN,
    ) -> None:
        """Keep the parts; nothing is sent to the devices yet. A cancelled ``token`` ends further attempts.

        ``now`` gives the time of day, s, that is noted when a pattern was shown; errors advise ``again``.
        """
        self._rig = rig
        self._plan = plan
        self._pattern_image = pattern_image
        self._policy = policy
        self._token = token or CancelToken()
        self._sleep, self._now, self._again = rig.sleep or time.sleep, now, again
        self._order = FrameOrder(time.monotonic if rig.sleep is None else None)
        self._shown_s = 0.0
        self._shown: tuple[object, ...] | None = None
        self._exposure_ms: float | None = None
        self._last: Frame | None = None
        #: Exposures in force by those planned, ms, which a camera may have rounded.
        self._in_force_ms: dict[float, float] = {}
        self._noiseless = False

    def assume(self, stored: Shot) -> None:
        """Compare frames with those of earlier runs, whose ``stored`` shots have the exposure in force."""
        self._in_force_ms[self._plan.settings[stored.setting].exposure_ms] = stored.exposure_ms

    def take(self, shot: Shot, earlier_rounds: int = 0, settle_ms: float = 0.0, twice: bool = False) -> Frame:
        """The frame of a shot; raises `DeviceError` when all attempts failed, or `Cancelled`.

        ``earlier_rounds`` counts how often it was taken before in vain: then the pattern is sent again, and
        ``settle_ms`` waited until the exposure. ``twice`` sends and exposes everything twice and keeps the
        second picture, for projectors and cameras that are one picture late.
        """
        if earlier_rounds:
            self._shown = None
        before = self._last
        twins: list[Frame] = []
        first = earlier_rounds * self._policy.attempts
        for attempt in range(self._policy.attempts):
            try:
                frame = self._attempt(shot, first + attempt, settle_ms, twice)
                frame = replace(frame, attempts=first + attempt + 1)
            except DeviceError as error:
                self._recover(shot, attempt, error)
                continue
            if not _same_picture(frame, before):
                return frame
            # A new number on the old picture: noise never repeats, so the picture is late, unless the
            # camera has no noise, which is believed once every attempt gives that picture.
            twins.append(frame)
            if self._noiseless and len(twins) == 2:
                return frame
        if len(twins) < 2:
            raise DeviceError(
                f"For {describe_shot(shot)}, the camera delivered the picture of the previous shot."
                f" Check that the projector responds and restart the camera. {self._again.then}"
            )
        if not self._noiseless:
            _log.warning("the camera gives one picture for different patterns; assumed to be free of noise")
        self._noiseless = True
        return twins[-1]

    def show_black(self) -> None:
        """Turn the projector dark; raises `DeviceError`."""
        info = self._rig.projector.info
        self._shown = None
        self._rig.projector.show(np.zeros((info.height_px, info.width_px), np.uint8))

    def _attempt(self, shot: Shot, attempt: int, settle_ms: float, twice: bool) -> Frame:
        for _ in range(2 if twice else 1):
            self._set(shot, send=twice)
            if settle_ms:
                self._sleep(settle_ms / 1000.0)
        self._rig.camera.prepare(shot.index, attempt)
        timeout_ms = shot.exposure_ms + self._policy.timeout_ms
        if twice:
            # A camera that is one picture late delivers an old one now.
            with contextlib.suppress(StaleFrameError):
                self._order.take(self._rig.camera.snap(timeout_ms))
        frame = self._rig.camera.snap(timeout_ms)
        require_mosaic(frame.pixels, self._plan.camera_size_px, "The camera")
        require_exposure(frame.exposure_ms, shot.exposure_ms, "The camera")
        frame = replace(self._order.take(frame), shown_s=self._shown_s, even=self._even(shot, frame))
        self._last = frame
        return frame

    def _even(self, shot: Shot, frame: Frame) -> NDArray[np.uint16] | None:
        """The mosaic as if exposed as the first of its setting; None where it was, or black is not known."""
        usual_ms = self._in_force_ms.setdefault(shot.exposure_ms, frame.exposure_ms)
        known = self._rig.calibration
        if known is None:
            return None
        even = as_if_exposed(frame.pixels, usual_ms / frame.exposure_ms, known.sensor)
        return None if even is frame.pixels else even

    def _set(self, shot: Shot, send: bool = False) -> None:
        """Send pattern and exposure where they differ from what the devices have, or the pattern anyway."""
        if shot.exposure_ms != self._exposure_ms:
            actual = self._rig.camera.configure(shot.exposure_ms)
            require_exposure(actual, shot.exposure_ms, "The camera")
            self._exposure_ms = shot.exposure_ms
        pattern = (shot.role, shot.pattern, shot.level)
        if send or pattern != self._shown:
            self._shown = None
            self._rig.projector.show(self._pattern_image(self._plan, shot))
            self._shown, self._shown_s = pattern, self._now()

    def _recover(self, shot: Shot, attempt: int, error: DeviceError) -> None:
        """Get ready for another attempt, or give up with a clear sentence."""
        if self._token.is_cancelled:
            raise Cancelled(
                f"Cancelled while {describe_shot(shot)} failed: {error} Everything before it is saved."
            ) from error
        if attempt + 1 >= self._policy.attempts:
            raise DeviceError(
                f"{describe_shot(shot).capitalize()} failed {attempt + 1} times: {ended(str(error))}"
                f" {self._again.capitalize()} when the device works again."
            ) from error
        _log.warning("%s, attempt %d: %s", describe_shot(shot), attempt + 1, error)
        self._order.interrupted()
        if not isinstance(error, StaleFrameError):
            self._shown = self._exposure_ms = None
            self._sleep(self._policy.wait_ms / 1000.0)


def _same_picture(frame: Frame, before: Frame | None) -> bool:
    """Whether two frames agree in every pixel without being clipped throughout."""
    if before is None or not np.array_equal(frame.pixels, before.pixels):
        return False
    return bool(frame.pixels.min() < frame.pixels.max())
