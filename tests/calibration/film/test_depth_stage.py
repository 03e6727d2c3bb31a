"""The film follows from lines on known planes, and a capture that does not fit is named."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.calibration.film import depth_stage
from dsl_core.calibration.film.depth_stage import (
    StageData,
    StageFilter,
    _filters,
    _fit,
    _grid_px,
    _middle,
    _require_filters,
    _samples,
    _shifts_nm,
    _warnings,
    fit_first_orders,
    stage_curves,
)
from dsl_core.calibration.film.filter_angle import columns_per_share
from dsl_core.calibration.film.fit import MAX_SLOPE, fit_film, is_plausible
from dsl_core.calibration.film.form import FilmForm
from dsl_core.calibration.film.order_columns import TileColumns
from dsl_core.calibration.film.order_paths import LineFrames
from dsl_core.calibration.film.order_samples import OrderSamples, grating_columns
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.depth_stage import FilterSeen
from dsl_core.model.rig import CorrespondenceGrid, Film, FilmShape, Rig
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.filters import nominal_filter
from dsl_core.progress import NoProgress
from tests.cases.film_samples import NOISE_PX, mounted, samples_of, shift_of_filters, small_rig
from tests.cases.order_lines import SIZE, TRUE_FILM, line_frames, plane_at, rig_with

DEPTHS_MM, FILTERS_NM = (600.0, 850.0), (480.0, 540.0, 620.0)
PLANES = [plane_at(depth) for depth in DEPTHS_MM]
TRUTH = rig_with(TRUE_FILM)


def stage_data(wrong: dict[tuple[int, int], float | None] | None = None) -> StageData:
    """Lines at two positions through three filters; ``wrong`` captures have another filter, or no light."""

    def frames(position: int, number: int) -> LineFrames:
        really = (wrong or {}).get((position, number), FILTERS_NM[number])
        if really is not None:
            return captured(position, number, really)
        lit = captured(position, number, FILTERS_NM[number])
        noise = 0.01 * np.random.default_rng(0).standard_normal(lit.radiance.shape)
        return replace(lit, radiance=noise.astype(np.float32))

    filters = tuple(StageFilter(nm, nominal_filter(nm), True) for nm in FILTERS_NM)
    return StageData(DEPTHS_MM, 0.01, (), filters, frames, 6)


@cache
def captured(position: int, number: int, really_nm: float) -> LineFrames:
    """The lines of one capture, made once for all tests."""
    return line_frames(TRUTH, PLANES[position], FILTERS_NM[number], 10 * position + number, really_nm, skip=2)


@pytest.mark.slow
def test_the_film_is_found_from_its_data_sheet() -> None:
    fit, samples = fit_first_orders(rig_with(Film()), PLANES, stage_data(), NoProgress())
    assert set(zip(samples.position.tolist(), samples.filter.tolist(), strict=True)) == set(np.ndindex(2, 3))
    off = grating_columns(rig_with(fit.film), samples) - grating_columns(TRUTH, samples)
    before = grating_columns(rig_with(Film()), samples) - grating_columns(TRUTH, samples)
    assert np.sqrt(np.mean(before**2)) > 1.0
    assert np.sqrt(np.mean(off**2)) < 0.03
    assert fit.film.lines_per_mm == pytest.approx(TRUE_FILM.lines_per_mm, abs=5 * fit.std["lines_per_mm"])
    assert (samples.pixel < SIZE[0] * SIZE[1]).all()


@pytest.mark.slow
def test_a_film_that_fits_as_a_cylinder_is_one() -> None:
    rig = small_rig()
    samples = samples_of(rig, NOISE_PX)
    assert _fit(mounted(rig), samples, Film()).film == fit_film(mounted(rig), samples, Film()).film


@pytest.mark.slow
@pytest.mark.parametrize("index", [None, 1.9])
def test_a_bent_film_and_filters_seen_at_an_angle_are_told_apart(index: float | None) -> None:
    rig = small_rig()
    shape = FilmShape(middle_mm=-6.0, factors=(0.0075, 0.0, 0.00015, 0.0, 0.0, 0.0))
    rig = rig.model_copy(update={"film": rig.film.model_copy(update={"shape": shape})})
    straight = seen = samples_of(rig, NOISE_PX)
    if index is not None:
        shift = shift_of_filters(rig, seen.pixel, index, 3.0)
        seen = replace(seen, column_px=seen.column_px + columns_per_share(rig, seen) * shift)
    found = _fit(mounted(rig), seen, Film())
    assert (found.angle.index is None) == (index is None)
    if found.angle.index is not None:
        assert found.angle.index[0] == pytest.approx(index, abs=0.02)
    assert found.film.lines_per_mm == pytest.approx(rig.film.lines_per_mm, abs=0.1)
    off = grating_columns(mounted(rig).model_copy(update={"film": found.film}), straight)
    assert np.sqrt(np.mean((off - grating_columns(rig, straight)) ** 2)) < 0.02


@pytest.mark.slow
def test_no_film_is_bent_more_than_one_can_be() -> None:
    rig = small_rig()
    shape = FilmShape(middle_mm=-6.0, factors=(0.05, 0.0, 0.0, 0.0, 0.0, 0.0))
    bent = rig.model_copy(update={"film": rig.film.model_copy(update={"shape": shape})})
    odd = samples_of(bent, NOISE_PX)
    found = fit_film(mounted(rig), odd, Film(), shaped=True).film
    assert is_plausible(found, Film())
    assert FilmForm.of(rig.projector, rig.film, shaped=True).steepest(found) > MAX_SLOPE
    assert _fit(mounted(rig), odd, Film()).film.shape is None


@pytest.mark.slow
def test_a_wrong_filter_is_named_with_its_wavelength() -> None:
    with pytest.raises(CalibrationError, match=r"850 mm, filter of 540 nm.*about \+1\d"):
        fit_first_orders(rig_with(Film()), PLANES, stage_data({(1, 1): 555.0}), NoProgress())


def test_a_capture_without_first_orders_is_named() -> None:
    with pytest.raises(CalibrationError, match="600 mm, filter of 620 nm: no first orders were found"):
        fit_first_orders(rig_with(Film()), PLANES, stage_data({(0, 2): None}), NoProgress())


NONE = StageData(DEPTHS_MM, 0.01, (), stage_data().filters, stage_data().frames, 6)


def shifted(nm: dict[tuple[int, int], float]) -> tuple[Rig, OrderSamples]:
    """Samples of the true film, those of some captures as of light so many nm longer."""
    rig = TRUTH
    parts = []
    for position, name, order in np.ndindex(2, 3, 2):
        pixels = np.arange(1000, 1060)
        few = TileColumns(
            1 - 2 * order, FILTERS_NM[name], pixels, pixels, np.full(60, DEPTHS_MM[position]), np.zeros(60),
            np.full(60, 0.01),
        )  # fmt: skip
        parts.append((position, name, few))
    samples = OrderSamples.of(parts)
    columns = grating_columns(rig, samples)
    per_nm = rig.projector.fx_px * rig.film.lines_per_mm * 1e-6
    for (position, name), off in nm.items():
        mine = (samples.position == position) & (samples.filter == name)
        columns = columns + mine * samples.order * off * per_nm
        # A few that see something else say nothing.
        columns[np.flatnonzero(mine)[:40:2]] += 30.0
    return rig, replace(samples, column_px=columns)


def test_light_seems_off_by_the_median_of_both_orders_in_their_own_directions() -> None:
    rig, samples = shifted({(1, 2): 3.0, (0, 1): -2.0})
    found = _shifts_nm(rig, NONE, samples)
    wanted = np.zeros((2, 3))
    wanted[1, 2], wanted[0, 1] = 3.0, -2.0
    assert found == pytest.approx(wanted, abs=1e-6)
    per_nm = rig.projector.fx_px * rig.film.lines_per_mm * 1e-6
    seen = _filters(rig, NONE, samples)
    assert [each.filter_nm for each in seen] == list(FILTERS_NM)
    assert seen[1].shift_px == pytest.approx((-2.0 * per_nm, 0.0), abs=1e-6)
    assert seen[2].shift_px == pytest.approx((0.0, 3.0 * per_nm), abs=1e-6)
    assert [each.tiles for each in seen] == [240] * 3
    assert seen[0].effective_nm == FILTERS_NM[0]


@pytest.mark.parametrize(("second", "found"), [(20, True), (19, False)])
def test_forty_tiles_of_both_orders_are_enough(
    monkeypatch: pytest.MonkeyPatch, second: int, found: bool
) -> None:
    lengths = iter([20, second])
    taken: list[Any] = []

    def find(*_: object) -> list[int]:
        return [0] * next(lengths)

    monkeypatch.setattr(depth_stage, "filter_passband", lambda *_: None)
    monkeypatch.setattr(depth_stage, "fit_columns", find)
    monkeypatch.setattr(depth_stage, "OrderSamples", SimpleNamespace(of=taken.extend))
    data: Any = SimpleNamespace(
        filters=[SimpleNamespace(transmission=None)],
        frames=lambda *_: None,
        name=lambda position, name: f"{position} {name}",
    )
    with nullcontext() if found else pytest.raises(CalibrationError, match="no first orders were found"):
        _samples(TRUTH, PLANES[:1], data, False, NoProgress())
    assert len(taken) == 2 * found


def test_a_filter_is_doubtful_from_three_tenths_of_a_pixel_on() -> None:
    def seen(*shift_px: float) -> FilterSeen:
        return FilterSeen(filter_nm=540.0, effective_nm=541.0, measured=True, shift_px=shift_px, tiles=9)

    assert _warnings(NONE, [seen(0.29, -0.29)]) == []
    (first,) = _warnings(NONE, [seen(0.0, 0.31)])
    assert first.startswith("Through the filter of 540 nm first orders are +0.31 px off at 850 mm")
    assert len(_warnings(NONE, [seen(-0.31, 0.31), seen(0.4, 0.0)])) == 3


@pytest.mark.parametrize(("share", "fits"), [(0.99, True), (1.01, False)])
def test_a_filter_that_is_off_by_a_limit_is_named_with_how_far(share: float, fits: bool) -> None:
    rig = TRUTH
    per_nm = rig.projector.fx_px * rig.film.lines_per_mm * 1e-6
    rig, samples = shifted({(1, 1): -0.5 * share / per_nm})
    if fits:
        _require_filters(rig, rig, NONE, samples, 0.5)
    else:
        with pytest.raises(CalibrationError, match=r"850 mm, filter of 540 nm: .* about -1\.\d nm off"):
            _require_filters(rig, rig, NONE, samples, 0.5)


def grid(rows: tuple[float, ...] = (10.0, 30.0), columns: tuple[float, ...] = (20.0, 60.0, 100.0)) -> Any:
    """Power laws whose coefficients tell their node: alpha is the number of the law, beta 1, gamma 5."""
    shape = (2, 3, len(rows), len(columns))
    laws = np.stack([np.arange(np.prod(shape)), np.ones(np.prod(shape)), np.full(np.prod(shape), 5.0)], 1)
    return CorrespondenceGrid(
        orders=(1, -1), wavelengths_nm=(450.0, 550.0, 650.0), rows_px=rows, columns_px=columns,
        depth_unit_mm=500.0, depth_range_mm=(500.0, 1000.0), coefficients=tuple(laws.ravel().tolist()),
    )  # fmt: skip


def test_curves_are_drawn_at_the_node_nearest_to_the_middle_of_the_picture() -> None:
    assert _middle(TRUTH, None) == (36, 56)  # of rows 0 to 71 and columns 0 to 111
    assert _middle(TRUTH, grid()) == (30, 60)
    assert _middle(TRUTH, grid((36.0, 34.0), (54.0, 58.0))) == (36, 54)


def test_columns_of_a_grid_are_power_laws_linear_between_wavelengths() -> None:
    laws, depth = grid(), np.array([500.0, 750.0])
    # Order -1 is the second of two, of three wavelengths, two rows and three columns each.
    first = 18 + 6 * np.arange(3) + 3 * 1 + 1
    for nm, alpha in ((450.0, first[0]), (575.0, first[1] + 0.25 * 6), (650.0, first[2]), (700.0, first[2])):
        found = _grid_px(laws, depth, -1, nm, (30, 60))
        assert found == pytest.approx(alpha * depth / 500 + 5)


def test_curves_of_film_and_grid_end_where_light_would_come_from_outside_the_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(depth_stage, "apply_depth_stage", lambda record, rig: rig)
    monkeypatch.setattr("dsl_core.optics.correspondence.HybridModel", GratingModel)
    seen = (
        FilterSeen(filter_nm=540.0, effective_nm=541.0, measured=True, shift_px=(0.1, -0.2), tiles=9),
        FilterSeen(filter_nm=690.0, effective_nm=690.0, measured=True, shift_px=(0.0, 0.3), tiles=9),
    )
    positions = [SimpleNamespace(distance_mm=z) for z in (500.0, 900.0)]
    record: Any = SimpleNamespace(correspondence=grid(), positions=positions, filters=seen)
    curves = stage_curves(record, TRUTH)
    assert [(each.order, each.filter_nm) for each in curves] == [(1, 540), (1, 690), (-1, 540), (-1, 690)]
    where = torch.full((41,), 30 * 112 + 60)
    for each, (nm, shift) in zip(curves, [(541.0, (0.1, -0.2)), (690.0, (0.0, 0.3))] * 2, strict=True):
        assert each.depth_mm == pytest.approx(np.linspace(500, 900, 41))
        exact = GratingModel(TRUTH).exact(where, torch.as_tensor(each.depth_mm), each.order, np.array([nm]))
        inside = exact.inside(640, 360)[0].numpy()
        assert np.isfinite(each.film_px).tolist() == inside.tolist()
        assert each.film_px[inside] == pytest.approx(exact.columns[0].numpy()[inside])
        assert each.grid_px is not None
        laws = _grid_px(grid(), each.depth_mm, each.order, nm, (30, 60))
        assert np.isfinite(each.grid_px).tolist() == inside.tolist()
        assert each.grid_px[inside] == pytest.approx(laws[inside])
        assert each.shift_px == pytest.approx(each.order * np.array(shift))
        assert each.seen_mm.tolist() == [500.0, 900.0]
        ends = np.where(inside[[0, 40]], each.film_px[[0, 40]] + each.shift_px, np.nan)
        assert each.seen_px == pytest.approx(ends, nan_ok=True)
    plain = SimpleNamespace(**{**vars(record), "correspondence": None})
    assert stage_curves(plain, TRUTH)[0].grid_px is None  # type: ignore[arg-type]
