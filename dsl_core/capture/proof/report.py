"""A whole scan judged at once: which of its pictures do not show their pattern."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Finding, ProofReport, Verdict
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.errors import StoreError
from dsl_core.model.frames import FrameSource, read_rows
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Rig


class WatchedSource:
    """A `FrameSource` that keeps a little of every frame it is asked for, to judge them afterwards."""

    def __init__(self, source: FrameSource) -> None:
        """The source stays the caller's."""
        self._source = source
        self._raster = Raster(source.plan.camera_size_px)
        self._seen: dict[int, Counts] = {}
        self._lock = threading.Lock()

    @property
    def plan(self) -> CapturePlan:
        """The plan the frames belong to."""
        return self._source.plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot, shape (rows, columns); raises `StoreError` when it is not there."""
        pixels = self._source.read(shot)
        seen = self._raster.take(pixels)
        with self._lock:
            self._seen[shot.index] = seen
        return pixels

    def read_rows(self, shot: Shot, rows: slice) -> NDArray[np.uint16]:
        """Some rows of a mosaic, of which nothing is kept; raises `StoreError`."""
        return read_rows(self._source, shot, rows)

    def report(self, calibration: Rig | None, bit_depth: int = 12, bayer: str = "RGGB") -> ProofReport:
        """What the frames read so far show."""
        proof = FrameProof(self.plan, calibration, bit_depth, bayer, at_the_end=True)
        wrong: list[Finding] = []
        judged = untold = 0
        for shot in self.plan.shots():
            seen = self._seen.get(shot.index)
            if seen is None:
                continue
            found = proof.judge_raster(shot, seen)
            judged += 1
            untold += found.verdict is Verdict.UNTOLD
            wrong += proof.reviewed or ([found] if found.is_wrong else [])
            for number in proof.lacking_pairs if shot.role == "black" else ():
                pair = self._pair_elsewhere(number, shot.setting)
                if pair is not None:
                    proof.substitute(number, pair)
        return ProofReport(judged, tuple(wrong), untold)

    def _pair_elsewhere(self, number: int, setting: int) -> tuple[Counts, Counts] | None:
        """Pattern and inverse as another setting shows them."""
        for other in self.plan.code_settings:
            found = [
                self._seen.get(shot.index)
                for shot in self.plan.shots()
                if (shot.role, shot.setting) == ("code", other) and shot.pattern // 2 == number
            ]
            if other != setting and len(found) == 2 and found[0] is not None and found[1] is not None:
                return found[0], found[1]
        return None


def prove(
    source: FrameSource, calibration: Rig | None = None, bit_depth: int = 12, bayer: str = "RGGB"
) -> ProofReport:
    """Read all frames of a scan, complete or not, and judge them; damaged ones are left out."""
    watched = WatchedSource(source)
    for shot in source.plan.shots():
        try:
            watched.read(shot)
        except StoreError:
            continue
    return watched.report(calibration, bit_depth, bayer)
