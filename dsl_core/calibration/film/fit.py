"""The film's pose, period and shape from columns of first orders on known planes.

All six numbers of `Film` are fitted to all samples; where samples cannot tell them apart (distance and
bend, or period and distance over few depths) the values of the mounting decide, as a prior. On request its
shape is fitted as well, and the shift of filters with the angle of view (`FilterAngle`): that is alike in
both orders and at all depths, while a film moves light by the slope of the place where it goes through.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.film.filter_angle import columns_per_share
from dsl_core.calibration.film.form import FIELDS, FilmForm
from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Film, Rig
from dsl_core.optics.filters import (
    ANGLE_STD,
    NO_SHIFT,
    FilterAngle,
    relative_shift,
    shift_slopes,
    shift_terms,
)
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.robust import huber_weights

Floats = NDArray[np.float64]

#: How well a mounting is known beforehand (one deviation), and steps of differences, by the fields.
PRIOR_STD = np.array([3.0, 3.0, 3.0, 0.01, 25.0, 3.0])
STEPS = np.array([1e-3, 1e-3, 1e-3, 1e-6, 1e-2, 1e-2])
ROUNDS = 15
#: A film that moved by less, in its deviations, has the slopes it had: they are most of a round's work.
SAME_SLOPES = 1.0
#: How far from its mounting a film can be, in the unit of each field: a frame holds it within some degrees
#: and centimetres, one that bends more touches it, and data sheets of gratings are right to a few percent.
PLAUSIBLE = np.array([10.0, 10.0, 10.0, 0.05, 50.0, 20.0])
WORDS = (
    ("tilt about x", "°"), ("tilt about y", "°"), ("roll", "°"), ("bend", "/mm"), ("density", " lines/mm"),
    ("distance from the projector", " mm"),
)  # fmt: skip
#: How steep a film's shape can be, and the step of differences over one of its powers, in its deviations.
MAX_SLOPE, SHAPE_STEP = 0.2, 1e-3
#: Residuals beyond this many deviations weigh less (Huber), and no column is better than this (px).
HUBER_SIGMAS, FLOOR_PX = 2.5, 0.003
#: What all columns of a filter and order have in common beyond their noise, px: evenly, and as a ramp in
#: either direction (seven drawn rigs, whose films are then within 1.0 of their deviations, rms).
COMMON_PX = 0.0015
MIN_SAMPLES = 100
#: In so many regions of film, filters and orders what a film's form leaves over is alike, beyond the noise:
#: a dent pushes all columns that pass it.
REGIONS = 50


@dataclass(frozen=True)
class FilmFit:
    """The film, the covariance of `FIELDS`, and the robust scatter of the residuals (px).

    ``gain`` (fields, samples) is how far each field moves when a column does. ``angle`` is the shift of the
    filters with the angle of view, none where it was not fitted.
    """

    film: Film
    covariance: Floats
    scatter_px: float
    gain: Floats
    angle: FilterAngle

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
    shaped: bool = False,
) -> FilmFit:
    """Fit the film of ``rig`` by Gauss and Newton, robustly; ``mounting`` is what its prior is about.

    With ``angled`` the filters shift with the angle of view, all alike, by what fits best; with ``shaped``
    the film need be no cylinder. Raises `CalibrationError` with too few samples, or when the fit does not
    converge.
    """
    if len(samples) < MIN_SAMPLES:
        raise CalibrationError(
            f"First orders were found in only {len(samples)} tiles of the image; {MIN_SAMPLES} are needed to"
            " fit the film. Check that the film is on, the filters, and the exposure."
        )
    shifts = shift_terms(rig, samples.pixel)[:, : 3 if angled else 0]
    form = FilmForm.of(rig.projector, rig.film, shaped)
    # The parameters are those of the film, its shape after its fields, and those of the angle.
    count = len(FIELDS) + len(form.std)
    centre, values = (np.pad(form.values(film), (0, shifts.shape[1])) for film in (mounting, rig.film))
    prior_std = np.concatenate([PRIOR_STD, form.std, ANGLE_STD[: shifts.shape[1]]])
    steps = np.concatenate([STEPS, SHAPE_STEP * form.std])
    sigma = np.hypot(samples.std_px, FLOOR_PX)
    scale, covariance, gain = 1.0, np.eye(len(values)), np.empty((len(values), len(samples)))
    by_film, moved = np.empty((len(samples), count)), np.inf
    for _ in range(rounds):
        now = form.rig(rig, values[:count])
        here = grating_columns(now, samples)
        if moved > SAME_SLOPES:
            near = [form.rig(rig, values[:count] + step) for step in np.diag(steps)]
            ahead = [grating_columns(each, samples) for each in near]
            by_film = (np.stack(ahead, 1) - here[:, None]) / steps
        residual, by_angle = samples.column_px - here, shifts
        if angled:
            stretch = columns_per_share(now, samples)
            by_angle = stretch[:, None] * shift_slopes(shifts, values[count:])
            residual -= stretch * relative_shift(shifts, values[count:])
        jacobian = np.concatenate([by_film, by_angle], 1) * prior_std
        weight, scale = huber_weights(residual, sigma, HUBER_SIGMAS)
        weight = weight / _alike(scale, len(samples))
        information = (jacobian * weight[:, None]).T @ jacobian + np.eye(len(values))
        gradient = jacobian.T @ (weight * residual) + (centre - values) / prior_std
        covariance = np.linalg.inv(information)
        gain = covariance @ (jacobian * weight[:, None]).T * prior_std[:, None]
        step = covariance @ gradient
        values = values + prior_std * step.clip(-1, 1)
        moved = float(np.abs(step / np.sqrt(np.diag(covariance))).max())
        if moved < 1e-2:
            break
    film = form.rig(rig, values[:count]).film
    if not np.isfinite(values).all() or film.lines_per_mm <= 0 or film.distance_mm <= 0:
        raise CalibrationError(
            "The fit of the film did not converge. Check the filters, and the film's data."
        )
    common = gain @ _common_offsets(rig, samples)
    spread = covariance * np.outer(prior_std, prior_std) + common @ common.T
    angle = NO_SHIFT
    if angled:
        std = np.sqrt(np.diag(spread)[count:])
        angle = FilterAngle(tuple(values[count:].tolist()), tuple(std.tolist()))
    of_fields = slice(len(FIELDS))
    return FilmFit(
        film=film,
        covariance=spread[of_fields, of_fields],
        scatter_px=scale * float(np.median(sigma)),
        gain=gain[of_fields],
        angle=angle,
    )


def _alike(scale: float, count: int) -> float:
    """How many of the samples say the same, when their residuals are ``scale`` times their noise.

    The variance beyond the noise is common to those of a region. Taken for so many witnesses, they would
    turn a film by ten degrees to make up for a tenth of a column that its form cannot say.
    """
    beyond = scale**2 - 1
    return (1 + beyond * max(1.0, count / REGIONS)) / (1 + beyond)


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
    here = grating_columns(_with(rig, fit.film), samples)
    covariance = fit.covariance.copy()
    progress = progress or NoProgress()
    for other, planes in variants:
        progress.report("what the geometry leaves open", 0, 1)
        rays = pixel_rays(other.camera).reshape(3, -1)[:, samples.pixel]
        inverse = np.stack([plane.inverse for plane in planes])[samples.position]
        there = replace(samples, depth_mm=1 / (inverse.T * rays).sum(0))
        moved = fit.gain @ (here - grating_columns(_with(other, fit.film), there))
        covariance += np.outer(moved, moved)
    progress.report("what the geometry leaves open", 1, 1)
    return replace(fit, covariance=covariance)


def _values(film: Film) -> Floats:
    return np.array([getattr(film, name) for name in FIELDS])


def _with(rig: Rig, film: Film) -> Rig:
    return rig.model_copy(update={"film": film})
