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
from dsl_core.evaluation.scatter import std_of_rms
from dsl_core.evaluation.seen_target import SeenTarget
from dsl_core.evaluation.verdict import Verdict, estimate_row

Floats = NDArray[np.floating[Any]]
MIN_POSITIONS = 3


@dataclass(frozen=True)
class StageLine:
    """Distances against positions as a straight line.

    ``offset_mm`` is distance minus position in the middle of the positions; ``deviations_mm`` are distances
    minus the line, ``rms_mm`` and ``worst_mm`` their root mean square and largest size. ``rms_std_mm`` is how
    much the first would vary from one set of positions to another, ``worst_std_mm`` the deviation of the
    distance that is worst.
    """

    scale: float
    scale_std: float
    offset_mm: float
    offset_std_mm: float
    deviations_mm: tuple[float, ...]
    rms_std_mm: float
    worst_std_mm: float

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
    about lines of their own, None where no patch is seen at all positions. Both have a deviation by how
    positions, or patches, differ in them.
    """

    positions_mm: tuple[float, ...]
    distances_mm: tuple[float, ...]
    std_mm: tuple[float, ...]
    free: StageLine
    fixed: StageLine
    pixel_rms_mm: float
    patch_rms_mm: float | None
    patches: int
    pixel_rms_std_mm: float | None = None
    patch_rms_std_mm: float | None = None


def stage_test(positions_mm: Sequence[float], targets: Sequence[SeenTarget]) -> StageTest:
    """Judge a flat target over positions of a stage, in any order.

    Raises `DecodeError` for fewer than three positions, positions that are not numbers or all alike, and
    pictures of different sizes.
    """
    _require_positions(positions_mm, targets)
    place = np.mean([target.middle_mm for target in targets], axis=0)
    found = [target.depth_at(float(place[0]), float(place[1])) for target in targets]
    at, distance, std = np.array(positions_mm), np.array([d for d, _ in found]), [s for _, s in found]
    of_patches = _patch_squares(positions_mm, targets)
    of_pixels = [target.plane.rms_mm**2 for target in targets]
    return StageTest(
        tuple(map(float, positions_mm)),
        tuple(distance.tolist()),
        tuple(std),
        _line(at, distance, std, float(np.polyfit(at - at.mean(), distance, 1)[0]), known=2),
        _line(at, distance, std, 1.0, known=1),
        float(np.sqrt(np.mean(of_pixels))),
        float(np.sqrt(np.mean(of_patches))) if of_patches else None,
        len(of_patches),
        std_of_rms(of_pixels),
        std_of_rms(of_patches),
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
        # The sum of squares is distributed as chi squared, whose root is nearly normal.
        rms_std_mm=scatter / math.sqrt(2 * len(at)),
        worst_std_mm=float(std[int(np.abs(off).argmax())]),
    )


def _patch_squares(positions_mm: Sequence[float], targets: Sequence[SeenTarget]) -> list[float]:
    """Mean square off its own line of each patch that is seen at all positions, mm^2."""
    depths = np.stack([target.patches_mm.ravel() for target in targets])
    seen = depths[:, np.isfinite(depths).all(axis=0)].T
    return [straightness_mm(positions_mm, patch) ** 2 for patch in seen]


def stage_table(found: StageTest) -> tuple[Verdict, ...]:
    """The figures as rows of a table."""
    free, fixed = found.free, found.fixed
    rows = [
        estimate_row("Straightness, slope free (RMS)", free.rms_mm, free.rms_std_mm, "mm", ".4f"),
        estimate_row("Worst deviation, slope free", free.worst_mm, free.worst_std_mm, "mm", ".4f"),
        estimate_row("Slope of distance over position", free.scale, free.scale_std, "", ".5f"),
        estimate_row("Straightness, slope fixed to 1 (RMS)", fixed.rms_mm, fixed.rms_std_mm, "mm", ".4f"),
        estimate_row("Worst deviation, slope fixed to 1", fixed.worst_mm, fixed.worst_std_mm, "mm", ".4f"),
        estimate_row("Distance minus position", fixed.offset_mm, fixed.offset_std_mm, "mm", "+.4f"),
        estimate_row(
            "Single pixels about their plane (RMS)", found.pixel_rms_mm, found.pixel_rms_std_mm, "mm", ".3f"
        ),
    ]
    if found.patch_rms_mm is not None:
        words = f"Means of {found.patches} patches (RMS, as published)"
        rows.append(estimate_row(words, found.patch_rms_mm, found.patch_rms_std_mm, "mm", ".4f"))
    return (*rows, Verdict("Positions", str(len(found.positions_mm))))
