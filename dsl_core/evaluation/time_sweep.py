"""A sweep: what scans of one scene reached, against the seconds that their capture took."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dsl_core.errors import DecodeError
from dsl_core.evaluation.difference import ResultDifference
from dsl_core.evaluation.summary import Evaluation
from dsl_core.model.figure import with_std_in_places
from dsl_core.solve.front import front


@dataclass(frozen=True)
class SweepFigure:
    """An error of `SweepPoint`: its field, that of its standard deviation, words, unit and format."""

    field: str
    std_field: str
    words: str
    unit: str
    form: str


FIGURES = (
    SweepFigure("depth_mm", "depth_std_mm", "Depth, RMSE per pixel", "mm", ".3f"),
    SweepFigure("reflectance", "reflectance_std", "Reflectance, RMSE of single pixels", "", ".4f"),
    SweepFigure("angle_rad", "angle_std_rad", "Mean spectral angle", "rad", ".4f"),
)


@dataclass(frozen=True)
class SweepPoint:
    """A scan's seconds and errors, None where there is none, and how sure these errors are."""

    name: str
    seconds: float
    depth_mm: float | None = None
    depth_std_mm: float | None = None
    reflectance: float | None = None
    reflectance_std: float | None = None
    angle_rad: float | None = None
    angle_std_rad: float | None = None

    def error(self, figure: SweepFigure) -> float | None:
        """The error of a figure."""
        value = getattr(self, figure.field)
        return None if value is None else float(value)

    def std(self, figure: SweepFigure) -> float | None:
        """The standard deviation of that error, by its scatter over picture or patches."""
        value = getattr(self, figure.std_field)
        return None if value is None else float(value)

    def words(self, figure: SweepFigure) -> str:
        """The error of a figure, with its standard deviation where that is known."""
        error, std = self.error(figure), self.std(figure)
        if error is None:
            return "–"
        return with_std_in_places(error, std, figure.form)


def point_against_truth(name: str, seconds: float, found: Evaluation) -> SweepPoint:
    """What a scan reached against known truth."""
    return SweepPoint(
        name,
        seconds,
        None if found.depth is None else found.depth.rmse_mm,
        None if found.depth is None else found.depth.rmse_std_mm,
        found.pixel_rmse if found.patches else None,
        found.pixel_rmse_std,
        found.mean("angle_rad") if found.patches else None,
        found.mean_std("angle_rad"),
    )


def point_against_result(name: str, seconds: float, found: ResultDifference) -> SweepPoint:
    """How far a scan is from a reference scan."""
    return SweepPoint(
        name,
        seconds,
        found.depth_rms_mm,
        found.depth_rms_std_mm,
        found.reflectance_rms,
        found.reflectance_rms_std,
        found.mean_angle_rad,
        found.mean_angle_std_rad,
    )


def require_sweep(points: Sequence[SweepPoint]) -> None:
    """Raise `DecodeError` when there is nothing to compare."""
    if len(points) < 2:
        raise DecodeError(
            f"A sweep needs two scans of one scene, there are {len(points)}. Add results of other plans."
        )


def best_points(points: Sequence[SweepPoint], figure: SweepFigure) -> list[int]:
    """Numbers of the points that none beats in both seconds and this error, from quick to slow.

    Of equal points all are named.
    """
    errors = [(i, point.error(figure)) for i, point in enumerate(points)]
    known = {i: (points[i].seconds, error) for i, error in errors if error is not None}
    pairs = list(known.values())
    best = {pairs[k] for k in front(pairs)}
    return sorted((i for i, pair in known.items() if pair in best), key=lambda i: known[i])
