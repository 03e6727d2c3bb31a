"""What a person judges the calibration with bandpass filters by."""

from __future__ import annotations

from typing import Any

import numpy as np

from dsl_core.model.calibration.bandpass import BandpassCalibration
from dsl_core.model.figure import Figure
from dsl_core.model.spectral import SpectralCurve


def bandpass_figures(record: BandpassCalibration) -> tuple[Figure, ...]:
    """Deviations of efficiency and response, second orders, blur and halo, and filters in doubt."""
    centres = np.array([each.effective_nm for each in record.filters])
    figures = [
        Figure(
            name=f"efficiency of order {order:+d}, deviation",
            value=100 * float(np.median(_relative_std(record.efficiency[order], centres))),
            unit="%",
            high=2.0,
            advice="Use more filters, or a longer second exposure (long_ratio).",
        )
        for order in (1, -1)
    ]
    figures += [
        Figure(
            name=f"response of {colour}, deviation",
            value=100 * float(np.median(_relative_std(curve, centres[_bright(curve, centres)]))),
            unit="%",
            high=5.0,
            advice="Measure the filters' transmissions, or calibrate with a Color Checker first.",
        )
        for colour, curve in zip(("red", "green", "blue"), record.response, strict=True)
    ]
    halo = 200 * record.halo_decay_px
    figures += [
        _plain(
            "second orders",
            "% of first",
            100 * record.second_order_share,
            100 * record.second_order_share_std,
        ),
        _plain("halo", "% of zero order", halo * record.halo_peak_per_px, halo * record.halo_peak_std_per_px),
        Figure(
            name="blur of the projector",
            value=record.blur_px,
            unit="px",
            std=record.blur_std_px,
            high=2.0,
            advice="Focus the projector on the target.",
        ),
        Figure(
            name="filters in doubt",
            value=float(len(record.warnings)),
            unit="",
            high=0.0,
            advice=". ".join(record.warnings),
        ),
    ]
    return tuple(figures)


def _plain(name: str, unit: str, value: float, std: float) -> Figure:
    return Figure(name=name, value=value, unit=unit, std=std)


def _relative_std(curve: SpectralCurve, nm: Any) -> Any:
    std = curve.std or (0.0,) * len(curve.values)
    return np.interp(nm, curve.wavelengths_nm, std) / np.maximum(np.abs(curve.at(nm)), 1e-12)


def _bright(curve: SpectralCurve, nm: Any) -> Any:
    """Wavelengths at which a response is not negligible."""
    return curve.at(nm) > 0.05 * max(curve.values)
