"""Spectra of a file as what a calibration needs: radiance, or a share of light such as reflectance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.catalogue import read_spectra
from dsl_core.io.spectra.records import Floats, Quantity, Spectrum, most_of
from dsl_core.model.spectral import SpectralCurve

#: What radiance is kept in.
RADIANCE_UNIT = "W/(sr m2 nm)"
#: Shares above this can only be percentages, above a hundred times this only counts.
MOST_SHARE = 2.0
#: No share is so far below zero: -9999, -999 and the like mark what was deleted, also over a scale factor.
LEAST_SHARE = -0.9
#: Radiance without a stated unit above this is something else; with one, above what the Sun's disc has.
_MOST_UNSTATED, _MOST_RADIANCE = 100.0, 1e5
#: What becomes a reflectance over the same of a white standard.
_LIGHT: set[Quantity] = {"counts", "radiance", "irradiance"}
_CALLED: dict[Quantity, str] = {"reflectance": "reflectance (a share or percent)", "counts": "counts"}


def read_spectrum(
    path: Path, covers_nm: tuple[float, float] = (430.0, 660.0), radiance: bool = True
) -> SpectralCurve:
    """The only spectrum of a file that is radiance, or (``radiance=False``) a share such as reflectance.

    Any format of `dsl_core.io.spectra.catalogue`. Radiance is returned in W/(sr m2 nm), other stated units
    converted; a percentage becomes a share. Raises `CalibrationError` that names the file for wavelengths
    that are no nanometres or do not cover the range, values that are missing, other quantities, and several
    spectra where one is needed.
    """
    found = of_kind(path, read_spectra(path), radiance)
    if len(found) > 1:
        names = ", ".join(repr(each.name or f"column {i}") for i, each in enumerate(found[:6], 2))
        raise CalibrationError(
            f"{path.name} contains {len(found)} spectra ({names}{', ...' if len(found) > 6 else ''}); one is"
            " needed. Export it alone."
        )
    return _curve(path, found[0], covers_nm, radiance)


def read_radiances(path: Path, covers_nm: tuple[float, float] = (430.0, 660.0)) -> tuple[SpectralCurve, ...]:
    """Every radiance of a file, which are readings of one light; raises `CalibrationError`."""
    return tuple(_curve(path, each, covers_nm, True) for each in of_kind(path, read_spectra(path), True))


def of_kind(
    path: Path, spectra: list[Spectrum], radiance: bool, all_unstated: bool = False
) -> list[Spectrum]:
    """The spectra, as read, that are radiance, or shares: those that say so, else those that say nothing.

    ``all_unstated`` takes both, but no percentages next to shares that say so: they are figures of another
    kind, such as gloss. Raises `CalibrationError` when there is none.
    """
    wanted: tuple[Quantity, ...] = ("radiance",) if radiance else ("reflectance", "transmittance")
    stated = [each for each in spectra if each.quantity in wanted]
    found = stated or [each for each in spectra if each.quantity == "unstated"]
    if stated and all_unstated:
        wanted, are_percent = (*wanted, "unstated"), any(map(is_percent, stated))
        known = [each for each in spectra if each.quantity in wanted]
        found = [each for each in known if each.quantity != "unstated" or are_percent or not is_percent(each)]
    if not found:
        kinds = sorted({_CALLED.get(each.quantity, each.quantity) for each in spectra})
        needed = f"a spectral radiance. Export radiance in {RADIANCE_UNIT}" if radiance else "a reflectance"
        by_white = {each.quantity for each in spectra} <= _LIGHT
        instead = "Divide it by the spectrum of a white standard, or export" if by_white else "Export"
        way = "" if radiance else f". {instead} reflectance"
        raise CalibrationError(f"{path.name} contains {' and '.join(kinds)}, not {needed}{way}.")
    return found


def is_percent(spectrum: Spectrum) -> bool:
    """Whether a spectrum without a unit is too large for shares of light."""
    return not spectrum.scaled and most_of(spectrum.nm, spectrum.values) > MOST_SHARE


def as_share(path: Path, spectrum: Spectrum, in_percent: bool = False) -> Spectrum:
    """A spectrum as shares of light, NaN where a value was deleted; ``in_percent`` unless it has a unit.

    Raises `CalibrationError` for one that can only be counts.
    """
    most = most_of(spectrum.nm, spectrum.values)
    if most > 100 * MOST_SHARE:
        raise CalibrationError(
            f"{path.name} contains values up to {most:g}; reflectance from 0 to 1, or percent, is needed."
            " Divide it by the spectrum of a white standard, or export reflectance."
        )
    percent = is_percent(spectrum) or (in_percent and not spectrum.scaled)
    values = spectrum.values * (0.01 if percent else 1.0)
    values[values < LEAST_SHARE] = np.nan
    return replace(spectrum, values=values, scaled=spectrum.scaled or percent)


def as_radiance(path: Path, spectrum: Spectrum) -> Spectrum:
    """A spectrum, if it can be radiance, NaN where a value was deleted; raises `CalibrationError` if not."""
    most = most_of(spectrum.nm, spectrum.values)
    if most > (_MOST_RADIANCE if spectrum.scaled else _MOST_UNSTATED):
        stated = RADIANCE_UNIT if spectrum.scaled else "no stated unit"
        raise CalibrationError(
            f"{path.name} contains values up to {most:g} in {stated}; a spectral radiance is not so large."
            f" Export radiance in {RADIANCE_UNIT}, with its unit over the column."
        )
    # In any unit, noise is not so far below zero, but -9999 is.
    return replace(spectrum, values=np.where(spectrum.values < -100 * most, np.nan, spectrum.values))


def _curve(path: Path, spectrum: Spectrum, covers_nm: tuple[float, float], radiance: bool) -> SpectralCurve:
    spectrum = as_radiance(path, spectrum) if radiance else as_share(path, spectrum)
    _require_range(path, spectrum.nm, covers_nm)
    missing = ~np.isfinite(spectrum.values)
    if missing.any():
        raise CalibrationError(
            f"{path.name} has no value at {spectrum.nm[int(missing.argmax())]:g} nm. Measure this spectrum"
            " again, or leave out the range that the instrument does not cover."
        )
    return SpectralCurve.of(spectrum.nm, spectrum.values, unit=RADIANCE_UNIT if radiance else "1")


def _require_range(path: Path, nm: Floats, covers_nm: tuple[float, float]) -> None:
    low, high = covers_nm
    if nm[0] > low or nm[-1] < high:
        raise CalibrationError(
            f"{path.name} covers {nm[0]:g} to {nm[-1]:g} nm; {low:g} to {high:g} nm are needed."
            " Measure the whole range."
        )
