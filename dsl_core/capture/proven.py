"""Shots that show their pattern: taken, judged, taken again if need be, and only then believed."""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import replace

from dsl_core.capture.exposure import ShotTaker
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.errors import Cancelled, DeviceError
from dsl_core.model.frames import Frame, FrameSink, FrameSource
from dsl_core.model.plan import Shot
from dsl_core.progress import CancelToken

#: How often a shot is taken again before the scan stops, and how long the pattern may settle before that, ms.
SETTLE_MS = (100.0, 300.0, 900.0)
#: After so many failures on end, shots that show too little to be judged are taken twice as well.
FAILURES = 2
_log = logging.getLogger(__name__)


class ProvenShots:
    """Takes shots into a sink; without a proof, any picture is believed."""

    def __init__(
        self, taker: ShotTaker, proof: FrameProof | None, sink: FrameSink, token: CancelToken
    ) -> None:
        """Keep the parts."""
        self._taker, self._proof, self._sink, self._token = taker, proof, sink, token
        self._failures = 0
        #: Shots that were taken again because a picture did not show their pattern.
        self.corrected = 0

    @property
    def note(self) -> str:
        """What a person should know at the end, as a sentence with a space before it; empty if nothing."""
        if not self.corrected:
            return ""
        what = "1 was" if self.corrected == 1 else f"{self.corrected} were"
        return f" {what} captured again, because a picture did not show its pattern."

    def take(self, shot: Shot) -> None:
        """Take a shot and save it.

        Raises `DeviceError` when it does not show its pattern however often it is taken, `StoreError` when it
        cannot be saved, `Cancelled` when someone requested the end.
        """
        frame = self._taker.take(shot)
        if self._proof is None:
            self._sink.write(shot, frame)
            return
        found = self._proof.judge(shot, frame.pixels)
        if found.verdict is not Verdict.UNTOLD:
            self._failures = self._failures + 1 if found.is_wrong else 0
        elif self._failures >= FAILURES:
            frame = self._taker.take(shot, 1, SETTLE_MS[0])
            found = self._proof.judge(shot, frame.pixels)
        if shot not in found.again:
            self._sink.write(shot, frame)
        self._correct(found, self._proof)

    def learn(self, stored: FrameSource, missing: Collection[int]) -> None:
        """Judge the frames of earlier runs, all but those ``missing``; wrong ones are taken again."""
        if self._proof is None:
            return
        for shot in stored.plan.shots():
            if shot.index not in missing:
                self._correct(self._proof.judge(shot, stored.read(shot)), self._proof)

    def _correct(self, found: Finding, proof: FrameProof) -> None:
        for earlier, settle_ms in enumerate(SETTLE_MS):
            if not found.is_wrong:
                return
            if self._token.is_cancelled:
                raise Cancelled(f"Cancelled: {found.sentence} Frames that do are saved. Resume the scan.")
            _log.warning("%s It is captured again.", found.sentence)
            reason, wrong = found.seen, found.again
            taken: list[tuple[Shot, Frame]] = []
            for shot in wrong:
                frame = replace(self._taker.take(shot, earlier + 1, settle_ms), corrected=reason)
                taken.append((shot, frame))
                found = proof.judge(shot, frame.pixels)
            for shot, frame in taken:
                if shot not in found.again:
                    self._sink.write(shot, frame)
                    self.corrected += 1
        if found.is_wrong:
            raise DeviceError(
                f"{found.names.capitalize()} does not show its pattern after {len(SETTLE_MS) + 1} exposures:"
                f" {found.seen}. {found.remedy} Frames before it are saved; resume the scan afterwards. If"
                " the pictures are right, resume it without checking that the scene has not moved."
            )
