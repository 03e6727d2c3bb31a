"""The film's pose, period and bend from columns of first orders on known planes.

All six numbers of `Film` are fitted to all samples; where samples cannot tell them apart (distance and
bend, or period and distance over few depths) the values of the mounting decide, as a prior. On request the
shift of filters with the angle of view is fitted as well (`FilterAngle`), or another shape (`warp_terms`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.film.filter_angle import (
    ANGLE_STD,
    NO_SHIFT,
    FilterAngle,
    columns_per_share,
    shift_terms,
)
from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.calibration.film.warp import WARP_STD_PX, warp_terms
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Film, Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.robust import huber_weights

Floats = NDArray[np.float64]

#: Fitted fields, how well a mounting is known beforehand (one deviation), and steps of differences.
FIELDS = ("tilt_x_deg", "tilt_y_deg", "roll_deg", "bend_per_mm", "lines_per_mm", "distance_mm")
PRIOR_STD = np.array([3.0, 3.0, 3.0, 0.01, 25.0, 3.0])
STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-6, 1e-2, 1e-2])
ROUNDS = 15
#: How far from its mounting a film can be, in the unit of each field: a frame holds it within some degrees
#: and centimetres, one that bends more touches it, and data sheets of gratings are right to a few percent.
PLAUSIBLE = np.array([10.0, 10.0, 10.0, 0.05, 50.0, 20.0])
WORDS = (
    ("tilt about x", "°"), ("tilt about y", "°"), ("roll", "°"), ("bend", "/mm"), ("density", " lines/mm"),
    ("distance from the projector", " mm"),
)  # fmt: skip
#: So many columns of a film of another shape share what polynomials leave of it.
WARPED_TOGETHER = 1000.0
#: Residuals beyond this many deviations weigh less (Huber), and no column is better than this (px).
HUBER_SIGMAS, FLOOR_PX = 2.5, 0.003
#: What all columns of a filter and order have in common beyond their noise, px: evenly, and as a ramp in
#: either direction (seven drawn rigs, whose films are then within 1.0 of their deviations, rms).
COMMON_PX = 0.0015
MIN_SAMPLES = 100


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
    warps = warp_terms(rig, samples) if warped else np.empty((len(samples), 0))
    shifts = shift_terms(rig, samples.pixel)[:, : 3 if angled else 0]
    # The parameters are those of the film, of the angle and of the warp, one after the other.
    count = len(FIELDS)
    of_film, of_angle = slice(count), slice(count, count + shifts.shape[1])
    linear_count = shifts.shape[1] + warps.shape[1]
    centre, values = (np.pad(_values(film), (0, linear_count)) for film in (mounting, rig.film))
    prior_std = np.concatenate(
        [PRIOR_STD, ANGLE_STD[: shifts.shape[1]], np.full(warps.shape[1], WARP_STD_PX)]
    )
    sigma = np.hypot(samples.std_px, FLOOR_PX)
    scale, covariance, gain = 1.0, np.eye(len(values)), np.empty((len(values), len(samples)))
    for _ in range(rounds):
        now = _with(rig, values[of_film])
        here = grating_columns(now, samples)
        ahead = [grating_columns(_with(rig, values[of_film] + step), samples) for step in np.diag(STEPS)]
        by_film = (np.stack(ahead, 1) - here[:, None]) / STEPS
        by_angle = columns_per_share(now, samples)[:, None] * shifts if angled else shifts
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
    film = _with(rig, values[of_film]).film
    if not np.isfinite(values).all() or film.lines_per_mm <= 0 or film.distance_mm <= 0:
        raise CalibrationError(
            "The fit of the film did not converge. Check the filters, and the film's data."
        )
    common = gain @ _common_offsets(rig, samples)
    spread = covariance * np.outer(prior_std, prior_std) + common @ common.T
    angle = NO_SHIFT
    if angled:
        std = np.sqrt(np.diag(spread)[of_angle])
        angle = FilterAngle(tuple(values[of_angle].tolist()), tuple(std.tolist()))
    return FilmFit(
        film=film,
        covariance=spread[of_film, of_film],
        scatter_px=scale * float(np.median(sigma)),
        gain=gain[of_film],
        angle=angle,
        warp_px=warps @ values[of_angle.stop :],
    )


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
