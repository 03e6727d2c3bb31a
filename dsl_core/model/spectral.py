"""Wavelength grids, curves over wavelength, and curves at the bands of a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record

Floats = NDArray[np.float64]

#: What sensors of silicon see, nm.
LIGHT_NM = (300.0, 1100.0)
MOST_BANDS = 1001
#: Negative values down to this share of a curve's largest are noise around zero.
NOISE_SHARE = 0.02
#: Samples of a band's triangle across its width at half height.
_PER_WIDTH = 32
#: At most this share of a band's triangle may lie beyond the ends of a spectrum: it then ends half a width
#: from the middle of the band.
MOST_BEYOND = 0.875
#: A triangle of this share of a band's width stands for a point.
_POINT = 1e-6


class WavelengthGrid(Record):
    """Evenly spaced band centres, both ends included."""

    start_nm: float = Field(default=430.0, gt=0)
    stop_nm: float = Field(default=660.0, gt=0)
    step_nm: float = Field(default=5.0, gt=0)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.stop_nm <= self.start_nm:
            raise ValueError(
                f"the last band, {self.stop_nm:g} nm, must be above the first, {self.start_nm:g} nm"
            )
        if self.start_nm < LIGHT_NM[0] or self.stop_nm > LIGHT_NM[1]:
            raise ValueError(
                f"bands from {self.start_nm:g} to {self.stop_nm:g} nm reach beyond the {LIGHT_NM[0]:g} to"
                f" {LIGHT_NM[1]:g} nm that cameras see; choose others within these"
            )
        if (self.stop_nm - self.start_nm) / self.step_nm > MOST_BANDS - 1:
            raise ValueError(
                f"steps of {self.step_nm:g} nm from {self.start_nm:g} to {self.stop_nm:g} nm are more than"
                f" {MOST_BANDS} bands; choose larger steps, as no band is narrower than some nm"
            )
        steps = (self.stop_nm - self.start_nm) / self.step_nm
        if steps < 1 or abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"a grid from {self.start_nm:g} to {self.stop_nm:g} nm in steps of {self.step_nm:g} nm"
                " does not end on a band; choose a stop that is a whole number of steps away"
            )
        return self

    @property
    def count(self) -> int:
        """Number of bands."""
        return round((self.stop_nm - self.start_nm) / self.step_nm) + 1

    @property
    def centres_nm(self) -> NDArray[np.float64]:
        """Band centres in nm, shape (bands,)."""
        return self.start_nm + self.step_nm * np.arange(self.count, dtype=np.float64)


class SpectralCurve(Record):
    """A quantity sampled over wavelength, linear between samples, constant outside them."""

    wavelengths_nm: tuple[float, ...]
    values: tuple[float, ...]
    std: tuple[float, ...] | None = None
    unit: str = "1"

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.wavelengths_nm) != len(self.values) or not self.values:
            raise ValueError(
                f"a curve needs one value per wavelength, given {len(self.values)} values"
                f" for {len(self.wavelengths_nm)} wavelengths"
            )
        if np.any(np.diff(self.wavelengths_nm) <= 0):
            raise ValueError("the wavelengths of a curve must rise strictly; sort them and drop repeats")
        if self.std is not None and len(self.std) != len(self.values):
            raise ValueError("a curve's standard deviation needs one value per wavelength")
        if self.std is not None and min(self.std) < 0:
            raise ValueError(f"a curve's standard deviation must not be negative, given {min(self.std):g}")
        return self

    @classmethod
    def of(
        cls, wavelengths_nm: ArrayLike, values: ArrayLike, unit: str = "1", std: ArrayLike | None = None
    ) -> SpectralCurve:
        """Make a curve from arrays of equal length."""
        return cls(
            wavelengths_nm=tuple(np.asarray(wavelengths_nm, float).tolist()),
            values=tuple(np.asarray(values, float).tolist()),
            unit=unit,
            std=None if std is None else tuple(np.asarray(std, float).tolist()),
        )

    def at(self, wavelengths_nm: ArrayLike) -> NDArray[np.float64]:
        """Values at the given wavelengths (nm), same shape, linear between samples."""
        return np.asarray(np.interp(np.asarray(wavelengths_nm, float), self.wavelengths_nm, self.values))


@dataclass(frozen=True)
class BandValues:
    """A spectrum at bands (bands,): values, and the deviations of those values."""

    values: Floats
    std: Floats


def band_widths_nm(bands_nm: ArrayLike, stated_nm: ArrayLike | None = None) -> Floats:
    """Full width at half height (nm) of bands (bands,): the distance of bands where nobody states it."""
    nm = np.asarray(bands_nm, np.float64)
    if stated_nm is not None:
        return np.broadcast_to(np.asarray(stated_nm, np.float64), len(nm))
    return np.abs(np.gradient(nm)) if len(nm) > 1 else np.ones(len(nm))


def band_weights(nm: Floats, bands_nm: Floats, widths_nm: Floats) -> Floats:
    """Weights (bands, samples) that turn a spectrum, linear between its samples, into band means.

    A band of a result is the mean over a triangle, centred on it and ``widths_nm`` (bands,) wide at half
    height. Where it reaches beyond the ends of the spectrum, the rest of it decides; a row is NaN where more
    than `MOST_BEYOND` does.
    """
    weights = np.full((len(bands_nm), len(nm)), np.nan)
    at = np.linspace(-1.0, 1.0, 2 * _PER_WIDTH + 1)
    triangle = 1 - np.abs(at)
    for band, (centre, width) in enumerate(zip(bands_nm, widths_nm, strict=True)):
        # Samples of the spectrum itself are nodes too, so that the narrowest line of it counts in full.
        inside = nm[np.abs(nm - centre) <= width]
        fine = np.union1d(centre + at * width, inside)
        mass = np.interp(fine, centre + at * width, triangle) * np.gradient(fine)
        covered = (fine >= nm[0] - 1e-9) & (fine <= nm[-1] + 1e-9)
        total = mass[covered].sum()
        if total < (1 - MOST_BEYOND) * mass.sum() or total <= 0:
            continue
        weights[band] = _spread(fine[covered], mass[covered] / total, nm)
    return weights


def means_of(values: NDArray[Any], weights: Floats) -> NDArray[Any]:
    """Means (means, ...) of bands (bands, ...) by weights (means, bands); one without plays no part."""
    means = np.zeros((len(weights), *values.shape[1:]), values.dtype)
    for mean, row in enumerate(weights):
        for band in np.flatnonzero(row):
            means[mean] += row[band].astype(values.dtype) * values[band]
    return means


def _spread(fine: Floats, mass: Floats, nm: Floats) -> Floats:
    """Masses at wavelengths handed to the two samples around each, in proportion."""
    if len(nm) == 1:
        return np.array([mass.sum()])
    right = np.clip(np.searchsorted(nm, fine), 1, len(nm) - 1)
    share = np.clip((fine - nm[right - 1]) / (nm[right] - nm[right - 1]), 0, 1)
    row = np.bincount(right, mass * share, len(nm)) + np.bincount(right - 1, mass * (1 - share), len(nm))
    return np.asarray(row)


def at_bands(curve: SpectralCurve, bands_nm: Floats, width_nm: ArrayLike | None = None) -> BandValues:
    """A spectrum at the bands (nm) of a result, a mean over the triangle of each.

    ``width_nm`` is how wide they are (`stated_band_width_nm`), all or each of them; their distance, unless it
    is known. A sample is a mean over about the distance of samples, so that only what this leaves of a band's
    width is averaged: nothing of a spectrum that has the bands of the result. Raises `CalibrationError` where
    the spectrum does not cover them.
    The deviation holds that of the curve, if it states one, and what its sampling leaves open where it is
    coarser than the bands: half of the difference between straight lines and a smooth curve between samples.
    """
    from scipy.interpolate import PchipInterpolator

    nm, values = np.asarray(curve.wavelengths_nm), np.asarray(curve.values)
    widths = band_widths_nm(bands_nm, width_nm)
    apart = np.interp(bands_nm, nm, np.gradient(nm)) if len(nm) > 1 else np.zeros(len(bands_nm))
    weights = band_weights(nm, bands_nm, np.sqrt((widths**2 - apart**2).clip(min=(_POINT * widths) ** 2)))
    if not np.isfinite(weights).all():
        raise CalibrationError(
            f"It covers {nm[0]:g} to {nm[-1]:g} nm; the bands from {bands_nm[0]:g} to {bands_nm[-1]:g} nm are"
            " needed."
        )
    variance = np.zeros(len(bands_nm)) if curve.std is None else weights**2 @ np.square(curve.std)
    if len(nm) > 2:
        between = np.abs(PchipInterpolator(nm, values)(np.clip(bands_nm, nm[0], nm[-1])) - curve.at(bands_nm))
        variance += np.where(apart > widths, between / 2, 0.0) ** 2
    return BandValues(weights @ values, np.sqrt(variance))
