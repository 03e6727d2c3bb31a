"""Film and geometry from a flat target on a stage: planes, first orders on them, and their curves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import ColumnSamples
from dsl_core.calibration.film.correspondence import fit_stage_grid
from dsl_core.calibration.film.filter_angle import seen_straight
from dsl_core.calibration.film.fit import (
    MAX_SLOPE,
    FilmFit,
    fit_film,
    is_plausible,
    require_plausible,
    with_geometry,
)
from dsl_core.calibration.film.form import FilmForm
from dsl_core.calibration.film.order_columns import fit_columns, search_columns
from dsl_core.calibration.film.order_paths import LineFrames, filter_passband
from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.calibration.film.residual import MIN_GAIN, choose_residual
from dsl_core.calibration.film.zero_place import require_still
from dsl_core.calibration.geometry.plane_refinement import PlaneRefinement, refine_planes
from dsl_core.calibration.geometry.stage_planes import MAX_STEP_MM, STAGE_SIGMAS, with_unsure_zero
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.depth_stage import (
    DepthStageCalibration,
    FilterSeen,
    StagePosition,
    apply_depth_stage,
)
from dsl_core.model.projector.line_spread import zero_std_px
from dsl_core.model.rig import CorrespondenceGrid, Film, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.shading import Plane
from dsl_core.optics.spectra import ORDERS
from dsl_core.progress import Progress

Floats = NDArray[np.float64]

#: First a search over many columns, then fits from within a few.
FINE_ROUNDS = 2
#: Tiles, of both orders together, that a capture needs.
MIN_TILES = 40
#: A filter's light is this far (px) from where all others put it: another filter, or a tilted one.
WRONG_PX, OFF_PX = 2.0, 0.5
#: Doubt about a filter: this far off (px), as much as columns that a fit never saw may be. Lenses that
#: magnify red by a little more than green move a filter by less, and harm no band.
DOUBT_PX = 0.3
#: Depths at which curves are drawn.
CURVE_POINTS = 41


@dataclass(frozen=True)
class StageFilter:
    """A bandpass filter: nominal centre, transmission, and whether that was measured."""

    filter_nm: float
    transmission: SpectralCurve
    measured: bool


@dataclass(frozen=True)
class StageData:
    """What was captured of the plane.

    ``positions_mm`` are what the stage said, with the deviation ``stage_std_mm``; ``columns`` are the zero
    order's tile means at each; ``frames(position, filter)`` reads the lines of a position through a filter,
    by their indices; ``exposures`` counts all.
    """

    positions_mm: tuple[float, ...]
    stage_std_mm: float
    columns: tuple[ColumnSamples, ...]
    filters: tuple[StageFilter, ...]
    frames: Callable[[int, int], LineFrames]
    exposures: int

    def name(self, position: int, filter: int) -> str:
        """What a person calls a capture."""
        return f"{self.positions_mm[position]:g} mm, filter of {self.filters[filter].filter_nm:g} nm"


def calibrate_depth_stage(
    rig: Rig, data: StageData, progress: Progress, grid: bool = False
) -> DepthStageCalibration:
    """Refine lenses and pose by planes, and fit the film and its residual to first orders on them.

    With ``grid`` the published data-driven model is fitted too. The rig's `geometry_covariance` is the
    prior of its geometry, which stays as it is without one; its `lateral_colour` is part of where first
    orders are, and its `projector_response` is that by which the planes' columns were found. Raises
    `CalibrationError` that names the position or the filter that does not fit.
    """
    progress.report("planes", 0, 1)
    spread, covariance = rig.projector_response.spread, None
    lean_px = 0.0 if spread is None else spread.lean_px
    if rig.geometry_covariance is not None:
        known = np.array(rig.geometry_covariance).reshape(24, 24)
        covariance = with_unsure_zero(known, zero_std_px(lean_px))
    planes = refine_planes(rig, data.positions_mm, data.columns, covariance, data.stage_std_mm)
    every = range(len(data.filters))
    names = [[data.name(k, n) for n in every] for k in range(len(data.positions_mm))]
    require_still(planes.rig, planes.planes, names, data.frames)
    film, samples = fit_first_orders(planes.rig, planes.planes, data, progress)
    fitted = planes.rig.model_copy(update={"film": film.film})
    film = with_geometry(film, fitted, samples, planes.variants(), progress)
    residual, held_out = choose_residual(
        fitted,
        samples,
        [f"position {z:g} mm" for z in data.positions_mm],
        [f"filter {each.filter_nm:g} nm" for each in data.filters],
        progress,
    )
    seen = _filters(fitted, data, samples)
    return DepthStageCalibration(
        camera=fitted.camera,
        projector=fitted.projector,
        pose=fitted.pose,
        geometry_covariance=None if covariance is None else tuple(planes.covariance.ravel().tolist()),
        column_std_px=planes.column_std_px if covariance is not None else rig.column_std_px,
        depth_std_mm=planes.depth_std_mm,
        geometry_pull=planes.pull,
        lean_px=lean_px,
        bow_mm=planes.bow_mm,
        bow_std_mm=planes.bow_std_mm,
        positions=_positions(data, planes),
        film=film.film,
        film_std=film.std,
        scatter_px=film.scatter_px,
        filter_index=film.angle.index,
        filter_index_before=rig.filter_index,
        filters=seen,
        lateral_colour=rig.lateral_colour,
        residual=residual,
        held_out=held_out,
        correspondence=fit_stage_grid(fitted, samples).grid if grid else None,
        frames=data.exposures,
        warnings=tuple(_warnings(data, seen)),
    )


def fit_first_orders(
    rig: Rig, planes: Sequence[Plane], data: StageData, progress: Progress
) -> tuple[FilmFit, OrderSamples]:
    """The film fitted to first orders on known planes, from that of ``rig`` on, and the samples.

    Where filters shift with the angle of view, samples are returned as if they did not.
    """
    here, mounting = rig, rig.film
    for round_ in range(1 + FINE_ROUNDS):
        samples = _samples(here, planes, data, round_ == 0, progress)
        fit = _fit(here, samples, mounting)
        here = rig.model_copy(update={"film": fit.film})
        samples = seen_straight(here, samples, fit.angle)
        _require_filters(rig, here, data, samples, WRONG_PX if round_ == 0 else OFF_PX)
        require_plausible(fit.film, mounting)
    return fit, samples


def _fit(rig: Rig, samples: OrderSamples, mounting: Film) -> FilmFit:
    """The film that fits best: a cylinder, or one of another shape where a cylinder leaves more over.

    A cylinder that fits such a film is often one that cannot stand where it was mounted.
    """
    flat, bent = (_fit_filters(rig, samples, mounting, shaped) for shaped in (False, True))
    form = FilmForm.of(rig.projector, bent.film, shaped=True)
    if not is_plausible(bent.film, mounting) or form.steepest(bent.film) > MAX_SLOPE:
        return flat
    better = bent.scatter_px < (1 - MIN_GAIN) * flat.scatter_px or not is_plausible(flat.film, mounting)
    return bent if better else flat


def _fit_filters(rig: Rig, samples: OrderSamples, mounting: Film, shaped: bool) -> FilmFit:
    """The film with filters that shift with the angle of view where that is beyond doubt."""
    askew = fit_film(rig, samples, mounting, angled=True, shaped=shaped)
    if askew.angle.is_of_filters and is_plausible(askew.film, mounting):
        return askew
    return fit_film(rig, samples, mounting, shaped=shaped)


def _samples(
    rig: Rig, planes: Sequence[Plane], data: StageData, coarse: bool, progress: Progress
) -> OrderSamples:
    model, find = GratingModel(rig), search_columns if coarse else fit_columns
    parts = []
    count = len(planes) * len(data.filters)
    for number in range(count):
        progress.report("first orders, roughly" if coarse else "first orders", number, count)
        position, name = divmod(number, len(data.filters))
        frames = data.frames(position, name)
        found = [
            find(rig, planes[position], frames, passband, model)
            for passband in (
                filter_passband(rig, data.filters[name].transmission, order, _dispersion(rig))
                for order in ORDERS
            )
        ]
        if sum(len(part) for part in found) < MIN_TILES:
            raise CalibrationError(
                f"Position {data.name(position, name)}: no first orders were found. Check that this filter is"
                " in the beam, that the film is on, and expose longer."
            )
        parts += [(position, name, part) for part in found if len(part)]
    return OrderSamples.of(parts)


def _dispersion(rig: Rig) -> float:
    """Columns a nm, near the projector's axis: what turns its blur into wavelengths."""
    return rig.projector.fx_px * rig.film.lines_per_mm * 1e-6


def _require_filters(
    mounted: Rig, fitted: Rig, data: StageData, samples: OrderSamples, limit_px: float
) -> None:
    """Raise `CalibrationError` when one filter's light is not where all others put it."""
    limit_nm = limit_px / _dispersion(fitted)
    if np.abs(_shifts_nm(fitted, data, samples)).max() < limit_nm:
        return
    position, name, off_nm = _odd_one(mounted, fitted, data, samples)
    raise CalibrationError(
        f"Position {data.name(position, name)}: the first orders are where light of another wavelength"
        f" would be, about {off_nm:+.1f} nm off. Check that the filter is the right one, not tilted, and"
        " nothing moved, and capture this step again."
    )


def _odd_one(mounted: Rig, fitted: Rig, data: StageData, samples: OrderSamples) -> tuple[int, int, float]:
    """The capture without which all others agree best: position, filter, and how far it is off, nm."""
    found, shaped = [], fitted.film.shape is not None
    # A wrong capture pulls the film towards itself, so that others may look worse than it.
    for position, name in np.ndindex(len(data.positions_mm), len(data.filters)):
        mine = (samples.position == position) & (samples.filter == name)
        film = fit_film(fitted, samples.only(~mine), mounted.film, shaped=shaped).film
        shifts = _shifts_nm(fitted.model_copy(update={"film": film}), data, samples)
        off = float(shifts[position, name])
        shifts[position, name] = 0.0
        found.append((float(np.abs(shifts).max()), position, name, off))
    _, position, name, off = min(found)
    return position, name, off


def _shifts_nm(rig: Rig, data: StageData, samples: OrderSamples) -> Floats:
    """By how many nm the light of each position and filter seems off, (positions, filters)."""
    # Both orders move away from the zero order with wavelength, in opposite directions.
    off = (samples.column_px - grating_columns(rig, samples)) * samples.order / _dispersion(rig)
    shifts = np.zeros((len(data.positions_mm), len(data.filters)))
    for position, name in np.ndindex(shifts.shape):
        mine = (samples.position == position) & (samples.filter == name)
        shifts[position, name] = np.median(off[mine])
    return shifts


def _filters(rig: Rig, data: StageData, samples: OrderSamples) -> tuple[FilterSeen, ...]:
    shifts = _shifts_nm(rig, data, samples) * _dispersion(rig)
    found = []
    for name, each in enumerate(data.filters):
        mine = samples.filter == name
        found.append(
            FilterSeen(
                filter_nm=each.filter_nm,
                effective_nm=float(samples.wavelength_nm[mine].mean()),
                measured=each.measured,
                shift_px=tuple(shifts[:, name].tolist()),
                tiles=int(mine.sum()),
            )
        )
    return tuple(found)


def _positions(data: StageData, planes: PlaneRefinement) -> tuple[StagePosition, ...]:
    return tuple(
        StagePosition(
            position_mm=position,
            tilt_deg=plane.tilt_deg,
            distance_mm=float(1 / np.linalg.norm(plane.inverse)),
            plane_rms_mm=float(planes.plane_rms_mm[k]),
            column_rms_px=float(planes.residual_rms_px[k]),
            column_limit_px=float(planes.limit_px[k]),
            step_error_mm=float(planes.step_error_mm[k]),
            step_std_mm=float(planes.step_std_mm[k]),
            step_limit_mm=max(MAX_STEP_MM, STAGE_SIGMAS * data.stage_std_mm),
        )
        for k, (position, plane) in enumerate(zip(data.positions_mm, planes.planes, strict=True))
    )


def _warnings(data: StageData, seen: Sequence[FilterSeen]) -> list[str]:
    """Filters whose light is slightly off."""
    return [
        f"Through the filter of {each.filter_nm:g} nm first orders are {shift:+.2f} px off at"
        f" {position:g} mm; it may be tilted, or its transmission may differ from the one given"
        for each in seen
        for position, shift in zip(data.positions_mm, each.shift_px, strict=True)
        if abs(shift) > DOUBT_PX
    ]


@dataclass(frozen=True)
class StageCurve:
    """One order at one filter's wavelength: columns (px) by film and residual, and by the data-driven grid.

    NaN where the light would come from outside the projector's frame, so that nothing was measured.

    ``depth_mm``, ``film_px`` and ``grid_px`` (None without a grid) are curves. ``seen_mm`` are positions of
    the stage, ``seen_film_px`` the film's columns there, and ``shift_px`` the median
    offset of what was measured over the whole picture.
    """

    order: int
    filter_nm: float
    depth_mm: Floats
    film_px: Floats
    grid_px: Floats | None
    seen_mm: Floats
    seen_film_px: Floats
    shift_px: Floats

    @property
    def seen_px(self) -> Floats:
        """Columns as measured at the positions of the stage."""
        return self.seen_film_px + self.shift_px


def stage_curves(record: DepthStageCalibration, rig: Rig) -> tuple[StageCurve, ...]:
    """A curve for each order and filter; ``rig`` is what was known before."""
    import torch

    from dsl_core.optics.correspondence import HybridModel

    known = apply_depth_stage(record, rig)
    model, grid = HybridModel(known), record.correspondence
    row, column = _middle(known, grid)
    seen_mm = np.array([position.distance_mm for position in record.positions])
    depth_mm = np.linspace(seen_mm.min(), seen_mm.max(), CURVE_POINTS)

    def film_px(depths_mm: Floats, order: int, nm: float) -> Floats:
        pixels = torch.full((len(depths_mm),), row * known.camera.width_px + column)
        seen = model.exact(pixels, torch.as_tensor(depths_mm), order, np.array([nm]))
        inside = seen.inside(known.projector.width_px, known.projector.height_px)
        return np.where(inside[0], seen.columns[0], np.nan)

    curves = []
    for order in ORDERS:
        for each in record.filters:
            film, seen = (film_px(depths, order, each.effective_nm) for depths in (depth_mm, seen_mm))
            laws = None
            if grid is not None and order in grid.orders:
                laws = _grid_px(grid, depth_mm, order, each.effective_nm, (row, column)) + 0 * film
            # Shifts are noted away from the zero order, which is to the other side for the order -1.
            shift = order * np.array(each.shift_px)
            curves.append(StageCurve(order, each.filter_nm, depth_mm, film, laws, seen_mm, seen, shift))
    return tuple(curves)


def _middle(rig: Rig, grid: CorrespondenceGrid | None) -> tuple[int, int]:
    """Row and column of the grid's node nearest to the middle of the picture, or of the middle itself."""
    middle = ((rig.camera.height_px - 1) / 2, (rig.camera.width_px - 1) / 2)
    nodes = (
        middle
        if grid is None
        else tuple(
            min(of, key=lambda node, at=at: abs(node - at))  # type: ignore[misc]
            for of, at in zip((grid.rows_px, grid.columns_px), middle, strict=True)
        )
    )
    return round(nodes[0]), round(nodes[1])


def _grid_px(
    grid: CorrespondenceGrid, depth_mm: Floats, order: int, nm: float, node: tuple[int, int]
) -> Floats:
    """Columns by the power laws of a node, linear between wavelengths."""
    row, column = grid.rows_px.index(node[0]), grid.columns_px.index(node[1])
    laws = grid.array[grid.orders.index(order), :, row, column]
    columns = [a * (depth_mm / grid.depth_unit_mm) ** b + c for a, b, c in laws]
    at = np.interp(nm, grid.wavelengths_nm, np.arange(len(columns)))
    low, high = int(np.floor(at)), int(np.ceil(at))
    return np.asarray(columns[low] + (at - low) * (columns[high] - columns[low]))
