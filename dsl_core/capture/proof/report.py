"""A whole scan judged at once: which of its pictures do not show their pattern."""

from __future__ import annotations

import threading
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.altered_since import alteration_of
from dsl_core.capture.proof.finding import Finding, ProofReport, Verdict, together
from dsl_core.capture.proof.light_sums import light_sentence
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.sentinels import movement_of
from dsl_core.errors import DriveError, StoreError
from dsl_core.model.frames import FrameSource, read_rows
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Rig
from dsl_core.model.scan_proof import ScanProof


class SeenFrames:
    """A little of every frame of a scan, to judge them all at its end; may be used from several threads."""

    def __init__(self, plan: CapturePlan) -> None:
        """Of no frame yet."""
        self.plan = plan
        self._raster = Raster(plan.camera_size_px)
        self._seen: dict[int, Counts] = {}
        self._lock = threading.Lock()

    def keep(self, shot: Shot, pixels: NDArray[np.uint16]) -> None:
        """Keep a little of a frame, shape (rows, columns), in place of an earlier one of this shot."""
        seen = self._raster.take(pixels)
        with self._lock:
            self._seen[shot.index] = seen

    def read_missing(self, source: FrameSource) -> None:
        """Read every frame of which nothing is kept yet; damaged ones are left out. Raises `DriveError`."""
        for shot in self.plan.shots():
            if shot.index not in self._seen:
                try:
                    self.keep(shot, source.read(shot))
                except DriveError:
                    raise
                except StoreError:
                    continue

    @property
    def unseen(self) -> frozenset[int]:
        """Indices of the shots of which nothing is kept."""
        return frozenset(shot.index for shot in self.plan.shots()) - self._seen.keys()

    def report(
        self,
        calibration: Rig | None,
        bit_depth: int = 12,
        bayer: str = "RGGB",
        knows_light: bool = True,
    ) -> ProofReport:
        """What the frames kept so far show, with the arguments of `FrameProof`."""
        proof = FrameProof(self.plan, calibration, bit_depth, bayer, at_the_end=True, knows_light=knows_light)
        wrong: list[Finding] = []
        untold: list[Shot] = []
        judged = 0
        for shot in self.plan.shots():
            seen = self._seen.get(shot.index)
            if seen is None:
                continue
            found = proof.judge_raster(shot, seen)
            judged += 1
            untold += [shot] if found.verdict is Verdict.UNTOLD else []
            wrong += proof.reviewed or ([found] if found.is_wrong else [])
            for number in proof.lacking_pairs if shot.role == "black" else ():
                pair = self._pair_elsewhere(number, shot.setting)
                if pair is not None:
                    proof.substitute(number, pair)
        whole = light_sentence(proof.whole.code_sum(), proof.whole.line_sum())
        light = [whole] if whole else []
        light += proof.whole.lasting()
        lit = proof.whole.lit_again()
        # A window covers white, and changes its colour, where it came into the picture.
        whites = (proof.whole.white_again(), proof.whole.colour_again()) if lit is None else (lit,)
        others = (proof.whole.single_pixels(), proof.whole.calm_lines())
        light += [each.sentence for each in (*whites, *others) if each is not None]
        light += [each.sentence for each in proof.whole.local_sums()]
        return ProofReport(judged, together(wrong), sum(not proof.is_told(s) for s in untold), tuple(light))

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


class WatchedSource:
    """A `FrameSource` that keeps a little of every frame it is asked for in ``seen``."""

    def __init__(self, source: FrameSource) -> None:
        """The source stays the caller's."""
        self._source = source
        self.seen = SeenFrames(source.plan)

    @property
    def plan(self) -> CapturePlan:
        """The plan the frames belong to."""
        return self._source.plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot, shape (rows, columns); raises `StoreError` when it is not there."""
        pixels = self._source.read(shot)
        self.seen.keep(shot, pixels)
        return pixels

    def read_rows(self, shot: Shot, rows: slice) -> NDArray[np.uint16]:
        """Some rows of a mosaic, of which nothing is kept; raises `StoreError`."""
        return read_rows(self._source, shot, rows)


def prove(
    source: FrameSource,
    seen: SeenFrames,
    calibration: Rig | None = None,
    bit_depth: int = 12,
    bayer: str = "RGGB",
    missing: Iterable[int] = (),
    knows_light: bool = True,
) -> ScanProof:
    """What the frames ``seen`` of a scan show, and what moved in it.

    Reads the sentinels, and what they repeat, from the ``source``, which has all frames but those
    ``missing``. Without ``knows_light``, the calibration does not say how bright they are. Raises
    `StoreError`.
    """
    found = seen.report(calibration, bit_depth, bayer, knows_light)
    sensor = None if calibration is None else calibration.sensor
    altered = alteration_of(source, sensor, missing, bit_depth, bayer)
    # Pictures that are mixed or filtered look as if something had moved.
    moved = None if altered else movement_of(source, sensor, missing, bit_depth)
    return ScanProof(
        judged=found.judged,
        untold=found.untold,
        wrong=(*found.sentences, *([altered] if altered else [])),
        moved=() if moved is None else (f"{moved.sentence} {moved.advice}",),
    )
