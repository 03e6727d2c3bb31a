"""What a person judges the calibration with a Color Checker by."""

from __future__ import annotations

import numpy as np

from dsl_core.model.calibration.color_checker import ColorCheckerCalibration
from dsl_core.model.figure import Figure
from dsl_core.model.spectral import SpectralCurve

#: Limits in percent of a patch's white.
RESIDUAL, WORST = 1.5, 4.0
#: The chart may be lit so much otherwise (%) than the Spectralon, and tilted so much (degrees).
LEVEL, TILT_DEG = 3.0, 20.0
#: Where curves are judged, nm.
BANDS_NM = (430.0, 660.0)


def _deviation(curve: SpectralCurve) -> float:
    """Median deviation of a curve over the bands, as a share of its peak."""
    nm = np.array(curve.wavelengths_nm)
    bands = (nm >= BANDS_NM[0]) & (nm <= BANDS_NM[1])
    return float(np.median(np.array(curve.std or (0.0,) * len(nm))[bands])) / max(curve.values)


def color_checker_figures(record: ColorCheckerCalibration) -> tuple[Figure, ...]:
    """Patches, residuals and the chart's level, each with its limits and what to do."""
    worst = max(record.patches, key=lambda patch: patch.held_out)
    deviation = max(_deviation(curve) for curve in record.response)
    return (
        Figure(name="patches found", value=len(record.patches), unit="", low=24, high=24),
        Figure(
            name="residual before the refinement", value=100 * record.start, unit="% of white"
        ),
        Figure(name="residual", value=100 * record.residual, unit="% of white", high=RESIDUAL),
        Figure(
            name="residual of patches held out",
            value=100 * record.held_out,
            unit="% of white",
            high=RESIDUAL,
            advice="Clean the chart, keep reflections off, and check that its reflectances are those of this"
            " edition.",
        ),
        Figure(
            name="residual of patches held out, published weight",
            value=100 * record.published_held_out,
            unit="% of white",
        ),
        Figure(
            name=f"worst patch held out ({worst.name})",
            value=100 * worst.held_out,
            unit="% of white",
            high=WORST,
            advice=f"Look at the patch {worst.name!r}: dust, scratches, gloss or shadow.",
        ),
        Figure(
            name="deviation of the response, of its peak", value=100 * deviation, unit="%", high=3.0,
            advice="Expose longer, or place the chart closer.",
        ),
        Figure(
            name="light on the chart against the Spectralon",
            value=100 * record.chart_level,
            unit="%",
            low=-LEVEL,
            high=LEVEL,
            advice="Keep other light and shadows off, and check the Spectralon's certified reflectance.",
        ),
        Figure(
            name="tilt of the chart", value=record.tilt_deg, unit="degrees", high=TILT_DEG,
            advice="Turn the chart to face the camera.",
        ),
    )  # fmt: skip
