"""Why a pixel is not what it could be, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.uncertainty import DECIDED_FROM
from dsl_core.model.result import REASONS, Flag


def explain_pixel(
    flags: int,
    wavelengths_nm: NDArray[np.float64],
    data_share: NDArray[np.floating] | None = None,
    depth_std_mm: float | None = None,
) -> list[str]:
    """Sentences on every flag of a pixel, with the bands or deviations that belong to it; empty when good."""
    sentences = []
    for flag, reason in REASONS.items():
        if not flags & flag:
            continue
        if flag is Flag.BANDS_UNREACHED and data_share is not None:
            ranges = undecided_ranges(wavelengths_nm, data_share)
            reason = f"{reason}: {ranges}" if ranges else reason
        if flag is Flag.NOT_REFINED and depth_std_mm is not None and np.isfinite(depth_std_mm):
            reason = f"{reason} (±{depth_std_mm:.2g} mm)"
        sentences.append(reason)
    return sentences


def undecided_ranges(wavelengths_nm: NDArray[np.float64], data_share: NDArray[np.floating]) -> str:
    """Where the prior decides, as text such as ``430–445 nm, 655–660 nm``."""
    with np.errstate(invalid="ignore"):
        undecided = np.asarray(data_share) < DECIDED_FROM
    parts = []
    for first, last in _runs(undecided.tolist()):
        low, high = wavelengths_nm[first], wavelengths_nm[last]
        parts.append(f"{low:g} nm" if first == last else f"{low:g}–{high:g} nm")
    return ", ".join(parts)


def _runs(marks: Sequence[bool]) -> list[tuple[int, int]]:
    """First and last index of each stretch of marks."""
    runs: list[tuple[int, int]] = []
    for i, mark in enumerate(marks):
        if mark and runs and runs[-1][1] == i - 1:
            runs[-1] = (runs[-1][0], i)
        elif mark:
            runs.append((i, i))
    return runs
