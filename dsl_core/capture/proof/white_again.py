"""Whether white, captured again, has its light of the beginning everywhere: dust and shadows are local.

A lamp that fades does so all over the picture, and is corrected for; what moved shows by its edges.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import BLOCKS, Counts, Floats, Raster
from dsl_core.model.plan import CapturePlan, Shot

#: How far the light of a block may be from that of most, as a share, and in deviations.
LEAST, SIGMAS = 0.05, 6.0
#: Blocks that have to be off, and how far from white its black may have been captured.
FEWEST, NEAR = 3, 4
#: Bands of rows leave no more than this share of the variance from block to block.
BANDED = 0.2


@dataclass(frozen=True)
class WhiteAgain:
    """Light of white, captured again as ``shot``, over that of the first, where it differs most.

    ``usual`` is what most of the picture has; ``columns`` and ``rows`` bound the blocks that differ, camera
    pixels. It ``is_banded`` where whole rows differ.
    """

    shot: Shot
    share: float
    std: float
    usual: float
    columns: tuple[int, int]
    rows: tuple[int, int]
    is_banded: bool = False

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        if self.is_banded:
            return (
                f"White, captured again as frame {self.shot.number}, has {self.share:.2f} ±"
                f" {max(self.std, 0.005):.2f} times its light of the beginning in whole rows, and"
                f" {self.usual:.2f} times in others: the light flickers, as that of the mains or of pulsed"
                " LEDs does, while the camera exposes one row after the other. Frames between are off by as"
                " much. Expose for whole periods of the light, keep lamps of the room off, and scan again."
            )
        return (
            f"White, captured again as frame {self.shot.number}, has {self.share:.2f} ±"
            f" {max(self.std, 0.005):.2f} times its light of the beginning in columns"
            f" {self.columns[0]}-{self.columns[1]}, rows {self.rows[0]}-{self.rows[1]} of the picture, and"
            f" {self.usual:.2f} times in most of it: dust or moisture came onto lens, film or target,"
            " something stands in the way of the light, or surfaces have changed. Frames before may be off by"
            " as much. Clean what is in the way, let the target settle, and scan again."
        )


def white_again(
    plan: CapturePlan, kept: Mapping[int, Counts], noise: Noise, raster: Raster
) -> WhiteAgain | None:
    """The white, of all that were captured again, that differs most in a part of the picture; None if none.

    ``kept`` are the rasters of shots, by index.
    """
    size_px = plan.camera_size_px
    found = (
        _compared(shot, before, now, size_px, noise, raster) for shot, before, now in repeats(plan, kept)
    )
    differ = (one for one in found if one is not None)
    return max(differ, key=lambda one: abs(one.share - one.usual), default=None)


def repeats(
    plan: CapturePlan, kept: Mapping[int, Counts]
) -> Iterator[tuple[Shot, tuple[Counts, Counts], tuple[Counts, Counts]]]:
    """Every white that was captured again: its shot, the first white and this one, each with its black."""
    old = {s.index: plan.original(s) for s in plan.shots() if s.role == "sentinel" and s.index in kept}
    blacks = {index: shot for index, shot in old.items() if shot.role == "black"}
    for shot in plan.shots():
        first = old.get(shot.index)
        near = [index for index in blacks if abs(index - shot.index) < NEAR]
        if first is None or first.role != "white" or not near:
            continue
        black = blacks[near[0]].index
        if {first.index, black} <= kept.keys():
            yield shot, (kept[first.index], kept[black]), (kept[shot.index], kept[near[0]])


def _compared(
    shot: Shot, before: tuple[Counts, Counts], now: tuple[Counts, Counts], size_px: tuple[int, int],
    noise: Noise, raster: Raster,
) -> WhiteAgain | None:  # fmt: skip
    """What two whites, each with its black, differ by in blocks of the raster."""
    full = noise.sensor.full_scale_dn
    sound = np.asarray((before[0] < full) & (now[0] < full), np.float32)

    def light(pair: tuple[Counts, Counts]) -> Floats:
        return raster.pool((pair[0].astype(np.float32) - pair[1]) * sound)

    first, second = light(before), light(now)
    variance = sum((noise.variance(each) for each in (*before, *now)), np.float32(0))
    std = np.sqrt(raster.pool(variance * sound) / np.float32(raster.pooled))
    used = first > 4 * SIGMAS * std
    if int(used.sum()) < 4 * FEWEST:
        return None
    ratio, of_ratio = second[used] / first[used], std[used] / first[used]
    usual = float(np.median(ratio))
    apart = ratio - usual
    off = np.abs(apart) > np.maximum(LEAST * usual, SIGMAS * of_ratio)
    if int(off.sum()) < FEWEST:
        return None
    worst = int(np.abs(np.where(off, apart, 0)).argmax())
    row = np.flatnonzero(used) // _blocks(raster.shape[1])
    of_rows = (np.bincount(row, apart) / np.maximum(np.bincount(row), 1))[row]
    is_banded = float(np.var(apart - of_rows)) < BANDED * float(np.var(apart))
    down, across = np.divmod(np.flatnonzero(used)[off], _blocks(raster.shape[1]))
    return WhiteAgain(
        shot, float(ratio[worst]), float(of_ratio[worst]), usual,
        _span(across, _blocks(raster.shape[1]), size_px[0]),
        _span(down, _blocks(raster.shape[0]), size_px[1]),
        is_banded,
    )  # fmt: skip


def _blocks(size: int) -> int:
    """How many blocks of a raster cover so many of its rows or columns."""
    return size // max(size // BLOCKS, 1)


def _span(blocks: np.ndarray, count: int, size_px: int) -> tuple[int, int]:
    return int(blocks.min()) * size_px // count, (int(blocks.max()) + 1) * size_px // count
