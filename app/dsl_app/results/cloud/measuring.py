"""Distances, sections and planes that are measured in the 3D view. No Qt."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from dsl_app.shared.spectrum import Pixel
from dsl_core.evaluation.marks import distance_between
from dsl_core.evaluation.shape import PlaneFit, Section, fit_plane, section
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.figure import with_std
from dsl_core.words import in_groups


class Measure(Enum):
    """What clicks in the 3D view measure; the value is what to do for it."""

    NOTHING = ""
    DISTANCE = "Click two points to measure their distance."
    SECTION = "Click two points to cut the surface between them."
    PLANE = "Draw around points to fit a plane to them."


@dataclass(frozen=True)
class Measured:
    """What a measurement found: a sentence, the ends of a line, and a section's curve."""

    text: str
    ends: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    section: Section | None = None


def measure_points(result: ResultArrays, kind: Measure, first: Pixel, last: Pixel) -> Measured:
    """The distance or section between two pixels that have points."""
    a, b = (np.asarray(result.at("points_mm", pixel), np.float64) for pixel in (first, last))
    std = result.known("depth_std_mm")
    a_std, b_std = (0.0 if std is None else float(std[pixel[1], pixel[0]]) for pixel in (first, last))
    distance = distance_between(a, b, a_std, b_std)
    text = f"Distance {with_std(distance.mm, distance.std_mm, 3)} mm"
    if kind is Measure.DISTANCE:
        return Measured(text, (a, b))
    cut = section(result["points_mm"], std, first, last)
    if cut is None:
        return Measured("There is no section between these two points: choose two that are apart.")
    low, high = np.nanmin(cut.height_mm), np.nanmax(cut.height_mm)
    span = f"height from {low:.2f} to {high:.2f} mm".replace("-", "−")
    return Measured(f"{text}, {span}", (a, b), cut)


def measure_plane(result: ResultArrays, mask: NDArray[np.bool_]) -> Measured:
    """The plane through the points of the pixels of a mask (rows, columns)."""
    std = result.known("depth_std_mm")
    fit = fit_plane(result["points_mm"][:, mask].T, None if std is None else std[mask])
    if fit is None:
        return Measured("No plane fits: at least four points that are not in a line are needed.")
    return Measured(_plane_text(fit))


def _plane_text(fit: PlaneFit) -> str:
    expected = f" (noise alone {fit.expected_mm:.2g})" if np.isfinite(fit.expected_mm) else ""
    left_out = f", {in_groups(fit.points - fit.used)} too far off" if fit.used < fit.points else ""
    return (
        f"Plane of {in_groups(fit.used)} points{left_out}: flat to {fit.rms_mm:.2g} mm RMS{expected}, range"
        f" {fit.range_mm:.2g} mm, tilt {with_std(fit.tilt_deg, fit.tilt_std_deg, 4)}°"
    )
