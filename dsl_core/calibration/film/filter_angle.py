"""The shift of bandpass filters with the angle of view, and columns as they would be without it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays

Floats = NDArray[np.float64]

#: Step of differences over the share of a wavelength.
SHARE_STEP = 1e-3
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


def columns_per_share(rig: Rig, samples: OrderSamples) -> Floats:
    """By how many columns samples move when their wavelengths are all longer by a share, divided by it."""
    longer = replace(samples, wavelength_nm=samples.wavelength_nm * (1 + SHARE_STEP))
    return (grating_columns(rig, longer) - grating_columns(rig, samples)) / SHARE_STEP


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


def seen_straight(rig: Rig, samples: OrderSamples, angle: FilterAngle) -> OrderSamples:
    """The samples as they would be through filters that shift nothing."""
    shift = relative_shift(shift_terms(rig, samples.pixel), np.array(angle.values))
    return replace(samples, column_px=samples.column_px - columns_per_share(rig, samples) * shift)
