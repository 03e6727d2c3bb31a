"""The merged frames of a scan by rows: held as a whole where they fit, else read when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import Role, Shot
from dsl_core.model.rig import Rig
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.light.setting_ratios import Ratio, compared_rows
from dsl_core.reconstruction.light.steady import SteadyLight
from dsl_core.reconstruction.merge import (
    Exposed,
    LineStack,
    MergedScan,
    PickedLines,
    decode_columns,
    deviation_type,
    in_order,
    stack_lines,
)
from dsl_core.reconstruction.room import Room
from dsl_core.reconstruction.rows.bands import Band, PixelsOf, RowsOf, all_rows

Indices = NDArray[np.intp]
_NONE = np.empty(0, np.intp)
_EMPTY = np.empty((0, 0), np.float32)
_NOTHING = PickedLines(_NONE, _EMPTY, _EMPTY, _EMPTY.ravel())


class ScanFrames:
    """The frames of a scan, of which at most those of one band are in memory."""

    def __init__(self, source: FrameSource, rig: Rig, bands: Sequence[Band]) -> None:
        """With a single band every frame is read once."""
        self.source, self.rig, self.plan, self.bands = source, rig, source.plan, bands
        #: What settings of one pattern say of each other's light; known after a `look` at all of them.
        self.ratios: dict[tuple[Role, int], tuple[Ratio | None, ...]] = {}
        self._exposed: Exposed | None = None
        self._light: SteadyLight | None = None
        self._whole: MergedScan | None = None
        self._picked: PickedLines | None = None
        self._held: tuple[Band, LineStack] | None = None
        self._room = Room()
        self._shots: dict[tuple[Role, int], list[Shot]] = {}
        for shot in self.plan.shots():
            self._shots.setdefault((shot.role, shot.pattern), []).append(shot)

    @property
    def in_one(self) -> bool:
        """Whether all rows are held at once."""
        return len(self.bands) == 1

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the picture."""
        return self.plan.camera_size_px[1], self.plan.camera_size_px[0]

    def shots_of(self, role: Role, pattern: int) -> list[Shot]:
        """The shots of a pattern, one for each setting it was captured with."""
        return self._shots[role, pattern]

    def expose(self, exposed: Exposed) -> None:
        """From now on merge frames as exposed to other light."""
        self._exposed, self._whole, self._held, self._picked = exposed, None, None, None

    def follow(self, light: SteadyLight) -> None:
        """From now on give line frames as they would be in steady light."""
        before, self._light = self._light, light
        if self._held is not None:
            light.steady(self._held[1], before)
        if self._picked is not None:
            light.steady(self._picked.as_stack(), before)

    @property
    def light(self) -> SteadyLight | None:
        """What line frames follow."""
        return self._light

    def decode(self, progress: Progress | None = None) -> tuple[DecodedCode, MergedFrame]:
        """What the binary code says of every pixel, and white."""
        if self.in_one or isinstance(self.plan.code, CapturedCode):
            # Codes of other programs may compare pixels with all others.
            return decode_columns(self._scan(), progress)
        found = []
        for band in self.bands:
            scan = MergedScan(RowsOf(self.source, band.rows), self.rig, self._exposed, compares=False)
            found.append(decode_columns(scan, progress))
        return all_rows([code for code, _ in found]), all_rows([white for _, white in found])

    def look(self, pixels: Indices = _NONE, progress: Progress | None = None) -> None:
        """Look at every frame once: compare settings, and keep the lines of some pixels for `pick`."""
        if self.in_one:
            self.lines(self.bands[0], progress)
            self.ratios = self._scan().ratios
            return
        rows = compared_rows(self.plan.camera_size_px[1])
        few = MergedScan(RowsOf(self.source, rows), self.rig, self._exposed)

        def compare(key: tuple[Role, int]) -> None:
            few.compare(*key, [self.source.read(shot)[rows] for shot in self.shots_of(*key)])

        others: list[tuple[Role, int]] = [key for key in self._shots if key[0] in ("code", "white")]
        in_order(lambda i: compare(others[i]), len(others), "frames of the code", progress)
        self._picked = self._read(np.unique(pixels), few, progress)
        self.ratios = few.ratios

    def pick(self, pixels: Indices, progress: Progress | None = None) -> PickedLines:
        """The lines of some pixels (flat indices) of the picture."""
        if pixels.size == 0:
            return _NOTHING
        if self.in_one:
            return self.lines(self.bands[0], progress).pick(pixels)
        if self._picked is None or not np.isin(pixels, self._picked.pixels).all():
            self._picked = self._read(np.unique(pixels), None, progress)
        return self._picked.pick(pixels)

    def lines(self, band: Band, progress: Progress | None = None) -> LineStack:
        """The lines of a band and its neighbours, until those of another one are asked for."""
        if self._held is None or self._held[0] != band:
            self._held = None
            scan = self._scan()
            if not self.in_one:
                scan = MergedScan(RowsOf(self.source, band.near), self.rig, self._exposed, compares=False)
            stack = stack_lines(scan, progress, self._room)
            if self._light is not None:
                self._light.steady(stack)
            self._held = band, stack
        return self._held[1]

    def let_go(self) -> None:
        """Keep no frames in memory until some are asked for."""
        if not self.in_one:
            self._held = None
            self._room.clear()

    def _scan(self) -> MergedScan:
        if self._whole is None:
            self._whole = MergedScan(self.source, self.rig, self._exposed)
        return self._whole

    def _read(self, pixels: Indices, few: MergedScan | None, progress: Progress | None) -> PickedLines:
        """The lines of some pixels from whole frames, whose settings are compared in some rows of a scan."""
        source = PixelsOf(self.source, pixels)
        scan = MergedScan(source, self.rig, self._exposed, compares=False)
        shape, rows = (self.plan.spectral_count, pixels.size), compared_rows(self.plan.camera_size_px[1])
        radiance, std = np.empty(shape, np.float32), np.empty(shape, deviation_type(scan))

        def load(k: int) -> None:
            raws = [self.source.read(shot) for shot in self.shots_of("spectral", k)]
            if few is not None:
                few.compare("spectral", k, [raw[rows] for raw in raws])
            scan.merge_line(k, [source.of(raw) for raw in raws], radiance[k][None], std[k][None])

        in_order(load, len(radiance), "line frames", progress)
        picked = PickedLines(pixels, radiance, std, scan.black_std[0])
        if self._light is not None:
            self._light.steady(picked.as_stack())
        return picked
