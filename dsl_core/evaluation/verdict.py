"""Figures against goals, as rows of a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from dsl_core.evaluation.summary import Evaluation
from dsl_core.model.figure import in_places


@dataclass(frozen=True)
class Verdict:
    """A figure with its unit, its goal, and whether the goal is met (None: no goal).

    ``std`` is the standard deviation of a figure that is estimated, in its unit; empty for others.
    """

    figure: str
    value: str
    unit: str = ""
    wanted: str = ""
    passed: bool | None = None
    std: str = ""

    @property
    def words(self) -> str:
        """The value, with its deviation where it has one."""
        return f"{self.value} ± {self.std}" if self.std else self.value


def estimate_row(
    figure: str,
    value: float,
    std: float | None,
    unit: str,
    form: str,
    wanted: str = "",
    passed: bool | None = None,
) -> Verdict:
    """A row for a figure and its standard deviation, to as many places as ``form`` says or more."""
    shown, spread = in_places(value, std, form)
    return Verdict(figure, shown.rstrip("%"), unit, wanted, passed, spread)


@dataclass(frozen=True)
class Goal:
    """The goal for a figure: at most ``limit``, or at least where ``at_least``."""

    limit: float
    at_least: bool = False

    def met(self, value: float) -> bool:
        """Whether a value is good enough."""
        return value >= self.limit if self.at_least else value <= self.limit


#: name -> (words, unit, format) of every figure, in the order of the table.
_FIGURES = {
    "depth_rmse_mm": ("Depth, RMSE per pixel", "mm", ".3f"),
    "depth_bias_mm": ("Depth, bias", "mm", "+.3f"),
    "depth_coverage": ("Lit pixels with a depth", "%", ".2%"),
    "depth_within_1_mm": ("Lit pixels right to 1 mm", "%", ".2%"),
    "depth_coverage_95": ("True depth inside the 95 % band", "%", ".1%"),
    "spectral_rmse": ("Reflectance, mean RMSE of patches", "", ".4f"),
    "spectral_worst_rmse": ("Reflectance, worst patch", "", ".4f"),
    "spectral_pixel_rmse": ("Reflectance, RMSE of single pixels", "", ".4f"),
    "spectral_rmse_scaled": ("Reflectance, mean RMSE with a free scale", "", ".4f"),
    "spectral_angle_rad": ("Mean spectral angle", "rad", ".4f"),
    "delta_e": ("Mean colour difference CIEDE2000", "", ".2f"),
    "fwhm_nm": ("Mean width of narrow peaks", "nm", ".2f"),
    "spectral_coverage_95": ("True reflectance inside the 95 % band, where data decide", "%", ".1%"),
}


def figures(evaluation: Evaluation) -> dict[str, float]:
    """Every figure an evaluation has, by name, in SI-like units as named."""
    found: dict[str, float] = {}
    if (depth := evaluation.depth) is not None:
        found |= {
            "depth_rmse_mm": depth.rmse_mm,
            "depth_bias_mm": depth.bias_mm,
            "depth_coverage": depth.coverage,
            "depth_within_1_mm": depth.within_1_mm,
        }
    if evaluation.depth_calibration is not None:
        found["depth_coverage_95"] = evaluation.depth_calibration.coverage_95
    if evaluation.patches:
        found |= {
            "spectral_rmse": evaluation.mean("rmse"),
            "spectral_worst_rmse": max(patch.rmse for patch in evaluation.patches),
            "spectral_pixel_rmse": evaluation.pixel_rmse,
            "spectral_rmse_scaled": evaluation.mean("rmse_scaled"),
            "spectral_angle_rad": evaluation.mean("angle_rad"),
            "delta_e": evaluation.mean("delta_e"),
        }
    if evaluation.mean_fwhm_nm is not None:
        found["fwhm_nm"] = evaluation.mean_fwhm_nm
    if evaluation.spectral_calibration is not None:
        found["spectral_coverage_95"] = evaluation.spectral_calibration.coverage_95
    return {name: value for name, value in found.items() if not math.isnan(value)}


def deviations(evaluation: Evaluation) -> dict[str, float]:
    """Standard deviations of figures, by the same names; those that count what is there have none."""
    stds: dict[str, float | None] = {
        "spectral_rmse": evaluation.mean_std("rmse"),
        "spectral_pixel_rmse": evaluation.pixel_rmse_std,
        "spectral_rmse_scaled": evaluation.mean_std("rmse_scaled"),
        "spectral_angle_rad": evaluation.mean_std("angle_rad"),
        "delta_e": evaluation.mean_std("delta_e"),
        "fwhm_nm": evaluation.fwhm_std_nm,
    }
    if (depth := evaluation.depth) is not None:
        stds |= {"depth_rmse_mm": depth.rmse_std_mm, "depth_bias_mm": depth.bias_std_mm}
    return {name: std for name, std in stds.items() if std is not None and not math.isnan(std)}


def verdicts(evaluation: Evaluation, goals: Mapping[str, Goal] | None = None) -> tuple[Verdict, ...]:
    """The figures of an evaluation as rows of a table, judged where there is a goal.

    Raises ``KeyError`` for a goal whose figure does not exist.
    """
    goals = goals or {}
    for name in goals:
        _FIGURES[name]
    rows, stds = [], deviations(evaluation)
    for name, value in figures(evaluation).items():
        words, unit, form = _FIGURES[name]
        goal = goals.get(name)
        wanted = "" if goal is None else f"{'≥' if goal.at_least else '≤'} {goal.limit * _factor(form):.4g}"
        passed = None if goal is None else goal.met(value)
        rows.append(estimate_row(words, value, stds.get(name), unit, form, wanted, passed))
    return tuple(rows)


def _factor(form: str) -> float:
    return 100.0 if form.endswith("%") else 1.0
