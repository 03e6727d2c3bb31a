"""Whether the filter in the beam is the requested one: by the places of the orders, and by colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.orders.dispersion import widening
from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.figure import with_std
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM
from dsl_core.optics.spectra import chain_response

Floats = NDArray[np.float64]

#: Centres of measured and of nominal curves are as good as this, nm.
MEASURED_NM, NOMINAL_NM = 0.5, 1.5
#: A filter that is off by more than this (nm) tilts (always to the blue), or is another one; the shift counts
#: less so many deviations, since a dim filter cannot be judged to a nanometre.
DOUBT_NM, WRONG_NM, NOISE_SIGMAS = 1.5, 4.0, 2.0
#: The data sheet's line density of a film is as good as this.
DENSITY_STD = 0.04
#: So many others say how distance goes with wavelength; so many at least say the film's line density, and
#: fewer are compared with its data sheet.
ENOUGH, FEW = 5, 3
#: Wavelengths of filters that are in their places rise with the sine at least by this share of the film's
#: period: a quadratic would go through those of a set in reversed order as well.
LEAST_RISE = 0.5
#: Keeps a quadratic through filters of one wavelength finite; its deviation says that it is unknown.
NEARLY_NOTHING = 1e-10
#: Where film or target are not square to the light, density seems to change with wavelength by so much.
ASKEW = 0.01
#: Peaks wider than this (rms columns of `dispersion`'s projector, 16 nm) or with less than this share of the
#: light are not those of a narrow filter.
BROAD_PX, BROAD_SHARE = 9.0, 0.7
#: Candidates of the search by colour, nm; relative error of the response known so far, and stray light.
SHIFTS_NM = np.arange(-140.0, 141.0, 2.0)
RESPONSE_STD, STRAY = 0.2, 0.01


@dataclass(frozen=True)
class PlacedFilter:
    """A filter's effective wavelength and the distances of its first orders, (px, deviation) by order.

    ``width_nm`` is that of what it passes by its transmission.
    """

    filter_nm: float
    effective_nm: float
    measured_curve: bool
    offsets_px: dict[int, tuple[float, float]]
    width_nm: float = 0.0


def found_wavelengths(rig: Rig, filters: Sequence[PlacedFilter]) -> list[tuple[float, float] | None]:
    """Where each filter is by the places of its orders: wavelength and deviation (nm), None without orders.

    Each filter is compared with a quadratic through all others of the same order, robustly; with few others,
    or where that says less or wavelengths do not rise with distance, with the line density that the middle
    one of them sees; with fewer, with the film's data sheet.
    """
    by_order = [_by_others(rig, filters, order) for order in (1, -1)]
    found: list[tuple[float, float] | None] = []
    for i, each in enumerate(filters):
        known = [estimate for order in by_order if (estimate := order[i]) is not None]
        # A quadratic says next to nothing of a filter far from all others.
        ways = [way for way in (known, _by_density(rig, filters, i)) if way] or [_by_film(rig, each)]
        best = min(ways, key=lambda way: min((std for _, std in way), default=np.inf))
        if not best:
            found.append(None)
            continue
        nm, std = np.array(best).T
        # Both orders share what makes a filter's centre uncertain: their mean is no more certain than either.
        found.append((float((nm / std**2).sum() / (std**-2.0).sum()), float(std.min())))
    return found


def _by_others(rig: Rig, filters: Sequence[PlacedFilter], order: int) -> list[tuple[float, float] | None]:
    nm = np.array([each.effective_nm for each in filters])
    at = np.array([abs(each.offsets_px.get(order, (np.nan, 0.0))[0]) for each in filters])
    spread = np.array([each.offsets_px.get(order, (np.nan, 0.0))[1] for each in filters])
    centre = np.array([MEASURED_NM if each.measured_curve else NOMINAL_NM for each in filters])
    seen = np.isfinite(at)
    if seen.sum() <= ENOUGH:
        return [None] * len(filters)
    nm_per_px = float(np.ptp(nm[seen])) / max(float(np.ptp(at[seen])), 1e-6)
    tolerance = np.hypot(centre, nm_per_px * spread)
    # Wavelength over sine, which is nearly straight, so that the answer is a wavelength.
    sine = np.sin(np.arctan(at / rig.projector.fx_px))
    away = sine[seen] - sine[seen].mean()
    if away @ nm[seen] < LEAST_RISE * rig.film.period_nm * (away @ away):
        return [None] * len(filters)
    found: list[tuple[float, float] | None] = []
    for i in range(len(filters)):
        others = seen & (np.arange(len(filters)) != i)
        if not np.isfinite(at[i]):
            found.append(None)
            continue
        x = (sine - sine[others].mean()) / max(float(np.ptp(sine[others])), 1e-9)
        value, std = _through(x[others], nm[others], tolerance[others], float(x[i]))
        found.append((value, float(np.hypot(tolerance[i], std))))
    return found


def _through(x: Floats, values: Floats, std: Floats, at: float) -> tuple[float, float]:
    """A quadratic through values (n,) with deviations, robustly: what it is elsewhere, with its deviation."""
    powers = np.vander(x, 3)
    weight = 1 / std
    for _ in range(20):
        weighted = powers * weight[:, None]
        covariance = np.linalg.inv(weighted.T @ weighted + NEARLY_NOTHING * np.eye(3))
        fit = covariance @ (weighted.T @ (values * weight))
        sigmas = np.abs(values - powers @ fit) / std
        # Cauchy weights: a wrong filter among the others pulls no more.
        weight = 1 / std / np.sqrt(1 + (sigmas / 2) ** 2)
    there = np.array([at**2, at, 1.0])
    return float(there @ fit), float(np.sqrt(there @ covariance @ there))


def _by_density(rig: Rig, filters: Sequence[PlacedFilter], index: int) -> list[tuple[float, float]]:
    """A filter's wavelength by the line density that the others see, by order: any number of estimates."""
    found = []
    for order in (1, -1):
        px, spread_px = np.abs([each.offsets_px.get(order, (np.nan, 0.0)) for each in filters]).T
        sine = np.sin(np.arctan(px / rig.projector.fx_px))
        others = (sine > 0) & (np.arange(len(filters)) != index)
        if others.sum() < FEW or not sine[index] > 0:
            continue
        effective_nm = np.array([each.effective_nm for each in filters])
        # Two swapped filters err in opposite directions, so that the middle one is neither.
        nm = float(sine[index] * np.median(effective_nm[others] / sine[others]))
        std = np.hypot(ASKEW, spread_px[index] / px[index]) * nm
        found.append((nm, float(np.hypot(NOMINAL_NM, std))))
    return found


def _by_film(rig: Rig, each: PlacedFilter) -> list[tuple[float, float]]:
    """The wavelength by the film's data sheet, on a plane that faces projector and film."""
    distance = [abs(px) for px, _ in each.offsets_px.values() if np.isfinite(px)]
    if not distance:
        return []
    angle = np.arctan(np.mean(distance) / rig.projector.fx_px)
    nm = float(np.sin(angle)) * rig.film.period_nm
    return [(nm, DENSITY_STD * nm)]


def verdict(
    rig: Rig, each: PlacedFilter, found: tuple[float, float] | None, width_px: float, share: float
) -> tuple[bool, str]:
    """Whether a filter is unusable, and a sentence on what is wrong with it (empty: nothing)."""
    name = f"the filter of {each.filter_nm:g} nm"
    if width_px > BROAD_PX * widening(rig, each.effective_nm, each.width_nm) or share < BROAD_SHARE:
        return True, (
            f"{name}: the light of the first orders is spread over {2 * width_px:.0f} columns, as without a"
            " narrow filter. Put the filter in front of the camera, shade ambient light, and capture the step"
            " again"
        )
    if found is None:
        return False, f"{name}: no first order stands out; it is left out"
    shift, std = found[0] - each.effective_nm, found[1]
    certain = abs(shift) - NOISE_SIGMAS * std
    if certain > WRONG_NM:
        return True, (
            f"{name}: its first orders are where those of {with_std(found[0], std, 0)} nm should be."
            " This is not the requested filter; put the right one in front of the camera and capture the step"
            " again"
        )
    if certain > DOUBT_NM:
        why = "it may be tilted in the beam" if shift < 0 else "its curve is not the one assumed"
        return (
            False,
            f"{name}: it passes wavelengths {with_std(abs(shift), std, 1)} nm"
            f" {'shorter' if shift < 0 else 'longer'} than it should; {why}",
        )
    return False, ""


def colour_shift(rig: Rig, seen: Floats, transmission: SpectralCurve) -> tuple[float, float]:
    """How far (nm) the pass band must move to explain the colours seen (3,), and what that gains.

    The gain is in chi-square against no shift; beyond about ten the filter is another one. Monochrome cameras
    see no colours, so that no shift gains anything.
    """
    if len(mosaic_colours(rig.sensor.bayer)) == 1:
        return 0.0, 0.0
    chi = []
    white = chain_response(rig, 0, FINE_NM).sum(1)
    known_nm, passes = np.array(transmission.wavelengths_nm), np.array(transmission.values)
    for shift in SHIFTS_NM:
        through = np.interp(FINE_NM - shift, known_nm, passes, 0.0, 0.0)
        expected = white @ through
        if not expected.max() > 0:
            chi.append(np.inf)
            continue
        a, b = (np.log(rgb / rgb.max() + STRAY) for rgb in (np.maximum(seen, 0) + 1e-12, expected))
        difference = a - b
        spread = np.full(3, RESPONSE_STD)
        mean = (difference / spread**2).sum() / (1 / spread**2).sum()
        chi.append(float((((difference - mean) / spread) ** 2).sum()))
    best = int(np.argmin(chi))
    nothing = int(np.argmin(np.abs(SHIFTS_NM)))
    return float(SHIFTS_NM[best]), float(chi[nothing] - chi[best])


def effective_nm(light: Floats) -> float:
    """Mean wavelength of light (3, `FINE_NM`), all colours together."""
    total = light.sum(0)
    return float((total * FINE_NM).sum() / total.sum())
