"""Curves as coordinates of small vector drawings; colours are left to the page's style."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.uncertainty import BAND_95, Calibration
from dsl_core.optics.cie_tables import CIE_1931_XYZ, CIE_NM
from dsl_core.optics.colour import reflectance_to_srgb, xyz_to_srgb

Floats = NDArray[np.float64]
#: Inner size of a drawing, in its own units.
WIDTH, HEIGHT = 200.0, 96.0


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
    top = _nice_top(float(max(np.nanmax(each) for each in shown)))
    x = (bands - bands[0]) / (bands[-1] - bands[0]) * WIDTH
    outline = ""
    if std is not None:
        upper, lower = values + BAND_95 * std, values - BAND_95 * std
        outline = points(np.r_[x, x[::-1]], np.r_[upper, lower[::-1]], top)
    return Curve(
        title,
        note,
        points(x, values, top),
        outline,
        "" if truth is None else points(x, truth, top),
        _css(values, bands),
        "" if truth is None else _css(truth, bands),
        wavelength_ticks(bands),
        (Tick(HEIGHT, "0"), Tick(0.0, f"{top:g}")),
    )


def share_curve(bands: Floats, share: Floats) -> Curve:
    """The mean share of data in each band, shape (bands,)."""
    x = (bands - bands[0]) / (bands[-1] - bands[0]) * WIDTH
    ticks = (Tick(HEIGHT, "0"), Tick(0.0, "1"))
    note = "mean over pixels: 1 is decided by data alone, 0 by the prior alone"
    return Curve("Share of data", note, points(x, share, 1.0), x_ticks=wavelength_ticks(bands), y_ticks=ticks)


def calibration_curve(title: str, found: Calibration) -> Curve:
    """Observed over promised coverage; the dashed diagonal is honesty."""
    promised, observed = np.array([(0.0, 0.0), *found.curve, (1.0, 1.0)]).T
    ticks = (Tick(0.0, "0 %"), Tick(WIDTH, "100 % promised"))
    note = f"95 % band holds {found.coverage_95:.1%} of the truth; error / std = {found.spread:.2f}"
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
    """SVG points; values outside the drawing are cut at its rim, values that are not finite left out."""
    height = (1.0 - np.clip(y / top, -0.04, 1.04)) * HEIGHT
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, height, strict=True) if np.isfinite(b))


def _nice_top(largest: float) -> float:
    """The smallest pleasant axis end that holds the data."""
    return next((top for top in (0.1, 0.2, 0.4, 0.6, 0.8, 1.0) if largest <= top), np.ceil(largest * 2) / 2)


def wavelength_ticks(bands: Floats) -> tuple[Tick, ...]:
    """Ticks at round wavelengths between the first and the last band (nm), which span the width."""
    first, last = float(bands[0]), float(bands[-1])
    step = 50.0 if last - first <= 400 else 200.0
    inner = np.arange(np.ceil(first / step) * step, last + 1, step)
    return tuple(Tick((nm - first) / (last - first) * WIDTH, f"{nm:g}") for nm in inner.tolist())


def _css(spectrum: Floats, bands: Floats) -> str:
    return _hex(reflectance_to_srgb(np.asarray(spectrum, np.float64), bands))


def _hex(rgb: NDArray[np.float32]) -> str:
    r, g, b = (np.nan_to_num(rgb) * 255 + 0.5).astype(int).tolist()
    return f"#{r:02x}{g:02x}{b:02x}"
