"""The figures of a forecast: names, formats, and their fields in predictions and measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dsl_app.scan.forecast.state import MeasuredScan

if TYPE_CHECKING:
    from dsl_core.planning.expected import Prediction

NOTHING = "–"


@dataclass(frozen=True)
class ForecastFigure:
    """A figure: its field in `Prediction`, its format, and its field in `MeasuredScan` if different."""

    field: str
    title: str
    tip: str
    read: Callable[[float], str]
    measured: str = ""
    #: Axis title of the curve of this figure; empty for figures without a curve.
    axis: str = ""
    #: The value that is best; 0 for errors.
    target: float = 0.0

    def expected(self, prediction: Prediction | None) -> str:
        """The predicted value as text."""
        return _words(self, None if prediction is None else getattr(prediction, self.field))

    def found(self, scan: MeasuredScan | None) -> str:
        """The measured value as text."""
        return _words(self, None if scan is None else getattr(scan, self.measured or self.field))


def _words(figure: ForecastFigure, value: float | None) -> str:
    return NOTHING if value is None else figure.read(value)


def minutes(seconds: float) -> str:
    """A duration as text.

    >>> minutes(45.0), minutes(204.0)
    ('45 s', '3.4 min')
    """
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.1f} min"


def volume(count: float) -> str:
    """A number of bytes as text.

    >>> volume(46_096_080)
    '46 MB'
    """
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.0f} MB"


FIGURES: tuple[ForecastFigure, ...] = (
    ForecastFigure(
        "rmse",
        "Reflectance, patch",
        "RMSE over the bands of the mean spectrum of a patch",
        "{:.4f}".format,
        axis="RMSE",
    ),
    ForecastFigure(
        "pixel_rmse",
        "Reflectance, pixel",
        "RMSE over the bands of single pixels",
        "{:.4f}".format,
        axis="RMSE",
    ),
    ForecastFigure(
        "pixel_angle_rad",
        "Angle, pixel",
        "Angle between measured and true spectrum of single pixels",
        "{:.3f} rad".format,
        axis="angle (rad)",
    ),
    ForecastFigure(
        "delta_e", "Colour ΔE00", "CIEDE2000 under D65, of patch means", "{:.2f}".format, axis="ΔE00"
    ),
    ForecastFigure(
        "fwhm_nm",
        "Width of 10 nm",
        "Measured width (FWHM) of a 10 nm filter",
        "{:.1f} nm".format,
        axis="FWHM (nm)",
        target=10.0,
    ),
    ForecastFigure(
        "depth_std_mm",
        "Depth, pixel",
        "Depth error of single pixels, without that of the calibration",
        "{:.2f} mm".format,
        "depth_rmse_mm",
        axis="error (mm)",
    ),
    ForecastFigure(
        "coverage",
        "Coverage",
        "Expected: share of the picture with a depth. Measured: share of the lit part",
        lambda value: f"{100 * value:.0f} %",
    ),
    ForecastFigure("frames", "Frames", "All exposures, including code and black", "{:.0f}".format),
    ForecastFigure(
        "seconds",
        "Capture",
        "Exposures and the projector's latency. Not measured on a simulated rig, which does not wait, nor of"
        " a scan that was resumed",
        minutes,
    ),
    ForecastFigure(
        "computing_s",
        "Reconstruction",
        "Expected: on a computer of two cores. Measured: on this one",
        minutes,
    ),
)

#: Figures that the curve can show; that of single pixels is shown first.
CURVES = tuple(sorted((f for f in FIGURES if f.axis), key=lambda figure: figure.field != "pixel_rmse"))
