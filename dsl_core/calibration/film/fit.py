"""The film's pose, period and bend from columns of first orders on known planes.

All six numbers of `Film` are fitted to all samples; where samples cannot tell them apart (distance and
bend, or period and distance over few depths) the values of the mounting decide, as a prior. On request the
shift of filters with the angle of view is fitted as well (`FilterAngle`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.film.order_columns import TileColumns
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Film, Rig
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.robust import huber_weights

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Fitted fields, how well a mounting is known beforehand (one deviation), and steps of differences.
FIELDS = ("tilt_x_deg", "tilt_y_deg", "roll_deg", "bend_per_mm", "lines_per_mm", "distance_mm")
PRIOR_STD = np.array([3.0, 3.0, 3.0, 0.01, 25.0, 3.0])
STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-6, 1e-2, 1e-2])
#: Step of differences over the share of a wavelength.
SHARE_STEP = 1e-3
ROUNDS = 15
#: How far from its mounting a film can be, in the unit of each field: a frame holds it within some degrees
#: and centimetres, one that bends more touches it, and data sheets of gratings are right to a few percent.
PLAUSIBLE = np.array([10.0, 10.0, 10.0, 0.05, 50.0, 20.0])
WORDS = (
    ("tilt about x", "°"), ("tilt about y", "°"), ("roll", "°"), ("bend", "/mm"), ("density", " lines/mm"),
    ("distance from the projector", " mm"),
)  # fmt: skip
#: A film of another shape displaces columns by polynomials of this total degree with coefficients of about so
#: many columns (px); they are of place, inverse depth, and wavelength from these limits (nm).
WARP_DEGREE, WARP_STD_PX = 3, 1.0
MIDDLE_NM, HALF_NM = 545.0, 115.0
#: So many columns of a film of another shape share what polynomials leave of it.
WARPED_TOGETHER = 1000.0
#: Residuals beyond this many deviations weigh less (Huber), and no column is better than this (px).
HUBER_SIGMAS, FLOOR_PX = 2.5, 0.003
#: What all columns of a filter and order have in common beyond their noise, px: evenly, and as a ramp in
#: either direction (seven drawn rigs, whose films are then within 1.0 of their deviations, rms).
COMMON_PX = 0.0015
MIN_SAMPLES = 100
#: Deviations of a filter's c, a and b before anything is seen: any index, or no such filter; tilts of some
#: degrees.
ANGLE_STD = np.array([0.3, 0.03, 0.03])
#: The shift is that of filters only where c is so many deviations above nothing, and that of an index that
#: layers of interference filters have: a film bent in its own way shifts colours over the picture, too.
SIGNIFICANT = 5.0
FILTER_INDEX = (1.3, 3.0)


@dataclass(frozen=True)
class OrderSamples:
    """Columns of first orders in one table; ``position`` and ``filter`` are indices into a recipe's lists."""

    position: Ints
    filter: Ints
    order: Ints
    wavelength_nm: Floats
    tile: Ints
    pixel: Ints
    depth_mm: Floats
    column_px: Floats
    std_px: Floats

    @classmethod
    def of(cls, parts: Sequence[tuple[int, int, TileColumns]]) -> OrderSamples:
        """One table of (position, filter, shifts); raises `CalibrationError` when there are none."""
        if not parts:
            raise CalibrationError("No first orders were captured. Capture the lines through filters first.")
        sizes = [len(shifts) for _, _, shifts in parts]

        def numbers(values: list[int]) -> Ints:
            return np.repeat(np.array(values, np.int64), sizes)

        return cls(
            position=numbers([position for position, _, _ in parts]),
            filter=numbers([name for _, name, _ in parts]),
            order=numbers([shifts.order for _, _, shifts in parts]),
            wavelength_nm=np.repeat([shifts.wavelength_nm for _, _, shifts in parts], sizes),
            tile=np.concatenate([shifts.tiles for _, _, shifts in parts]),
            pixel=np.concatenate([shifts.pixels for _, _, shifts in parts]),
            depth_mm=np.concatenate([shifts.depth_mm for _, _, shifts in parts]),
            column_px=np.concatenate([shifts.column_px for _, _, shifts in parts]),
            std_px=np.concatenate([shifts.std_px for _, _, shifts in parts]),
        )

    def __len__(self) -> int:
        return len(self.column_px)

    def only(self, keep: NDArray[np.bool_]) -> OrderSamples:
        """The samples where ``keep`` is true."""
        return OrderSamples(*(getattr(self, name)[keep] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class FilterAngle:
    """How a bandpass filter passes shorter wavelengths the more askew light goes through it.

    The centre of an interference filter is at ``centre * sqrt(1 - (sin(angle) / index)^2)``, the angle being
    that to the filter's normal and ``index`` the effective one of its layers, 1.5 to 2.2 (Macleod, Thin-Film
    Optical Filters). With the direction (x, y, z) of a pixel and a filter tilted by small angles, the
    relative shift is a constant, which nobody can tell from the film's line density, and
    ``-c (x^2 + y^2) / 2 + a x + b y`` with ``c = 1 / index^2``: ``values`` and ``std`` are of c, a and b.
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


@dataclass(frozen=True)
class FilmFit:
    """The film, the covariance of `FIELDS`, and the robust scatter of the residuals (px).

    ``gain`` (fields, samples) is how far each field moves when a column does. ``angle`` is the shift of the
    filters with the angle of view, none where it was not fitted, and ``warp_px`` (samples,) what a film of
    another shape adds to columns.
    """

    film: Film
    covariance: Floats
    scatter_px: float
    gain: Floats
    angle: FilterAngle
    warp_px: Floats

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation of every field, by name, in its unit."""
        return dict(zip(FIELDS, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))


def grating_columns(rig: Rig, samples: OrderSamples) -> Floats:
    """Columns (px) that the rig's grating equation gives for samples, shape (n,)."""
    pixels, depth = torch.as_tensor(samples.pixel), torch.as_tensor(samples.depth_mm)
    return GratingModel(rig).columns_of(pixels, depth, samples.order, samples.wavelength_nm).numpy()


def columns_per_share(rig: Rig, samples: OrderSamples) -> Floats:
    """By how many columns samples move when their wavelengths are all longer by a share, divided by it."""
    longer = replace(samples, wavelength_nm=samples.wavelength_nm * (1 + SHARE_STEP))
    return (grating_columns(rig, longer) - grating_columns(rig, samples)) / SHARE_STEP


def shift_terms(rig: Rig, pixels: NDArray[np.int64]) -> Floats:
    """What ``c``, ``a`` and ``b`` do to the relative wavelength at flat pixel indices (n,), shape (n, 3)."""
    rays = pixel_rays(rig.camera).reshape(3, -1)[:, pixels]
    x, y, _ = rays / np.linalg.norm(rays, axis=0)
    return np.stack([-0.5 * (x**2 + y**2), x, y], 1)


def warp_terms(rig: Rig, samples: OrderSamples) -> Floats:
    """What the shape of a film can do to columns, for each order by itself, (n, terms).

    Products of Chebyshev polynomials in place, inverse depth and wavelength. None of them moves all light of
    a wavelength: that would be another filter.
    """
    rows, columns = np.divmod(samples.pixel, rig.camera.width_px)
    near, far = rig.depth_range_mm
    axes = (
        2 * columns / (rig.camera.width_px - 1) - 1,
        2 * rows / (rig.camera.height_px - 1) - 1,
        2 * (1 / samples.depth_mm - 1 / far) / (1 / near - 1 / far) - 1,
        (samples.wavelength_nm - MIDDLE_NM) / HALF_NM,
    )
    powers = [np.polynomial.chebyshev.chebvander(axis, WARP_DEGREE) for axis in axes]
    terms = [
        powers[0][:, i] * powers[1][:, j] * powers[2][:, k] * powers[3][:, n]
        for i, j, k, n in np.ndindex((WARP_DEGREE + 1,) * 3 + (2,))
        if i + j + k + n <= WARP_DEGREE and (i + j or not n)
    ]
    own = [samples.order == order for order in np.unique(samples.order)]
    return np.stack([term * mine for mine in own for term in terms], 1)


def seen_straight(rig: Rig, samples: OrderSamples, angle: FilterAngle) -> OrderSamples:
    """The samples as they would be through filters that shift nothing."""
    shift = shift_terms(rig, samples.pixel) @ np.array(angle.values)
    return replace(samples, column_px=samples.column_px - columns_per_share(rig, samples) * shift)


def fit_film(
    rig: Rig,
    samples: OrderSamples,
    mounting: Film,
    rounds: int = ROUNDS,
    angled: bool = False,
    warped: bool = False,
) -> FilmFit:
    """Fit the film of ``rig`` by Gauss and Newton, robustly; ``mounting`` is what its prior is about.

    With ``angled`` the filters shift with the angle of view, all alike, by what fits best. With ``warped``
    columns may be off by smooth functions of place and depth, for a film whose shape its numbers cannot say.
    Raises `CalibrationError` with too few samples, or when the fit does not converge.
    """
    if len(samples) < MIN_SAMPLES:
        raise CalibrationError(
            f"First orders were found in only {len(samples)} tiles of the image; {MIN_SAMPLES} are needed to"
            " fit the film. Check that the film is on, the filters, and the exposure."
        )
    count, extra = len(FIELDS), 3 if angled else 0
    warps = warp_terms(rig, samples) if warped else np.empty((len(samples), 0))
    centre, values = (np.pad(_values(film), (0, extra + warps.shape[1])) for film in (mounting, rig.film))
    prior_std = np.concatenate([PRIOR_STD, ANGLE_STD[:extra], np.full(warps.shape[1], WARP_STD_PX)])
    sigma = np.hypot(samples.std_px, FLOOR_PX)
    terms = shift_terms(rig, samples.pixel)[:, :extra]
    scale, covariance, gain = 1.0, np.eye(len(values)), np.empty((len(values), len(samples)))
    for _ in range(rounds):
        now = _with(rig, values[:count])
        here = grating_columns(now, samples)
        ahead = [grating_columns(_with(rig, values[:count] + step), samples) for step in np.diag(STEPS)]
        by_film = (np.stack(ahead, 1) - here[:, None]) / STEPS
        by_angle = columns_per_share(now, samples)[:, None] * terms if angled else terms
        linear = np.concatenate([by_angle, warps], 1)
        residual = samples.column_px - here - linear @ values[count:]
        jacobian = np.concatenate([by_film, linear], 1) * prior_std
        weight, scale = huber_weights(residual, sigma, HUBER_SIGMAS)
        if warped:
            weight = weight / WARPED_TOGETHER
        information = (jacobian * weight[:, None]).T @ jacobian + np.eye(len(values))
        gradient = jacobian.T @ (weight * residual) + (centre - values) / prior_std
        covariance = np.linalg.inv(information)
        gain = covariance @ (jacobian * weight[:, None]).T * prior_std[:, None]
        step = covariance @ gradient
        values = values + prior_std * step.clip(-1, 1)
        if np.abs(step / np.sqrt(np.diag(covariance))).max() < 1e-2:
            break
    if not np.isfinite(values).all() or values[4] <= 0 or values[5] <= 0:
        raise CalibrationError(
            "The fit of the film did not converge. Check the filters, and the film's data."
        )
    film = _with(rig, values[:count]).film
    common = gain @ _common_offsets(rig, samples)
    spread = covariance * np.outer(prior_std, prior_std) + common @ common.T
    angle = NO_SHIFT
    if angled:
        std = np.sqrt(np.diag(spread)[count : count + extra])
        angle = FilterAngle(tuple(values[count : count + extra].tolist()), tuple(std.tolist()))
    scatter_px = scale * float(np.median(sigma))
    warp_px = warps @ values[count + extra :]
    return FilmFit(film, spread[:count, :count], scatter_px, gain[:count], angle, warp_px)


def is_plausible(film: Film, mounting: Film) -> bool:
    """Whether a film can stand where it was mounted."""
    return bool((np.abs(_values(film) - _values(mounting)) <= PLAUSIBLE).all())


def require_plausible(film: Film, mounting: Film) -> None:
    """Raise `CalibrationError` when a fitted film is none that can stand where it was mounted.

    Columns of another order, or of a wrong filter, are fitted well by films that are tilted like a roof.
    """
    found, expected = _values(film), _values(mounting)
    off = np.abs(found - expected) > PLAUSIBLE
    if off.any():
        clauses = "; ".join(
            f"{name} {found[i]:.4g}{unit}, mounted at {expected[i]:.4g}{unit}, plausible within"
            f" ± {PLAUSIBLE[i]:g}{unit}"
            for i, (name, unit) in enumerate(WORDS)
            if off[i]
        )
        raise CalibrationError(
            f"The film that fits best is none that can be mounted: {clauses}. Check the filters and their"
            " order, that the film is the one of the data sheet and faces the projector, and that the"
            " geometry is that of this rig; then capture again what was wrong."
        )


def _common_offsets(rig: Rig, samples: OrderSamples) -> Floats:
    """One deviation (px) of what samples of a filter and order have in common, (samples, offsets)."""
    rows, columns = np.divmod(samples.pixel, rig.camera.width_px)
    across, down = 2 * columns / rig.camera.width_px - 1, 2 * rows / rig.camera.height_px - 1
    # A ramp over -1..1 has a variance of a third.
    shapes = np.stack([np.ones(len(samples)), np.sqrt(3) * across, np.sqrt(3) * down], 1)
    _, group = np.unique(samples.filter * 8 + samples.order, return_inverse=True)
    mine = group[:, None] == np.arange(group.max() + 1)
    offsets: Floats = COMMON_PX * (mine[:, :, None] * shapes[:, None, :]).reshape(len(samples), -1)
    return offsets


def with_geometry(
    fit: FilmFit,
    rig: Rig,
    samples: OrderSamples,
    variants: Iterable[tuple[Rig, tuple[Plane, ...]]],
    progress: Progress | None = None,
) -> FilmFit:
    """The fit with a covariance that holds what the geometry leaves open.

    ``variants`` are rigs and planes of all positions, each one deviation off in an independent direction. The
    film makes up for such errors, so that columns come out right though its own numbers are off.
    """
    here = grating_columns(_with(rig, _values(fit.film)), samples)
    covariance = fit.covariance.copy()
    progress = progress or NoProgress()
    for other, planes in variants:
        progress.report("what the geometry leaves open", 0, 1)
        rays = pixel_rays(other.camera).reshape(3, -1)[:, samples.pixel]
        inverse = np.stack([plane.inverse for plane in planes])[samples.position]
        there = replace(samples, depth_mm=1 / (inverse.T * rays).sum(0))
        moved = fit.gain @ (here - grating_columns(_with(other, _values(fit.film)), there))
        covariance += np.outer(moved, moved)
    progress.report("what the geometry leaves open", 1, 1)
    return replace(fit, covariance=covariance)


def _values(film: Film) -> Floats:
    return np.array([getattr(film, name) for name in FIELDS])


def _with(rig: Rig, values: Floats) -> Rig:
    film = rig.film.model_copy(update=dict(zip(FIELDS, values.tolist(), strict=True)))
    return rig.model_copy(update={"film": film})
