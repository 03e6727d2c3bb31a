"""The selected mark as rich text: compared with other marks and references, and its distances to pins."""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.spectrum import number_text
from dsl_app.shared.theme import Theme
from dsl_core.errors import DslError
from dsl_core.evaluation.marks import distance_between, largest_difference
from dsl_core.evaluation.spectral import SpectrumComparison, compare
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.figure import with_std
from dsl_core.model.spectral import SpectralCurve
from dsl_core.words import counted


def comparison_html(state: ResultsState, theme: Theme) -> str:
    """The tables for the selected mark; empty if there is nothing to compare."""
    chosen, result = state.selected_mark, state.result.value
    if chosen is not None and chosen.trouble:
        return f"<span style='color:{theme.warn}'>{escape(chosen.trouble)}</span>"
    if chosen is None or result is None:
        return ""
    shown = [mark for mark in state.marks.value if mark.shown and not mark.trouble and mark.key != chosen.key]
    return (
        region_table(chosen, state.band.value, theme)
        + difference_table(chosen, shown, theme)
        + comparison_table(chosen, shown, state, result, theme)
        + distance_table(chosen, shown, result, theme)
    )


def _table(head: list[str], rows: list[str], theme: Theme) -> str:
    if not rows:
        return ""
    first, *rest = head
    cells = f"<td>{first}</td>" + "".join(f"<td align='right'>{cell}</td>" for cell in rest)
    return (
        f"<table cellspacing='0' cellpadding='3' width='99%'>"
        f"<tr style='color:{theme.muted}'>{cells}</tr>{''.join(rows)}</table>"
    )


def region_table(chosen: Mark, band: int, theme: Theme) -> str:
    """At a band: the mean of a region, by how much its pixels differ, and what is stated for one of them."""
    spectrum, stated = chosen.spectrum, chosen.pixel_std
    if chosen.kind != "region" or spectrum.std is None or stated is None or band >= len(spectrum.nm):
        return ""
    spread = np.nan if chosen.used == 1 else spectrum.std[band]
    figures = (spectrum.mean[band], spread, stated[band])
    head = [f"{escape(chosen.name)}, {spectrum.nm[band]:g} nm", "mean", "spread ±", "stated ±"]
    cells = "".join(f"<td align='right'>{number_text(float(each), 4)}</td>" for each in figures)
    pixels = f"{chosen.used} of {counted(chosen.pixels, 'pixel')}"
    about = "Spread: how its pixels differ. Stated: the deviation of one pixel."
    rows = [f"<tr><td>{pixels}</td>{cells}</tr>", f"<tr><td colspan='4'>{about}</td></tr>"]
    return _table(head, rows, theme)


def difference_table(chosen: Mark, others: list[Mark], theme: Theme) -> str:
    """Whether marks of the scan differ, by the band that shows it best."""
    rows = []
    for mark in others:
        a, b = chosen.spectrum, mark.spectrum
        if chosen.curve is not None or mark.curve is not None or a.std is None or b.std is None:
            continue
        found = largest_difference(a.nm, a.mean, b.mean, a.std, b.std) if len(a.nm) == len(b.nm) else None
        if found is None:
            continue
        figures = (
            with_std(found.value, found.std, 4),
            f"{found.nm:g} nm",
            "yes" if found.is_shown else "not shown",
        )
        cells = "".join(f"<td align='right'>{figure.replace('-', '−')}</td>" for figure in figures)
        rows.append(f"<tr><td>{escape(mark.name)}</td>{cells}</tr>")
    head = [f"{escape(chosen.name)} minus", "reflectance", "clearest at", "differ?"]
    return _table(head, rows, theme)


def comparison_table(
    chosen: Mark, others: list[Mark], state: ResultsState, result: ResultArrays, theme: Theme
) -> str:
    """A spectrum compared with every reference, or a reference with every spectrum of a result.

    Each as measured, and with a free scale factor for the spectrum.
    """
    rows = []
    for mark in others:
        measured, reference = (mark, chosen) if chosen.curve is not None else (chosen, mark)
        if measured.curve is None and reference.curve is not None:
            together = state.band_correlation(result)
            rows += _compared(mark.name, measured, reference.curve, together, result.band_width_nm, theme)
    if rows:
        rows.append(f"<tr><td colspan='4'>{_ABOUT}</td></tr>")
    return _table([f"{escape(chosen.name)} against", "RMSE", "angle, rad", "ΔE00"], rows, theme)


#: A narrow space.
_THIN = chr(0x200A)
#: What the deviations of a comparison are.
_ABOUT = (
    "±: one deviation, from those stated for the bands of one pixel. Noise alone: what equal spectra would"
    " differ by."
)


def _compared(
    name: str,
    measured: Mark,
    curve: SpectralCurve,
    together: NDArray[np.float64],
    width_nm: float | None,
    theme: Theme,
) -> list[str]:
    """The rows of one comparison, which begin with the name of what is compared with."""
    name, spectrum = escape(name), measured.spectrum
    try:
        found = compare(spectrum.mean, spectrum.nm, curve, measured.band_std, together, width_nm)
    except DslError as error:
        return [f"<tr><td>{name}</td><td colspan='3'>{escape(str(error))}</td></tr>"]
    low, high = found.range_nm
    # Nothing is extrapolated beyond the ends of a reference.
    only = "" if found.bands == len(spectrum.nm) else "only "
    scaled = f"{only}{low:g}–{high:g} nm, scaled by {_figure(found, 'scale', 3)}"
    decimals = {"rmse": 4, "angle_rad": 4, "delta_e": 2}
    lines = [
        (name, [_figure(found, *each) for each in decimals.items()]),
        (_muted(scaled, theme), [_figure(found, "rmse_scaled", 4), "", _figure(found, "delta_e_scaled", 2)]),
    ]
    if found.noise is not None:
        alone = [number_text(getattr(found.noise, each), places) for each, places in decimals.items()]
        lines.insert(1, (_muted("noise alone", theme), alone))
    rows = []
    for title, figures in lines:
        cells = "".join(f"<td align='right'>{figure}</td>" for figure in figures)
        rows.append(f"<tr><td>{title}</td>{cells}</tr>")
    return rows


def _muted(text: str, theme: Theme) -> str:
    return f"<span style='color:{theme.muted}'>{text}</span>"


def _figure(found: SpectrumComparison, name: str, decimals: int) -> str:
    """A figure of a comparison with its deviation, where that is known."""
    value = getattr(found, name)
    if not np.isfinite(value):
        return number_text(value, decimals)
    std = None if found.std is None else getattr(found.std, name)
    if not std:
        return f"{value:.{decimals}f}"
    # Three figures have to fit next to the picture, each on one line.
    return f"<nobr>{with_std(value, std, decimals).replace(' ', _THIN)}</nobr>"


def distance_table(chosen: Mark, others: list[Mark], result: ResultArrays, theme: Theme) -> str:
    """Straight-line distances from a pin to the other pins."""
    if chosen.pixel is None or "points_mm" not in result.arrays:
        return ""
    rows = []
    here, spread = result.at("points_mm", chosen.pixel), _spread(result, chosen)
    for mark in others:
        if mark.pixel is None:
            continue
        found = distance_between(here, result.at("points_mm", mark.pixel), spread, _spread(result, mark))
        text = f"{with_std(found.mm, found.std_mm, 3)} mm" if np.isfinite(found.mm) else "no depth"
        rows.append(f"<tr><td>{escape(mark.name)}</td><td align='right'>{text}</td></tr>")
    return _table([f"{escape(chosen.name)} to", "distance"], rows, theme)


def _spread(result: ResultArrays, mark: Mark) -> float:
    assert mark.pixel is not None
    return 0.0 if result.known("depth_std_mm") is None else float(result.at("depth_std_mm", mark.pixel))
