"""Whether a frame is a new one, by its number and time: counters wrap, skip and start again, clocks jump."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.words import counted

#: Where counters of frames start again, and how near to it both numbers are then.
WRAPS, NEAR_WRAP = (2**8, 2**16, 2**32, 2**64), 32
#: After so many frames without a gap, one is worth a word.
FRAMES_WITHOUT_GAP = 8
#: A camera's clock may differ from ours by this much between two frames, s, and this share of the time.
CLOCK_SLACK_S, CLOCK_SLACK_SHARE = 2.0, 0.1
_log = logging.getLogger(__name__)


class StaleFrameError(DeviceError):
    """The camera delivered a picture that it had delivered before."""


class FrameOrder:
    """Judges the frames of one camera in the order in which they arrive."""

    def __init__(self, clock: Callable[[], float] | None = None) -> None:
        """``clock`` gives seconds to hold the camera's clock against; None for a camera in simulated time."""
        self._clock = clock
        self._last: tuple[Frame, float] | None = None
        self._refused: Frame | None = None
        self._unbroken = 0
        self._told: set[str] = set()

    def take(self, frame: Frame) -> Frame:
        """The frame, its time made a number; raises `StaleFrameError` for an old one."""
        if not math.isfinite(frame.timestamp_s):
            self._tell("nan", "the camera's frames have no time; the log of this scan has none either")
            frame = replace(frame, timestamp_s=0.0)
        now_s = 0.0 if self._clock is None else self._clock()
        if self._last is not None:
            last, then_s = self._last
            self._require_new(frame, last)
            self._note_gap(frame, last)
            self._note_clock(frame, last, now_s - then_s)
        self._last, self._refused = (frame, now_s), None
        return frame

    def interrupted(self) -> None:
        """Numbers may skip here without a word: an exposure failed."""
        self._unbroken = 0

    def _require_new(self, frame: Frame, last: Frame) -> None:
        number = frame.frame_id
        # Some clocks tell whole seconds.
        is_same = frame.timestamp_s == last.timestamp_s != 0.0 and np.array_equal(frame.pixels, last.pixels)
        if number > last.frame_id and not is_same:
            return
        if not is_same and number < last.frame_id:
            if any(end - NEAR_WRAP <= last.frame_id < end and number < NEAR_WRAP for end in WRAPS):
                return
            # Old frames come once; a camera that was switched off and on counts on from there.
            if self._refused is not None and self._refused.frame_id < number:
                _log.warning("the camera counts its frames from %d again; it seems to have restarted", number)
                return
            self._refused = frame
        raise StaleFrameError(
            f"The camera delivered frame number {number} {_why_old(frame, last)}. Restart the camera; on a"
            " slow connection lower its frame rate."
        )

    def _note_gap(self, frame: Frame, last: Frame) -> None:
        skipped = frame.frame_id - last.frame_id - 1
        if skipped > 0 and self._unbroken >= FRAMES_WITHOUT_GAP:
            self._tell("gap", f"the camera lost {counted(skipped, 'frame')} before number {frame.frame_id}")
        self._unbroken = self._unbroken + 1 if skipped == 0 else 0

    def _note_clock(self, frame: Frame, last: Frame, passed_s: float) -> None:
        if 0.0 in (frame.timestamp_s, last.timestamp_s):
            return
        step_s = frame.timestamp_s - last.timestamp_s
        if step_s == 0:
            self._tell(
                "same",
                f"frames {last.frame_id} and {frame.frame_id} have the same time: the camera's clock is"
                " coarse or stands still; use the times at which patterns were shown instead",
            )
        jumps = self._clock is not None and abs(step_s - passed_s) > CLOCK_SLACK_S + CLOCK_SLACK_SHARE * abs(
            passed_s
        )
        if step_s < 0 or jumps:
            self._tell(
                "clock",
                f"the camera's clock jumped by {step_s - max(passed_s, 0.0):.3g} s before frame"
                f" {frame.frame_id}; use the times at which patterns were shown instead",
            )

    def _tell(self, what: str, sentence: str) -> None:
        """Once a scan is enough."""
        if what not in self._told:
            self._told.add(what)
            _log.warning("%s", sentence)


def _why_old(frame: Frame, last: Frame) -> str:
    """By what a frame is an old one: its number, or else its time."""
    if frame.frame_id == last.frame_id:
        return f"again (time {frame.timestamp_s:g} s)"
    if frame.frame_id < last.frame_id:
        return f"after number {last.frame_id}"
    return (
        f"with time ({frame.timestamp_s:g} s) and pixels of number {last.frame_id}: it is the picture before"
    )
