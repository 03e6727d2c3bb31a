"""Bandpass filters in front of the camera, and how what they pass shifts with the angle of view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.spectra import chain_response

Floats = NDArray[np.float64]

#: Wavelengths on which integrals over a filter are taken, a nanometre apart.
FINE_NM = np.arange(390.0, 711.0)
#: The band of a filter ends at this share of what it passes where the rig sees most light through it.
BAND_SHARE = 0.1
#: Deviations of a filter's c, a and b before anything is seen: any index, or no such filter; tilts of some
#: degrees.
ANGLE_STD = np.array([0.3, 0.03, 0.03])
#: The shift is that of filters only where c is so many deviations above nothing, and that of an index that
#: layers of interference filters have: a film bent in its own way shifts colours over the picture, too.
SIGNIFICANT = 5.0
FILTER_INDEX = (1.3, 3.0)


@dataclass(frozen=True)
class FilterAngle:
    """How a bandpass filter passes shorter wavelengths the more askew light goes through it.

    The centre of an interference filter is at ``centre * sqrt(1 - (sin(angle) / index)^2)``, the angle being
    that to the filter's normal and ``index`` the effective one of its layers, 1.5 to 2.2 (Macleod, Thin-Film
    Optical Filters). With the direction (x, y, z) of a pixel and a filter tilted by small angles, the
    relative shift is ``-c (x^2 + y^2) / 2 + a x + b y - (a^2 + b^2) / (2 c)`` with ``c = 1 / index^2``:
    ``values`` and ``std`` are of c, a and b. The last term, that of the tilt alone, looks like another line
    density of the film; the others say how large it is.
    """

    values: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def is_of_filters(self) -> bool:
        """Whether the light seen is shifted as by filters, beyond doubt."""
        value, std = self.values[0], self.std[0]
        low, high = (index**-2.0 for index in reversed(FILTER_INDEX))
        return value > SIGNIFICANT * std and low - 2 * std < value < high + 2 * std

    @property
    def index(self) -> tuple[float, float] | None:
        """Effective index with its deviation; None where no shift is seen."""
        if not self.is_of_filters:
            return None
        value = self.values[0] ** -0.5
        return value, 0.5 * value**3 * self.std[0]


#: Filters that shift nothing.
NO_SHIFT = FilterAngle()


def nominal_filter(centre_nm: float, fwhm_nm: float = 10.0, peak: float = 0.8) -> SpectralCurve:
    """Transmission that a data sheet promises, of three coupled cavities."""
    nm = np.arange(centre_nm - 60.0, centre_nm + 60.5, 0.5)
    return SpectralCurve.of(nm, three_cavities(nm - centre_nm, fwhm_nm, peak))


def three_cavities(distance_nm: Floats, fwhm_nm: float, peak: float = 0.8) -> Floats:
    """``peak / (1 + (2 d / fwhm)^6)`` at distances from the centre, same shape: maximally flat."""
    return np.asarray(peak / (1 + (2 * distance_nm / fwhm_nm) ** 6))


def through_filter(
    transmission: SpectralCurve, shift: Floats | None = None, weight: Floats | None = None
) -> Floats:
    """Mean transmission at `FINE_NM` over directions whose bands are shifted by shares ``shift`` (n,).

    ``weight`` (n,) is how much each direction counts; without any that counts, all count alike. Without
    shifts, the filter is seen straight on.
    """
    at = FINE_NM / (1 + (np.zeros(1) if shift is None else shift)[:, None])
    each = np.interp(at, transmission.wavelengths_nm, transmission.values, 0.0, 0.0)
    counts = weight is not None and weight.sum() > 0
    return np.asarray(np.average(each, 0, weight if counts else None))


def passed(
    rig: Rig, transmission: SpectralCurve, shift: Floats | None = None, weight: Floats | None = None
) -> Floats:
    """Zero-order signal through a filter per nm at `FINE_NM`, white light, DN per ms, (3, wavelengths).

    ``shift`` and ``weight`` as of `through_filter`.
    """
    return np.asarray(chain_response(rig, 0, FINE_NM).sum(1) * through_filter(transmission, shift, weight))


def passed_width_nm(rig: Rig, transmission: SpectralCurve) -> float:
    """Width of the rectangle as high as a filter's band that passes as much as this does, nm.

    The band is the one that the rig sees most light of, down to `BAND_SHARE` of that place on either side and
    half as far again: filters open again in the near infrared, and measured transmissions have an offset. 0
    for an opaque one.
    """
    through, most = through_filter(transmission), int(passed(rig, transmission).sum(0).argmax())
    outside = np.flatnonzero(through <= BAND_SHARE * through[most])
    first = int(outside[outside < most].max(initial=-1)) + 1
    end = int(outside[outside > most].min(initial=through.size))
    flank = (end - first) // 2
    height = max(float(through[first:end].max()), 1e-9)
    return float(through[max(first - flank, 0) : end + flank].sum()) / height


def relative_shift(terms: Floats, values: Floats) -> Floats:
    """Relative shift (n,) of wavelengths by c, a and b (3,), whose `shift_terms` are (n, 3)."""
    return np.asarray(terms @ values + _by_tilt(values)[0])


def shift_slopes(terms: Floats, values: Floats) -> Floats:
    """What c, a and b add to `relative_shift` near ``values``, (n, 3)."""
    return np.asarray(terms + _by_tilt(values)[1])


def _by_tilt(values: Floats) -> tuple[float, Floats]:
    """The shift of filters seen straight on that are tilted, and its slopes (3,)."""
    c, a, b = values
    # No filter has layers of a larger index, and without any angle there is no tilt.
    held = max(c, FILTER_INDEX[1] ** -2)
    square = a * a + b * b
    return -0.5 * square / held, np.array(
        [0.5 * square / held**2 if c == held else 0.0, -a / held, -b / held]
    )


def shift_terms(rig: Rig, pixels: NDArray[np.int64]) -> Floats:
    """What ``c``, ``a`` and ``b`` do by themselves at flat pixel indices (n,), shape (n, 3)."""
    rays = pixel_rays(rig.camera).reshape(3, -1)[:, pixels]
    x, y, _ = rays / np.linalg.norm(rays, axis=0)
    return np.stack([-0.5 * (x**2 + y**2), x, y], 1)
