"""Colours of measured spectra under illuminants of the CIE, with deviations: a table to judge by.

Observer and illuminants are tabulated at 1 nm, 360 to 830 nm; a spectrum is linear between its bands and
constant beyond them (ASTM E308 for truncated data). Figures equal those of colour-science for the same
spectrum. `dsl_core.optics.colour`, at 5 nm, is for pictures.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.band_noise import usual_correlation
from dsl_core.errors import DecodeError
from dsl_core.model.result_order import known_bands
from dsl_core.optics.colour import LEAST_SEEN, delta_e_2000, read_columns, seen_shares, xyz_to_lab

Floats = NDArray[np.float64]
#: Illuminants by the names of colour-science, with words for a person.
ILLUMINANTS: dict[str, str] = {
    "D65": "D65 – average daylight, 6504 K",
    "D50": "D50 – horizon daylight, 5003 K",
    "A": "A – tungsten lamp, 2856 K",
    "FL11": "F11 – narrow-band fluorescent lamp, 4000 K",
    "LED-B1": "LED-B1 – blue LED with phosphor, 2733 K",
    "LED-B3": "LED-B3 – blue LED with phosphor, 4103 K",
    "LED-B5": "LED-B5 – blue LED with phosphor, 6598 K",
    "LED-RGB1": "LED-RGB1 – red, green and blue LEDs, 2840 K",
    "LED-V2": "LED-V2 – violet LED with phosphor, 4070 K",
}
#: Those of a table unless others are wanted.
USUAL = ("A", "D50", "D65", "FL11", "LED-B3")


#: What `Colour.cells` are.
HEADER = ("place", "light", "L*", "±L*", "a*", "±a*", "b*", "±b*", "ΔE00", "±ΔE00")


@dataclass(frozen=True)
class Colour:
    """A colour under a light: L*a*b* (3,) relative to the perfect diffuser; deviations NaN if not known.

    ``delta_e`` is CIEDE2000 to a reference under the same light; None without one. Its deviation is that of
    what is known of the two, and NaN where neither deviation is.
    """

    name: str
    light: str
    lab: tuple[float, float, float]
    lab_std: tuple[float, float, float]
    delta_e: float | None = None
    delta_e_std: float | None = None

    @property
    def cells(self) -> tuple[str | float | None, ...]:
        """Its row in a table, as `HEADER` names the columns."""
        pairs = (value for pair in zip(self.lab, self.lab_std, strict=True) for value in pair)
        figures = (*pairs, self.delta_e, self.delta_e_std)
        known = (None if value is None or math.isnan(value) else value for value in figures)
        return (self.name, self.light, *known)


@cache
def _table(light: str) -> tuple[Floats, Floats]:
    """Wavelengths (nm), and observer times illuminant (3, wavelengths), in 1 nm."""
    if light not in ILLUMINANTS:
        raise DecodeError(f"There is no light {light!r}. Choose {', '.join(ILLUMINANTS)}.")
    columns = read_columns("colour/cie_1nm.csv")
    nm, power = columns[light]
    return nm, np.stack([columns[name][1] for name in ("x_bar", "y_bar", "z_bar")]) * power


def xyz_weights(bands_nm: Floats, light: str) -> Floats:
    """Weights (3, bands) that turn reflectance at bands into XYZ, Y = 1 for the perfect diffuser.

    Raises `DecodeError` for a light that is not known.
    """
    nm, matching = _table(light)
    spread = np.stack([np.interp(nm, bands_nm, row) for row in np.eye(len(bands_nm))], axis=1)
    return np.asarray(matching @ spread / matching[1].sum())


def require_bands(bands_nm: Floats, light: str, whose: str = "") -> None:
    """Raise `DecodeError` where bands leave out too much of what makes a colour under a light."""
    nm, matching = _table(light)
    seen = seen_shares(bands_nm, nm, matching)
    if np.any(seen < LEAST_SEEN):
        least = int((seen - LEAST_SEEN).argmin())
        raise DecodeError(
            f"The bands{whose}, {bands_nm.min():g} to {bands_nm.max():g} nm, hold {seen[least]:.0%} of"
            f" {'XYZ'[least]} under {light}: too little for a colour. Reconstruct bands of 30 nm or finer"
            " from about 430 to 660 nm, mask none of them, or choose another light."
        )


def lights_for(bands_nm: Floats) -> tuple[str, ...]:
    """The `ILLUMINANTS` under which bands hold enough of a colour."""
    found = []
    for light in ILLUMINANTS:
        try:
            require_bands(bands_nm, light)
        except DecodeError:
            continue
        found.append(light)
    return tuple(found)


def lab_of(reflectance: Floats, weights: Floats) -> Floats:
    """L*a*b* (3, ...) of reflectance (bands, ...) with the perfect diffuser as white."""
    return xyz_to_lab(np.tensordot(weights, reflectance, axes=1), weights.sum(axis=1))


def colours_of(
    spectra: Mapping[str, tuple[Floats, Floats]],
    bands_nm: Floats,
    lights: Sequence[str] = USUAL,
    reference: str | None = None,
    correlation: Floats | None = None,
) -> list[Colour]:
    """The colour of each spectrum (values and deviations, bands each) under each light.

    A band that is missing (NaN) is taken to lie between its neighbours, if these are near. Where a
    deviation of the others is not known (NaN), a colour has none, and differences have that of the other, or
    none.
    ``correlation`` (bands, bands) says how bands err together; the usual one of a result otherwise.
    Differences are to the spectrum named ``reference``. Raises `DecodeError` for unknown lights or names, and
    for a spectrum whose known bands hold too little of a colour.
    """
    if reference is not None and reference not in spectra:
        raise DecodeError(f"There is no spectrum {reference!r} to compare with: {', '.join(spectra)}.")
    shared = usual_correlation(bands_nm) if correlation is None else correlation
    found = []
    for light in lights:
        labs, sure = {}, {}
        for name, (values, std) in spectra.items():
            known = known_bands(values)
            require_bands(bands_nm[known], light, "" if known.all() else f" of {name!r}")
            sure[name] = bool(np.isfinite(std[known]).all())
            own = xyz_weights(bands_nm[known], light), shared[np.ix_(known, known)]
            labs[name] = _lab_with_covariance(values[known], std[known], *own)
        for name, (lab, covariance) in labs.items():
            difference: tuple[float | None, float | None] = (None, None)
            if reference is not None and name != reference:
                distance, its_std = _difference(lab, covariance, *labs[reference])
                difference = distance, its_std if sure[name] or sure[reference] else math.nan
            deviations = np.sqrt(np.diag(covariance)) if sure[name] else np.full(3, np.nan)
            found.append(Colour(name, light, _three(lab), _three(deviations), *difference))
    return found


def _three(values: Floats) -> tuple[float, float, float]:
    first, second, third = (float(value) for value in values)
    return first, second, third


def _lab_with_covariance(
    values: Floats, std: Floats, weights: Floats, correlation: Floats
) -> tuple[Floats, Floats]:
    """L*a*b* and its covariance (3, 3), to first order."""
    lab = lab_of(values, weights)
    step = 1e-5
    moved = lab_of(values[:, None] + step * np.eye(len(values)), weights)
    slope = (moved - lab[:, None]) / step
    spread = np.nan_to_num(std)
    return lab, slope @ (correlation * spread * spread[:, None]) @ slope.T


def _difference(lab: Floats, covariance: Floats, other: Floats, its: Floats) -> tuple[float, float]:
    """CIEDE2000 and its deviation, from points one deviation away along the axes of either covariance.

    Next to zero the difference has no slope, while such points still say how far it may reach.
    """
    value = float(delta_e_2000(lab, other))
    square = 0.0
    for own, moves_first in ((covariance, True), (its, False)):
        sizes, axes = np.linalg.eigh(own)
        for axis in (axes * np.sqrt(np.maximum(sizes, 0))).T:
            ends = [
                float(delta_e_2000(lab + sign * axis * moves_first, other + sign * axis * (not moves_first)))
                for sign in (1, -1)
            ]
            square += float(np.mean(np.square(np.array(ends) - value)))
    return value, float(np.sqrt(square))
