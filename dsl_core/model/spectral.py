"""Wavelength grids and curves over wavelength."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from dsl_core.model.base import Record

#: What sensors of silicon see, nm.
LIGHT_NM = (300.0, 1100.0)
MOST_BANDS = 1001
#: Negative values down to this share of a curve's largest are noise around zero.
NOISE_SHARE = 0.02


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
