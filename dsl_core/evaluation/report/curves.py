"""Curves as coordinates of small vector drawings, alone or several with common axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.uncertainty import HonestyCheck
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.colour import CIE_1931_XYZ, CIE_NM, reflectance_to_srgb, xyz_to_srgb
from dsl_core.solve.normal import BAND_95

Floats = NDArray[np.float64]
#: Inner size of a drawing, in its own units.
WIDTH, HEIGHT = 200.0, 96.0
_LEAST_TOP = 0.1


@dataclass(frozen=True)
class Tick:
    """A labelled place on an axis."""

    at: float
    label: str


@dataclass(frozen=True)
class Curve:
    """One drawing: SVG point lists, ticks, words and two swatches (CSS colours, may be empty)."""

    title: str
    note: str
    line: str
    band: str = ""
    truth: str = ""
    swatch: str = ""
    truth_swatch: str = ""
    x_ticks: tuple[Tick, ...] = ()
    y_ticks: tuple[Tick, ...] = ()


def spectrum_curve(
    title: str,
    note: str,
    bands: Floats,
    values: Floats,
    std: Floats | None = None,
    truth: Floats | None = None,
) -> Curve:
    """A reflectance spectrum with its 95 % band and, where known, the truth; all of shape (bands,)."""
    shown = [values] + ([truth] if truth is not None else [])
    if std is not None:
        # Most of the band has to fit, too; where it is wide for want of light, it may leave the drawing.
        reach = values + BAND_95 * std
        reach = reach[np.isfinite(reach)]
        shown.append(np.median(reach, keepdims=True) if reach.size else reach)
    known = np.concatenate(shown)
    # A dark patch is not drawn larger than this: its noise would fill the drawing.
    top = _nice_top(max(_LEAST_TOP, *known[np.isfinite(known)].tolist()))
    x = _across(bands)
    return Curve(
        title,
        note,
        points(x, values, top),
        _band(x, values, std, top),
        "" if truth is None else points(x, truth, top),
        _css(values, bands),
        "" if truth is None else _css(truth, bands),
        wavelength_ticks(bands),
        (Tick(HEIGHT, "0"), Tick(0.0, f"{top:g}")),
    )


def share_curve(bands: Floats, share: Floats) -> Curve:
    """The mean share of data in each band, shape (bands,)."""
    x = _across(bands)
    ticks = (Tick(HEIGHT, "0"), Tick(0.0, "1"))
    note = "mean over pixels: 1 is decided by data alone, 0 by the prior alone"
    return Curve("Data share", note, points(x, share, 1.0), x_ticks=wavelength_ticks(bands), y_ticks=ticks)


def _across(bands: Floats) -> Floats:
    """Where bands are over the width; a single one is both ends of a level line, as a point draws nothing."""
    if len(bands) == 1:
        return np.array([0.0, WIDTH])
    return np.asarray((bands - bands[0]) / (bands[-1] - bands[0]) * WIDTH)


def calibration_curve(title: str, found: HonestyCheck) -> Curve:
    """Observed over promised coverage; the dashed diagonal is honesty."""
    promised, observed = np.array([(0.0, 0.0), *found.curve, (1.0, 1.0)]).T
    ticks = (Tick(0.0, "0 %"), Tick(WIDTH, "100 % promised"))
    note = f"95 % band contains {found.coverage_95:.1%} of the truth; error / std = {found.spread:.2f}"
    return Curve(
        title,
        note,
        points(promised * WIDTH, observed, 1.0),
        truth=points(np.array([0.0, WIDTH]), np.array([0.0, 1.0]), 1.0),
        x_ticks=ticks,
        y_ticks=(Tick(HEIGHT, "0"), Tick(0.0, "1")),
    )


def rainbow(bands: Floats) -> list[tuple[float, str]]:
    """Offsets 0..1 and CSS colours of monochromatic light over the bands, for the wavelength axis."""
    nm = np.linspace(bands[0], bands[-1], 24)
    xyz = np.stack([np.interp(nm, CIE_NM, row) for row in CIE_1931_XYZ])
    rgb = xyz_to_srgb(xyz / xyz.sum(axis=0) * 0.55)
    return [(i / 23, _hex(rgb[:, i])) for i in range(24)]


def points(x: Floats, y: Floats, top: float) -> str:
    """SVG points; values outside the drawing are cut at its rim, values that are not finite left out.

    A single value is that of all places.
    """
    height = (1.0 - np.clip(np.where(np.isfinite(y), y, np.nan) / top, -0.04, 1.04)) * HEIGHT
    level = np.broadcast_to(height, x.shape)
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, level, strict=True) if np.isfinite(b))


def wavelength_ticks(bands: Floats) -> tuple[Tick, ...]:
    """Ticks at round wavelengths between the first and the last band (nm), which span the width."""
    first, last = float(bands[0]), float(bands[-1])
    if first == last:
        return (Tick(WIDTH / 2, f"{first:g}"),)
    step = 50.0 if last - first <= 400 else 200.0
    inner = np.arange(np.ceil(first / step) * step, last + 1, step)
    return tuple(Tick((nm - first) / (last - first) * WIDTH, f"{nm:g}") for nm in inner.tolist())


def _css(spectrum: Floats, bands: Floats) -> str:
    return _hex(reflectance_to_srgb(np.asarray(spectrum, np.float64), bands))


def _hex(rgb: NDArray[np.float32]) -> str:
    r, g, b = (np.nan_to_num(rgb) * 255 + 0.5).astype(int).tolist()
    return f"#{r:02x}{g:02x}{b:02x}"


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
    values, std = np.array(curve.values), None if curve.std is None else np.array(curve.std)
    return Trace(name, colour, points(x, values, top), _band(x, values, std, top))


def _band(x: Floats, values: Floats, std: Floats | None, top: float) -> str:
    """SVG points of the outline of a 95 % band, empty where no deviation is known."""
    if std is None:
        return ""
    low, high = (np.broadcast_to(values + side * BAND_95 * std, x.shape) for side in (-1, 1))
    return points(np.r_[x, x[::-1]], np.r_[high, low[::-1]], top)


def _nice_top(largest: float) -> float:
    """The smallest of 1, 1.2, 1.5, 2, 3, 4, 5, 6, 8, 10 times a power of ten that holds the data."""
    if not largest > 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return next(factor * power for factor in (1, 1.2, 1.5, 2, 3, 4, 5, 6, 8, 10) if largest <= factor * power)
