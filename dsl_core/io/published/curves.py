"""Curves of a camera or of a projector's LEDs that others measured, from tables with wavelengths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.catalogue import read_spectra
from dsl_core.io.spectra.records import Spectrum
from dsl_core.model.rig import Rgb
from dsl_core.model.spectral import NOISE_SHARE, SpectralCurve

#: Wavelengths that curves must cover, nm: those of the default bands.
NEEDED_NM = (430.0, 660.0)
#: First letters of columns and words for their order.
_LETTERS = ("r", "g", "b")


@dataclass(frozen=True)
class FoundCurves:
    """Red, green and blue, relative to the largest of all, and how the file was understood, in words."""

    curves: Rgb
    words: str


def load_curves(path: Path, device: str) -> FoundCurves:
    """Curves of a ``device`` (``camera`` or ``LEDs``) from any file of spectra with three of them.

    A camera may have one, which then holds for all channels. Raises `CalibrationError` that says what the
    file has and what is wanted.
    """
    found = read_spectra(path)
    if len(found) == 1 and device == "camera":
        found = found * 3
    if len(found) != 3:
        names = ", ".join(each.name for each in found[:6])
        wanted = "three curves, R, G, B, or one of a monochrome camera" if device == "camera" else (
            "three curves, R, G, B"
        )  # fmt: skip
        raise CalibrationError(
            f"{path} has {len(found)} curves ({names}); {wanted} are needed. Export a table with the"
            " wavelength in nm in its first column."
        )
    ordered, order = _ordered(found)
    arrays = [_checked(path, each) for each in ordered]
    most = max(float(each.max()) for each in arrays)
    pairs = [(each.nm, values) for each, values in zip(ordered, arrays, strict=True)]
    centres = centres_nm(path, pairs, order)
    red, green, blue = (
        SpectralCurve.of(each.nm, values / most) for each, values in zip(ordered, arrays, strict=True)
    )
    told = ", ".join(f"{letter} {nm:.0f} nm" for letter, nm in zip("RGB", centres, strict=True))
    return FoundCurves((red, green, blue), f"curves of the {device}: {path.name}, {order}, centred at {told}")


def centres_nm(
    path: Path, curves: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]], order: str
) -> list[float]:
    """Where red, green and blue are centred, of wavelengths and values each, taken in some ``order``.

    Raises `CalibrationError` where they do not follow each other so.
    """
    centres = [_centre_nm(nm, values) for nm, values in curves]
    if not centres[0] >= centres[1] >= centres[2]:
        told = ", ".join(f"{nm:.0f} nm" for nm in centres)
        raise CalibrationError(
            f"{path}: red, green and blue ({order}) are centred at {told}; red must have the longest"
            " wavelength, blue the shortest. Name or order the columns R, G, B, and wavelengths so that they"
            " rise."
        )
    return centres


def _centre_nm(nm: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Mean wavelength of the light, however unevenly the wavelengths are spaced."""
    return float(np.average(nm, weights=values * np.gradient(nm)))


def _ordered(found: list[Spectrum]) -> tuple[list[Spectrum], str]:
    """Red, green, blue by the first letters of their names, otherwise in their order."""
    letters = [each.name.strip().lower()[:1] for each in found]
    if sorted(letters) == sorted(_LETTERS):
        return [found[letters.index(letter)] for letter in _LETTERS], "by their names"
    if found[0] is found[1]:
        return found, "one curve for all channels"
    return found, "in the order of their columns"


def _checked(path: Path, spectrum: Spectrum) -> NDArray[np.float64]:
    values = np.asarray(spectrum.values, np.float64)
    most = float(np.max(values, initial=0.0, where=np.isfinite(values)))
    if not np.isfinite(values).all() or most <= 0 or values.min() < -NOISE_SHARE * most:
        raise CalibrationError(
            f"{path}: {spectrum.name} contains values that are missing, or negative by more than"
            f" {NOISE_SHARE:.0%} of its largest. Measure it again."
        )
    low, high = float(spectrum.nm[0]), float(spectrum.nm[-1])
    if low > NEEDED_NM[0] or high < NEEDED_NM[1]:
        wanted = f"{NEEDED_NM[0]:g} to {NEEDED_NM[1]:g} nm"
        raise CalibrationError(
            f"{path}: {spectrum.name} covers {low:g} to {high:g} nm; {wanted} are needed. Measure it"
            " over that range."
        )
    return values.clip(0.0)
