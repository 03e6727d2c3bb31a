"""Several curves over wavelength in one small vector drawing, each with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.report.curves import HEIGHT, WIDTH, Tick, points, wavelength_ticks
from dsl_core.evaluation.uncertainty import BAND_95
from dsl_core.model.spectral import SpectralCurve

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """A curve of a chart: its name, CSS colour, SVG points of the line and of its 95 % band."""

    name: str
    colour: str
    line: str
    band: str = ""


@dataclass(frozen=True)
class Chart:
    """Curves that share their axes, with ticks and words."""

    title: str
    note: str
    traces: tuple[Trace, ...]
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]


def wavelength_chart(title: str, note: str, curves: Sequence[tuple[str, str, SpectralCurve]]) -> Chart:
    """Curves given as (name, CSS colour, curve) over their common range of wavelengths."""
    low = min(curve.wavelengths_nm[0] for _, _, curve in curves)
    high = max(curve.wavelengths_nm[-1] for _, _, curve in curves)
    top = _nice_top(max(max(curve.values) for _, _, curve in curves))
    span = np.array([low, high if high > low else low + 1.0])
    unit = next((curve.unit for _, _, curve in curves if curve.unit != "1"), "")
    return Chart(
        title,
        note,
        tuple(_trace(name, colour, curve, span, top) for name, colour, curve in curves),
        wavelength_ticks(span),
        (Tick(HEIGHT, "0"), Tick(0.0, f"{top:g} {unit}".strip())),
    )


def _trace(name: str, colour: str, curve: SpectralCurve, span: Floats, top: float) -> Trace:
    x = (np.array(curve.wavelengths_nm) - span[0]) / (span[1] - span[0]) * WIDTH
    values = np.array(curve.values)
    band = ""
    if curve.std is not None:
        spread = BAND_95 * np.array(curve.std)
        band = points(np.r_[x, x[::-1]], np.r_[values + spread, (values - spread)[::-1]], top)
    return Trace(name, colour, points(x, values, top), band)


def _nice_top(largest: float) -> float:
    """The smallest of 1, 1.2, 1.5, 2, 3, 4, 5, 6, 8, 10 times a power of ten that holds the data."""
    if not largest > 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return next(factor * power for factor in (1, 1.2, 1.5, 2, 3, 4, 5, 6, 8, 10) if largest <= factor * power)
