"""Depth against truth: per pixel, as a plane, and over the positions of a stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.scatter import mean_std, rms_std

Floats = NDArray[np.float64] | NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class DepthScore:
    """Errors of depth in mm over pixels that have truth, light and a depth.

    ``coverage`` is the share of lit pixels that have a depth, ``within_1_mm`` the share of lit pixels
    whose depth is right to a millimetre (a pixel without depth is wrong); ``bias_mm`` is the mean of
    measured minus true. The deviations of RMSE and bias follow from their scatter over the picture.
    """

    pixels: int
    coverage: float
    rmse_mm: float
    mae_mm: float
    bias_mm: float
    median_abs_mm: float
    within_1_mm: float
    rmse_std_mm: float | None = None
    bias_std_mm: float | None = None


def depth_score(depth_mm: Floats, truth_mm: Floats, lit: Mask | None = None) -> DepthScore:
    """Compare two depth maps (h, w), NaN where there is none, over lit pixels (default: all with truth).

    Raises `DecodeError` when the shapes differ or no pixel can be compared.
    """
    if depth_mm.shape != truth_mm.shape or (lit is not None and lit.shape != truth_mm.shape):
        raise DecodeError(
            f"The depth map has {depth_mm.shape} pixels and its truth {truth_mm.shape};"
            " render the truth for the camera that captured the scan."
        )
    wanted = np.isfinite(truth_mm) if lit is None else np.isfinite(truth_mm) & lit
    measured = wanted & np.isfinite(depth_mm)
    if not measured.any():
        raise DecodeError(
            f"None of the {int(wanted.sum())} lit pixels with known depth was measured, so no error can be"
            " given; the flags of the result say why."
        )
    errors = np.where(measured, depth_mm.astype(np.float64) - truth_mm, np.nan)
    error = errors[measured]
    return DepthScore(
        pixels=error.size,
        coverage=error.size / int(wanted.sum()),
        rmse_mm=float(np.sqrt(np.mean(error**2))),
        mae_mm=float(np.mean(np.abs(error))),
        bias_mm=float(np.mean(error)),
        median_abs_mm=float(np.median(np.abs(error))),
        within_1_mm=int((np.abs(error) <= 1.0).sum()) / int(wanted.sum()),
        rmse_std_mm=rms_std(errors),
        bias_std_mm=mean_std(errors),
    )


@dataclass(frozen=True)
class PlaneFit:
    """The plane ``normal . x = offset_mm`` and the distances of the points from it."""

    normal: tuple[float, float, float]
    offset_mm: float
    rms_mm: float
    max_mm: float
    pixels: int


def fit_plane(points_mm: Floats, mask: Mask | None = None) -> PlaneFit:
    """Total least squares plane through points (3, h, w), NaN where there is none; normal towards -z.

    Raises `DecodeError` for fewer than three points.
    """
    chosen = np.isfinite(points_mm).all(axis=0)
    if mask is not None:
        chosen &= mask
    points = points_mm[:, chosen].astype(np.float64)
    if points.shape[1] < 3:
        raise DecodeError(f"A plane needs three measured points, there are {points.shape[1]}.")
    middle = points.mean(axis=1, keepdims=True)
    # The direction of least spread; 3 x 3, so that the number of points does not matter.
    _, vectors = np.linalg.eigh((points - middle) @ (points - middle).T)
    normal = vectors[:, 0] * (-1.0 if vectors[2, 0] > 0 else 1.0)
    distance = normal @ (points - middle)
    return PlaneFit(
        normal=(float(normal[0]), float(normal[1]), float(normal[2])),
        offset_mm=float(normal @ middle[:, 0]),
        rms_mm=float(np.sqrt(np.mean(distance**2))),
        max_mm=float(np.abs(distance).max()),
        pixels=points.shape[1],
    )


def straightness_mm(positions_mm: Sequence[float], depths_mm: Sequence[float]) -> float:
    """RMS distance of mean depths from the best straight line over stage positions.

    This is the published measure of depth accuracy; it hides errors of scale, offset and single pixels.
    """
    line = np.polyfit(positions_mm, depths_mm, 1)
    return float(np.sqrt(np.mean((np.polyval(line, positions_mm) - np.asarray(depths_mm)) ** 2)))
