"""Spectral response of the whole chain (LED emission, film efficiency, camera) and the bands of a model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid

if TYPE_CHECKING:
    from torch import Tensor

ORDERS = (1, -1)
#: Orders of a few percent of the first: lines are too far away to mix with them, free patterns are not.
SECOND_ORDERS = (2, -2)
#: Internal bands beyond each end of the grid: at least so far, and as far as there is light of the first
#: orders, as a share of the brightest.
PAD_NM, LEAST_LIGHT = 15.0, 0.015
#: What is added where light goes farther than that, so that it ends within the bands.
FADING_NM = 8.0
#: Bands are as wide in columns as their dispersion to this, px per nm, so that pixels share tables of light.
SLOPE_STEP = 0.02
#: Where a film sends a band past its own plane, places say nothing of dispersion: it is at most so many times
#: what it is along the projector's axis.
MOST_OBLIQUE = 8.0
#: Light this far beyond the bands still counts in the zero order.
BEYOND_NM = 40.0


def chain_response(rig: Rig, order: int, wavelengths_nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """DN per ms and nm of a perfect diffuser at unit shading, full drive of one LED.

    The product of response, efficiency and emission in the model equation of `dsl_core.model.rig.Rig`, shape
    (camera channels 3, LEDs 3, wavelengths). Orders that the rig does not know give zero.
    """
    if order == 0:
        efficiency = np.ones(len(wavelengths_nm))
    elif order in rig.efficiency:
        efficiency = rig.efficiency[order].at(wavelengths_nm)
    else:
        efficiency = np.zeros(len(wavelengths_nm))
    response = np.stack([curve.at(wavelengths_nm) for curve in rig.response])
    emission = np.stack([curve.at(wavelengths_nm) for curve in rig.emission])
    return rig.white_scale * response[:, None] * (emission * efficiency)[None]


def hat_moments(
    rig: Rig, order: int, centres_nm: NDArray[np.float64], step_nm: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weight and centroid of the chain's response under each band's hat function.

    Reflectance is taken as linear between bands, so a band's share of the signal is the response under
    a triangle of half width ``step_nm``. In the zero order, which mixes all light, the two end bands also
    stand for what is beyond them. Returns the integrals (DN per ms), shape (3, 3, bands), and the
    centroids (nm), shape (bands,), of all channels and LEDs together. With both kept exact, curvature of
    the response inside a band matters only in second order.
    """
    fine = np.linspace(-step_nm, step_nm, 41)
    hat = np.broadcast_to(1 - np.abs(fine) / step_nm, (len(centres_nm), fine.size)).copy()
    nm = centres_nm[:, None] + fine
    weight = chain_response(rig, order, nm.ravel()).reshape(3, 3, *nm.shape) * hat
    width = fine[1] - fine[0]
    total = weight.sum((0, 1))
    mass = total.sum(-1)
    centroid = np.where(mass > 0, (total * nm).sum(-1) / np.where(mass > 0, mass, 1), centres_nm)
    moments = weight.sum(-1) * width
    if order == 0:
        moments[..., 0] += _beyond(rig, centres_nm[0], -1, step_nm)
        moments[..., -1] += _beyond(rig, centres_nm[-1], 1, step_nm)
    return moments, centroid


def _beyond(rig: Rig, end_nm: float, side: int, step_nm: float) -> NDArray[np.float64]:
    """Zero-order response on one side of an end band that its hat leaves out, shape (3, 3)."""
    distance_nm = np.arange(0, BEYOND_NM, 0.25)
    outside = np.clip(distance_nm / step_nm, 0, 1)
    return np.asarray((chain_response(rig, 0, end_nm + side * distance_nm) * outside).sum(-1) * 0.25)


def pads_nm(rig: Rig, grid: WavelengthGrid) -> tuple[float, float]:
    """How far below and above a grid first orders bring light that a model must know, nm.

    Lines light a pixel through these wavelengths as well, whether they are asked for or not: without a band
    there, their light is taken for that of others.
    """
    ends = [
        (min(curve.wavelengths_nm[0] for curve in rgb), max(curve.wavelengths_nm[-1] for curve in rgb))
        for rgb in (rig.response, rig.emission)
    ]
    # Beyond its last sample a curve is said to stay as it is, which is no light that anybody measured.
    known = np.arange(max(low for low, _ in ends), min(high for _, high in ends) + 0.5)
    light = _first_order_light(rig, known)
    bright = known[light > LEAST_LIGHT * light.max(initial=0)]
    below = grid.start_nm - bright.min(initial=grid.start_nm)
    above = bright.max(initial=grid.stop_nm) - grid.stop_nm
    return _pad_nm(float(below)), _pad_nm(float(above))


def _pad_nm(light_nm: float) -> float:
    """How far bands must reach where light reaches so far beyond the grid."""
    return PAD_NM if light_nm <= PAD_NM else light_nm + FADING_NM


def _first_order_light(rig: Rig, wavelengths_nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """The most that a colour of the camera sees of white through a first order, at each wavelength."""
    light = [chain_response(rig, order, wavelengths_nm).sum(1) for order in ORDERS]
    return np.asarray(np.max(light, axis=(0, 1)))


@dataclass(frozen=True)
class Bands:
    """Internal bands of a forward model and the response of each order there."""

    centres_nm: NDArray[np.float64]
    step_nm: float
    reported: slice
    moments: dict[int, NDArray[np.float64]]  # order -> (3 channels, 3 LEDs, bands), DN per ms
    centroids_nm: dict[int, NDArray[np.float64]]
    most_px_per_nm: float

    @classmethod
    def of(cls, rig: Rig, grid: WavelengthGrid) -> Bands:
        """Extend a grid and integrate the rig's response over its bands."""
        step = grid.step_nm
        below, above = (math.ceil(pad / step) for pad in pads_nm(rig, grid))
        centres = np.asarray(grid.start_nm + step * np.arange(-below, grid.count + above), np.float64)
        moments, centroids = {}, {}
        for order in (0, *ORDERS, *SECOND_ORDERS):
            moments[order], centroids[order] = hat_moments(rig, order, centres, step)
        most_px_per_nm = MOST_OBLIQUE * rig.projector.fx_px / rig.film.period_nm
        return cls(centres, step, slice(below, below + grid.count), moments, centroids, most_px_per_nm)

    @property
    def count(self) -> int:
        """Number of internal bands."""
        return len(self.centres_nm)

    @property
    def orders(self) -> tuple[int, ...]:
        """First orders, and second ones where the rig knows their efficiency."""
        return ORDERS + tuple(m for m in SECOND_ORDERS if self.moments[m].any())

    def half_width_px(self, columns_px: Tensor) -> float:
        """Half width (px) of a band's triangle: mean dispersion of columns (bands, pixels), in steps."""
        slope = float(self._slopes(columns_px).mean())
        return max(round(slope / SLOPE_STEP), 1) * SLOPE_STEP * self.step_nm

    def half_widths_px(self, columns_px: Tensor) -> Tensor:
        """The same of each pixel by its own columns (bands, pixels), (pixels,)."""
        return (self._slopes(columns_px) / SLOPE_STEP).round().clip(min=1) * (SLOPE_STEP * self.step_nm)

    def _slopes(self, columns_px: Tensor) -> Tensor:
        """Mean dispersion of each pixel (px per nm), (pixels,)."""
        span_nm = float(self.centres_nm[-1] - self.centres_nm[0])
        return ((columns_px[-1] - columns_px[0]).abs() / span_nm).clip(max=self.most_px_per_nm)
