"""Frames of a scan, read and merged once: decoded columns, white, and the stack of line frames."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.captured_code import CapturedCode
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, NoCode, Role, Shot
from dsl_core.model.rig import ProjectorResponse, Rig, Sensor
from dsl_core.optics.sensor import raw_variance
from dsl_core.patterns.binary_code import decoder_of
from dsl_core.patterns.captured_code import decode_captured
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction.hdr import (
    BlackFrame,
    HdrMerger,
    MergedFrame,
    black_frame,
    gained_black,
    setting_gains_ms,
)
from dsl_core.reconstruction.light.setting_ratios import Ratio, compare_settings
from dsl_core.reconstruction.room import Room

T = TypeVar("T")
Floats = NDArray[np.float32]
THREADS = 2


class Readout(Protocol):
    """What of a rig is needed to merge frames."""

    @property
    def sensor(self) -> Sensor:
        """How light becomes numbers."""

    @property
    def projector_response(self) -> ProjectorResponse:
        """How drive levels become light."""


@dataclass(frozen=True)
class Exposed:
    """In what light each shot of a plan was taken, all (shots,).

    ``levels`` are relative to the light that it should have had. Black is ``black_dn`` more than the black
    frame of the shot's setting in every pixel, and this ``black_share`` of what that is above its level; any
    shot may be off from that by ``black_std_dn``.
    """

    levels: NDArray[np.float64]
    black_dn: NDArray[np.float64]
    black_share: NDArray[np.float64]
    black_std_dn: float = 0.0

    @classmethod
    def as_planned(cls, count: int) -> Exposed:
        """Of so many shots."""
        return cls(np.ones(count), np.zeros(count), np.zeros(count))

    def of(self, shots: Sequence[Shot]) -> tuple[list[float], list[tuple[float, float]]]:
        """Levels and what black has gained of some shots."""
        at = [shot.index for shot in shots]
        gained = zip(self.black_dn[at].tolist(), self.black_share[at].tolist(), strict=True)
        return self.levels[at].tolist(), list(gained)


class MergedScan:
    """Reads the settings of a shot and merges them."""

    def __init__(
        self,
        source: FrameSource,
        rig: Readout,
        exposed: Exposed | None = None,
        *,
        compares: bool = True,
    ) -> None:
        """``exposed`` says in what light shots were taken; None: as planned.

        Settings of one pattern are compared with each other unless ``compares`` is off.
        """
        self.source, self.rig, self.plan, self._exposed = source, rig, source.plan, exposed
        self._compares = compares
        #: What settings of one pattern say of each other's light, of the patterns merged so far.
        self.ratios: dict[tuple[Role, int], tuple[Ratio | None, ...]] = {}
        self._shots: dict[tuple[Role, int], list[Shot]] = {}
        for shot in self.plan.shots():
            self._shots.setdefault((shot.role, shot.pattern), []).append(shot)
        blacks = [black_frame([source.read(shot)], rig.sensor) for shot in self._shots["black", 0]]
        # The noise of a black frame is common to all frames of a pixel: it does not scatter between them.
        # What it shifts is measured later, on unlit frames, or stays unknown to `black_std`.
        wander = 0.0 if exposed is None else exposed.black_std_dn**2
        self.blacks = [BlackFrame(black.mean, np.full_like(black.variance, wander)) for black in blacks]
        self.gains_ms = setting_gains_ms(self.plan.settings, rig.projector_response)
        self.black_std = _merged_std(blacks, self.gains_ms)
        self._mergers: dict[tuple[int, ...], HdrMerger] = {}
        self._lock = threading.Lock()

    def merge(self, role: Role, pattern: int, out: MergedFrame | None = None) -> MergedFrame:
        """Linear radiance of one pattern, from every setting it was captured with."""
        return self.merge_raws(
            role, pattern, [self.source.read(s) for s in self.shots_of(role, pattern)], out
        )

    def merge_raws(
        self,
        role: Role,
        pattern: int,
        raws: Sequence[NDArray[np.uint16]],
        out: MergedFrame | None = None,
    ) -> MergedFrame:
        """The same from mosaics that were read already, one for each of the pattern's shots."""
        merger, exposed = self._prepare(role, pattern, raws)
        return merger.merge(raws, out, *exposed)

    def merge_line(
        self,
        index: int,
        raws: Sequence[NDArray[np.uint16]] | None,
        radiance: Floats,
        std: NDArray[np.floating],
    ) -> None:
        """Radiance and deviation of a line frame, from mosaics that were read already or are read now."""
        if raws is None:
            raws = [self.source.read(shot) for shot in self.shots_of("spectral", index)]
        merger, exposed = self._prepare("spectral", index, raws)
        merger.merge_std(raws, radiance, std, *exposed)

    def _prepare(
        self, role: Role, pattern: int, raws: Sequence[NDArray[np.uint16]]
    ) -> tuple[HdrMerger, tuple[list[float], list[tuple[float, float]]] | tuple[()]]:
        """What merges the shots of a pattern, their light and their black, after they were compared."""
        shots = self.shots_of(role, pattern)
        if self._compares:
            self.compare(role, pattern, raws)
        exposed = () if self._exposed is None else self._exposed.of(shots)
        return self._merger(tuple(shot.setting for shot in shots)), exposed

    def compare(self, role: Role, pattern: int, raws: Sequence[NDArray[np.uint16]]) -> None:
        """Put down in ``ratios`` what settings of one pattern say of each other's light.

        Black is as exposed; levels are not taken off, since it is they that are asked for.
        """
        shots = self.shots_of(role, pattern)
        if len(shots) > 1:
            blacks = [self.blacks[shot.setting] for shot in shots]
            gains = [float(self.gains_ms[shot.setting]) for shot in shots]
            if self._exposed is not None:
                _, gained = self._exposed.of(shots)
                level_dn = self.rig.sensor.black_level_dn
                blacks = [
                    replace(black, mean=gained_black(black.mean, *more, level_dn))
                    for black, more in zip(blacks, gained, strict=True)
                ]
            self.ratios[role, pattern] = compare_settings(raws, blacks, gains, self.rig.sensor)

    def shots_of(self, role: Role, pattern: int) -> list[Shot]:
        """The shots of a pattern, one for each setting it was captured with."""
        return self._shots[role, pattern]

    def _merger(self, settings: tuple[int, ...]) -> HdrMerger:
        with self._lock:
            if settings not in self._mergers:
                gains = [float(self.gains_ms[i]) for i in settings]
                blacks = [self.blacks[i] for i in settings]
                self._mergers[settings] = HdrMerger(gains, blacks, self.rig.sensor)
            return self._mergers[settings]


@dataclass(frozen=True)
class LineStack:
    """Merged line frames (frames, rows, columns): radiance (DN per ms), deviation (infinite: saturated).

    ``black_std`` (rows, columns) is the deviation of what the black frames shift all frames of a pixel by.
    """

    radiance: NDArray[np.float32]
    std: NDArray[np.floating]
    black_std: NDArray[np.float32]

    def pick(self, pixels: NDArray[np.intp]) -> PickedLines:
        """The frames of some pixels (flat indices)."""
        flat = (cube.reshape(len(cube), self.black_std.size) for cube in (self.radiance, self.std))
        radiance, std = (np.take(cube, pixels, axis=1) for cube in flat)
        return PickedLines(pixels, radiance, std, self.black_std.ravel()[pixels])


@dataclass(frozen=True)
class PickedLines:
    """Merged line frames of some ``pixels`` (n,) of a picture, as in `LineStack`: (frames, n), and (n,)."""

    pixels: NDArray[np.intp]
    radiance: NDArray[np.float32]
    std: NDArray[np.floating]
    black_std: NDArray[np.float32]

    def pick(self, pixels: NDArray[np.intp]) -> PickedLines:
        """Some of them, all of which must be there."""
        order = np.argsort(self.pixels, kind="stable")
        at = order[np.searchsorted(self.pixels, pixels, sorter=order)]
        return PickedLines(pixels, self.radiance[:, at], self.std[:, at], self.black_std[at])

    def as_stack(self) -> LineStack:
        """The same memory as a picture of a single row."""
        return LineStack(self.radiance[:, None], self.std[:, None], self.black_std[None])


def decode_columns(scan: MergedScan, progress: Progress | None = None) -> tuple[DecodedCode, MergedFrame]:
    """Decode the binary code (Shin et al., CVPR 2024, supplement, Eqs. 4 to 8) and merge the white frame."""
    plan = scan.plan
    if isinstance(plan.code, NoCode):
        raise DecodeError(
            f"The scan {plan.name!r} contains no binary code, so depth is unknown. Capture one with a code."
        )
    white = scan.merge("white", 0)
    if isinstance(plan.code, CapturedCode):
        merged = (scan.merge("code", index) for index in range(plan.code_count))
        frames = ((frame.radiance, frame.variance) for frame in merged)
        levels = (white.radiance, white.variance)
        return decode_captured(plan.code, plan.projector_size_px, frames, levels), white
    decoder = decoder_of(plan.code, plan.projector_size_px)

    def add(pair: tuple[MergedFrame, MergedFrame]) -> None:
        positive, inverse = pair
        decoder.add(positive.radiance, inverse.radiance, np.sqrt(positive.variance + inverse.variance))

    in_order(
        lambda i: (scan.merge("code", 2 * i), scan.merge("code", 2 * i + 1)),
        plan.code_count // 2,
        "binary code",
        progress,
        add,
    )
    return decoder.finish(), white


def stack_lines(scan: MergedScan, progress: Progress | None = None, room: Room | None = None) -> LineStack:
    """Read and merge every spectral frame; deviations take half precision wherever it holds them.

    The stack is in the memory of ``room``, if given, where the next one will be as well.
    """
    shape, room = (scan.plan.spectral_count, *scan.black_std.shape), room or Room()
    radiance = room.of("radiance", shape, np.float32)
    stack = LineStack(radiance, room.of("std", shape, deviation_type(scan)), scan.black_std)

    def load(k: int) -> None:
        scan.merge_line(k, None, stack.radiance[k], stack.std[k])

    in_order(load, shape[0], "line frames", progress)
    return stack


def _merged_std(blacks: Sequence[BlackFrame], gains_ms: NDArray[np.float64]) -> NDArray[np.float32]:
    """Deviation (DN per ms) that black frames give dark values, by the weights these are merged with."""
    information = sum(
        np.float32(gain) ** 2 / black.variance for gain, black in zip(gains_ms, blacks, strict=True)
    )
    return np.asarray(1 / np.sqrt(information), np.float32)


def deviation_type(scan: MergedScan) -> type[np.floating]:
    """Half precision unless some deviation of the merge would overflow it or lose digits; else single."""
    sensor, gains = scan.rig.sensor, scan.gains_ms
    dark, full = raw_variance(sensor, np.array([0.0, sensor.full_scale_dn]))
    half = np.finfo(np.float16)
    least, most = np.sqrt(dark) / gains.sum(), np.sqrt(full) / gains.min()
    return np.float16 if least > half.smallest_normal and most < half.max else np.float32


def check_source(source: FrameSource, rig: Rig) -> CapturePlan:
    """The plan, after a check that it belongs to the rig; raises `DecodeError`."""
    plan = source.plan
    sizes = {
        "camera": (plan.camera_size_px, (rig.camera.width_px, rig.camera.height_px)),
        "projector": (plan.projector_size_px, (rig.projector.width_px, rig.projector.height_px)),
    }
    for device, (given, wanted) in sizes.items():
        if tuple(given) != wanted:
            raise DecodeError(
                f"The scan was captured with a {device} of {given[0]} x {given[1]} pixels, the calibration"
                f" {rig.name!r} is for {wanted[0]} x {wanted[1]}. Use the calibration of this rig and crop."
            )
    return plan


def in_order(
    task: Callable[[int], T],
    count: int,
    stage: str,
    progress: Progress | None,
    use: Callable[[T], object] = lambda result: None,
) -> None:
    """Run a task for 0 to count - 1 in threads, a few ahead, and use the results in order."""
    progress = progress or NoProgress()
    with ThreadPoolExecutor(THREADS) as pool:
        ahead: deque[Future[T]] = deque()
        try:
            for i in range(count + 2 * THREADS):
                if i < count:
                    ahead.append(pool.submit(task, i))
                if i >= 2 * THREADS and ahead:
                    use(ahead.popleft().result())
                    progress.report(stage, i - 2 * THREADS + 1, count)
        finally:
            for future in ahead:
                future.cancel()
