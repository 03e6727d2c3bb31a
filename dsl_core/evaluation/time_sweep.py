"""A sweep: what scans of one scene reached, against the seconds that their capture took."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.evaluation.difference import ResultDifference
from dsl_core.evaluation.summary import Evaluation
from dsl_core.solve.front import front

Floats = NDArray[np.floating[Any]]
#: Blocks that the scatter of an error is judged by, rows and columns: pixels near each other err alike.
_BLOCKS = (6, 8)


@dataclass(frozen=True)
class SweepFigure:
    """An error of `SweepPoint`: its field, words, unit and format."""

    field: str
    words: str
    unit: str
    form: str


FIGURES = (
    SweepFigure("depth_mm", "Depth, RMSE per pixel", "mm", ".3f"),
    SweepFigure("reflectance", "Reflectance, RMSE of single pixels", "", ".4f"),
    SweepFigure("angle_rad", "Mean spectral angle", "rad", ".4f"),
)


@dataclass(frozen=True)
class SweepPoint:
    """A scan's seconds and errors, None where there is none; ``depth_std_mm`` is that of the RMSE itself."""

    name: str
    seconds: float
    depth_mm: float | None = None
    depth_std_mm: float | None = None
    reflectance: float | None = None
    angle_rad: float | None = None

    def error(self, figure: SweepFigure) -> float | None:
        """The error of a figure."""
        value = getattr(self, figure.field)
        return None if value is None else float(value)

    def words(self, figure: SweepFigure) -> str:
        """The error of a figure, with its standard deviation where that is known."""
        error = self.error(figure)
        if error is None:
            return "–"
        std = self.depth_std_mm if figure.field == "depth_mm" else None
        return f"{error:{figure.form}}" + ("" if std is None else f" ± {std:{figure.form}}")


def point_against_truth(
    name: str, seconds: float, found: Evaluation, depth_error_mm: Floats | None
) -> SweepPoint:
    """What a scan reached against known truth; ``depth_error_mm`` (h, w), NaN where it does not count."""
    spectra = bool(found.patches)
    squares = [patch.pixel_rmse**2 for patch in found.patches]
    return SweepPoint(
        name,
        seconds,
        None if found.depth is None else found.depth.rmse_mm,
        None if depth_error_mm is None else rms_std(depth_error_mm),
        math.sqrt(sum(squares) / len(squares)) if spectra else None,
        found.mean("angle_rad") if spectra else None,
    )


def point_against_result(
    name: str, seconds: float, found: ResultDifference, depth_error_mm: Floats
) -> SweepPoint:
    """How far a scan is from another one that is taken for the best."""
    return SweepPoint(
        name,
        seconds,
        found.depth_rms_mm,
        rms_std(depth_error_mm),
        found.reflectance_rms,
        found.mean_angle_rad,
    )


def rms_std(error: Floats) -> float | None:
    """Standard deviation of the RMS of an error map (h, w), by blocks; None where too few have any."""
    squares = []
    for rows in np.array_split(np.asarray(error, np.float64), _BLOCKS[0], axis=0):
        for block in np.array_split(rows, _BLOCKS[1], axis=1):
            known = block[np.isfinite(block)]
            if known.size:
                squares.append(float(np.mean(known**2)))
    if len(squares) < 2 or not any(squares):
        return None
    # The root halves the relative deviation of the mean square.
    spread = float(np.std(squares, ddof=1)) / math.sqrt(len(squares))
    return spread / (2 * math.sqrt(float(np.mean(squares))))


def require_sweep(points: Sequence[SweepPoint]) -> None:
    """Raise `DecodeError` when there is nothing to compare."""
    if len(points) < 2:
        raise DecodeError(
            f"A sweep needs two scans of one scene, there are {len(points)}. Add results of other plans."
        )


def best_points(points: Sequence[SweepPoint], figure: SweepFigure) -> list[int]:
    """Numbers of the points that none beats in both seconds and this error, from quick to slow."""
    known = [(i, error) for i, point in enumerate(points) if (error := point.error(figure)) is not None]
    return [known[k][0] for k in front([(points[i].seconds, error) for i, error in known])]
