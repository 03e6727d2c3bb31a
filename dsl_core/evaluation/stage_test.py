"""The depth test: a flat target at known positions of a stage, and how straight its distance follows them.

Positions are what the stage says. Both ways to compare are given: with a free slope, which hides an error of
scale as the published figure does, and with a slope of 1, which holds only for a stage that moves along the
camera's axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.depth import straightness_mm
from dsl_core.evaluation.seen_target import SeenTarget
from dsl_core.evaluation.verdict import Verdict, estimate_row

Floats = NDArray[np.floating[Any]]
MIN_POSITIONS = 3


@dataclass(frozen=True)
class StageLine:
    """Distances against positions as a straight line.

    ``offset_mm`` is distance minus position in the middle of the positions; ``deviations_mm`` are distances
    minus the line, ``rms_mm`` and ``worst_mm`` their root mean square and largest size.
    """

    scale: float
    scale_std: float
    offset_mm: float
    offset_std_mm: float
    deviations_mm: tuple[float, ...]

    @property
    def rms_mm(self) -> float:
        """Straightness: how far distances lie off the line."""
        return float(np.sqrt(np.mean(np.square(self.deviations_mm))))

    @property
    def worst_mm(self) -> float:
        """The largest deviation."""
        return float(np.abs(self.deviations_mm).max())


@dataclass(frozen=True)
class StageTest:
    """What a target at several positions says of depth.

    ``distances_mm`` are depths of the plane at one place next to the camera's axis, the same for all, with
    ``std_mm``. ``free`` is the line with its own slope, ``fixed`` the one with slope 1. ``pixel_rms_mm`` is
    the scatter of single pixels about their planes; ``patch_rms_mm`` the published figure: means of patches
    about lines of their own, None where no patch is seen at all positions.
    """

    positions_mm: tuple[float, ...]
    distances_mm: tuple[float, ...]
    std_mm: tuple[float, ...]
    free: StageLine
    fixed: StageLine
    pixel_rms_mm: float
    patch_rms_mm: float | None
    patches: int


def stage_test(positions_mm: Sequence[float], targets: Sequence[SeenTarget]) -> StageTest:
    """Judge a flat target over positions of a stage, in any order.

    Raises `DecodeError` for fewer than three positions, positions that are not numbers or all alike, and
    pictures of different sizes.
    """
    _require_positions(positions_mm, targets)
    place = np.mean([target.middle_mm for target in targets], axis=0)
    found = [target.depth_at(float(place[0]), float(place[1])) for target in targets]
    at, distance, std = np.array(positions_mm), np.array([d for d, _ in found]), [s for _, s in found]
    patch_rms, patches = _patch_straightness(positions_mm, targets)
    return StageTest(
        tuple(map(float, positions_mm)),
        tuple(distance.tolist()),
        tuple(std),
        _line(at, distance, std, float(np.polyfit(at - at.mean(), distance, 1)[0]), known=2),
        _line(at, distance, std, 1.0, known=1),
        float(np.sqrt(np.mean([target.plane.rms_mm**2 for target in targets]))),
        patch_rms,
        patches,
    )


def _require_positions(positions_mm: Sequence[float], targets: Sequence[SeenTarget]) -> None:
    if len(positions_mm) != len(targets):
        raise DecodeError(
            f"{len(targets)} results and {len(positions_mm)} positions were given; give one for each."
        )
    if len(positions_mm) < MIN_POSITIONS:
        raise DecodeError(
            f"A line needs {MIN_POSITIONS} positions of the stage to be tested, there are"
            f" {len(positions_mm)}. Add results at other positions."
        )
    if not all(math.isfinite(position) for position in positions_mm):
        raise DecodeError("A position of the stage is not a number. Give each in mm, like 695.2.")
    if max(positions_mm) == min(positions_mm):
        raise DecodeError(
            f"All positions of the stage are {positions_mm[0]:g} mm, so no line can be drawn. Give the"
            " position at which each result was captured."
        )
    sizes = {target.shape for target in targets}
    if len(sizes) > 1:
        words = " and ".join(f"{width} x {height}" for height, width in sorted(sizes))
        raise DecodeError(f"The results have {words} pixels. Choose results of one camera and region.")


def _line(at: Floats, distance: Floats, std: Sequence[float], scale: float, known: int) -> StageLine:
    """The line of a slope through the middle of all points; ``known`` of its parameters are fitted."""
    middle = at - at.mean()
    off = distance - distance.mean() - scale * middle
    # Few points may lie straight by chance: no point is more certain than its plane.
    scatter = math.sqrt(max(float(off @ off) / (len(at) - known), float(np.mean(np.square(std)))))
    return StageLine(
        scale=scale,
        scale_std=scatter / float(np.sqrt(middle @ middle)) if known > 1 else 0.0,
        offset_mm=float(distance.mean() - at.mean()),
        offset_std_mm=scatter / math.sqrt(len(at)),
        deviations_mm=tuple(off.tolist()),
    )


def _patch_straightness(
    positions_mm: Sequence[float], targets: Sequence[SeenTarget]
) -> tuple[float | None, int]:
    """Root mean square over patches that are seen at all positions, and how many those are."""
    depths = np.stack([target.patches_mm.ravel() for target in targets])
    seen = depths[:, np.isfinite(depths).all(axis=0)].T
    if not len(seen):
        return None, 0
    return float(np.sqrt(np.mean([straightness_mm(positions_mm, patch) ** 2 for patch in seen]))), len(seen)


def stage_table(found: StageTest) -> tuple[Verdict, ...]:
    """The figures as rows of a table."""
    free, fixed = found.free, found.fixed
    rows = [
        Verdict("Straightness, slope free (RMS)", f"{free.rms_mm:.4f}", "mm"),
        Verdict("Worst deviation, slope free", f"{free.worst_mm:.4f}", "mm"),
        estimate_row("Slope of distance over position", free.scale, free.scale_std, "", ".5f"),
        Verdict("Straightness, slope fixed to 1 (RMS)", f"{fixed.rms_mm:.4f}", "mm"),
        Verdict("Worst deviation, slope fixed to 1", f"{fixed.worst_mm:.4f}", "mm"),
        estimate_row("Distance minus position", fixed.offset_mm, fixed.offset_std_mm, "mm", "+.4f"),
        Verdict("Single pixels about their plane (RMS)", f"{found.pixel_rms_mm:.3f}", "mm"),
    ]
    if found.patch_rms_mm is not None:
        words = f"Means of {found.patches} patches (RMS, as published)"
        rows.append(Verdict(words, f"{found.patch_rms_mm:.4f}", "mm"))
    return (*rows, Verdict("Positions", str(len(found.positions_mm))))
