"""Where a column and a ray meet: the closed form without distortion, and the iteration with it."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.lateral_colour import LateralColour
from dsl_core.model.rig import ColumnResidual, CorrespondenceGrid, Rig
from dsl_core.optics import correspondence as module
from dsl_core.optics import pinhole
from dsl_core.optics.correspondence import (
    Footprint,
    GratingModel,
    GridModel,
    HybridModel,
    _closed_form,
    _linear_matrix,
    _upsampled,
    chebyshev_nodes,
    correspondence,
    interpolation_matrix,
    projector_points,
    triangulate,
    wavelength_range,
    zero_order,
)
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig

PIXELS = torch.arange(1000, 890 * 580, 9973)
DEPTH = torch.linspace(450.0, 1000.0, len(PIXELS), dtype=torch.float64)


def straight(rig: Rig) -> Rig:
    """The rig with a projector lens that does not distort."""
    lens = rig.projector.model_copy(update={"distortion": (0.0,) * 5})
    return rig.model_copy(update={"projector": lens})


def test_the_closed_form_is_the_depth_where_nothing_distorts() -> None:
    rig = straight(published_rig())
    column, _ = zero_order(rig, PIXELS, DEPTH)
    assert _closed_form(rig, PIXELS, column) == pytest.approx(DEPTH, rel=1e-9)


def test_the_closed_form_starts_within_a_few_percent_of_the_depth() -> None:
    rig = published_rig()
    column, _ = zero_order(rig, PIXELS, DEPTH)
    assert _closed_form(rig, PIXELS, column) == pytest.approx(DEPTH, rel=0.1)


def test_depth_and_its_slope_are_those_of_the_projected_columns() -> None:
    rig = published_rig()
    column, _ = zero_order(rig, PIXELS, DEPTH)
    found, slope = triangulate(rig, PIXELS, column)
    assert found == pytest.approx(DEPTH, abs=1e-4)
    moved, _ = triangulate(rig, PIXELS, column + 0.01)
    assert ((moved - found).abs() / 0.01) == pytest.approx(slope, rel=0.01)


def all_colours(rig: Rig) -> tuple[Tensor, Tensor]:
    """Some pixels of each colour of the mosaic, and depths."""
    width = rig.camera.width_px
    pixels = torch.tensor(
        [row * width + column for row in (10, 11, 300, 301) for column in (40, 41, 700, 701)]
    )
    return pixels, torch.linspace(450.0, 900.0, len(pixels), dtype=torch.float64)


def test_a_colour_that_the_cameras_lens_magnifies_comes_from_nearer_to_its_axis() -> None:
    rig = published_rig()
    colour = LateralColour(camera=(4e-3, -1e-3, -2e-3), projector_per_nm=0.0, white_nm=(600, 550, 450))
    pixels, depth = all_colours(rig)
    rows, columns = np.divmod(pixels.numpy(), rig.camera.width_px)
    by = np.array(colour.camera)[
        ["RGB".index(rig.sensor.bayer[2 * (r % 2) + c % 2]) for r, c in zip(rows, columns, strict=True)]
    ]
    rays = pixel_rays(rig.camera)[:, rows, columns]
    rays[:2] /= 1 + by
    pose = rig.pose
    wanted = pose.matrix @ (rays * depth.numpy()) + np.array(pose.translation_mm)[:, None]
    found = projector_points(rig.model_copy(update={"lateral_colour": colour}), pixels, depth)
    assert np.stack([axis.numpy() for axis in found]) == pytest.approx(wanted, rel=1e-9, abs=1e-6)


def test_columns_and_rows_are_magnified_about_the_projectors_axis() -> None:
    rig = published_rig()
    pixels, depth = all_colours(rig)
    # Nothing of the camera, so that only the projector's side changes.
    colour = LateralColour(camera=(0.0, 0.0, 0.0), projector_per_nm=1e-5, white_nm=(620, 540, 460))
    coloured = rig.model_copy(update={"lateral_colour": colour})
    by = torch.tensor(colour.projector_of_white, dtype=torch.float64)
    rows, columns = np.divmod(pixels.numpy(), rig.camera.width_px)
    own = by[["RGB".index(rig.sensor.bayer[2 * (r % 2) + c % 2]) for r, c in zip(rows, columns, strict=True)]]
    lens = rig.projector
    for centre, plain, moved in zip(
        (lens.cx_px, lens.cy_px),
        zero_order(rig, pixels, depth),
        zero_order(coloured, pixels, depth),
        strict=True,
    ):
        assert moved - plain == pytest.approx((plain - centre) * own, abs=1e-9)
    nm = np.array([450.0, 550.0, 650.0])
    first, new = (GratingModel(each).exact(pixels, depth, 1, nm) for each in (rig, coloured))
    share = torch.as_tensor(colour.projector(nm))[:, None]
    assert new.columns - first.columns == pytest.approx((first.columns - lens.cx_px) * share, abs=1e-9)
    assert new.rows - first.rows == pytest.approx((first.rows - lens.cy_px) * share, abs=1e-9)


def with_residual(rig: Rig) -> Rig:
    residual = ColumnResidual(
        orders=(1,),
        column_range_px=(0.0, rig.camera.width_px - 1),
        row_range_px=(0.0, rig.camera.height_px - 1),
        depth_range_mm=(400.0, 1000.0),
        wavelength_range_nm=(400.0, 700.0),
        degrees=((1, 0, 0, 0), (0, 1, 0, 1)),
        coefficients_px=((0.5, 0.25),),
    )
    return rig.model_copy(update={"residual": residual})


def test_a_residual_moves_columns_of_its_orders_and_no_rows() -> None:
    rig = with_residual(published_rig())
    pixels, depth = all_colours(rig)
    nm = np.array([430.0, 555.0, 640.0])
    plain, moved = GratingModel(rig), HybridModel(rig)
    rows, columns = np.divmod(pixels.numpy(), rig.camera.width_px)
    x, y = 2 * columns / (rig.camera.width_px - 1) - 1, 2 * rows / (rig.camera.height_px - 1) - 1
    wanted = 0.5 * x + 0.25 * y * ((2 * nm - 1100) / 300)[:, None]
    old, new = plain.exact(pixels, depth, 1, nm), moved.exact(pixels, depth, 1, nm)
    assert (new.columns - old.columns).numpy() == pytest.approx(wanted, abs=1e-9)
    assert torch.equal(new.rows, old.rows)
    assert torch.equal(moved.exact(pixels, depth, -1, nm).columns, plain.exact(pixels, depth, -1, nm).columns)
    traced = moved.trace(pixels, depth, 1, nm)
    assert traced.columns == pytest.approx(new.columns, abs=0.03)


def test_pixels_beyond_a_chunk_are_solved_as_the_first_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = with_residual(published_rig())
    pixels, depth = all_colours(rig)
    nm = np.array([430.0, 555.0, 640.0])
    whole = HybridModel(rig).exact(pixels, depth, 1, nm)
    monkeypatch.setattr(module, "CHUNK", 3)
    parts = HybridModel(rig).exact(pixels, depth, 1, nm)
    assert parts.columns == pytest.approx(whole.columns, abs=1e-9)
    assert parts.rows == pytest.approx(whole.rows, abs=1e-9)


def grid_rig(rig: Rig) -> Rig:
    """The data-driven model with coefficients that are linear in row, column and wavelength."""
    orders, nm = (-1, 1), (450.0, 550.0, 650.0)
    rows, columns = (0.0, 200.0, 400.0, 579.0), (0.0, 300.0, 600.0, 889.0)
    nodes = np.zeros((2, 3, 4, 4, 3))
    for i, order in enumerate(orders):
        for j, w in enumerate(nm):
            for k, row in enumerate(rows):
                for m, column in enumerate(columns):
                    nodes[i, j, k, m] = coefficients(order, w, row, column)
    grid = CorrespondenceGrid(
        orders=orders, wavelengths_nm=nm, rows_px=rows, columns_px=columns, depth_unit_mm=500.0,
        depth_range_mm=(400.0, 1000.0), coefficients=tuple(nodes.ravel()),
    )  # fmt: skip
    return rig.model_copy(update={"correspondence": grid})


def coefficients(order: int, nm: float, row: float, column: float) -> tuple[float, float, float]:
    return (
        10 + 0.01 * column + 0.1 * (nm - 550),
        -1.2,
        300 + order * 50 + 0.02 * row + order * 0.2 * (nm - 550),
    )


@pytest.mark.parametrize("order", [-1, 1])
def test_the_grid_is_a_power_of_depth_linear_in_wavelength_and_extrapolated(order: int) -> None:
    rig = grid_rig(published_rig())
    pixels, depth = all_colours(rig)
    nm = np.array([430.0, 450.0, 520.0, 550.0, 610.0, 690.0])
    rows, columns = np.divmod(pixels.numpy(), rig.camera.width_px)
    wanted = np.zeros((len(nm), len(pixels)))
    for i, w in enumerate(nm):
        for j, (row, column, z) in enumerate(zip(rows, columns, depth.numpy(), strict=True)):
            alpha, beta, gamma = coefficients(order, w, row, column)
            wanted[i, j] = alpha * (z / 500) ** beta + gamma
    found = GridModel(rig).trace(pixels, depth, order, nm)
    assert found.columns.numpy() == pytest.approx(wanted, abs=2e-3)
    assert torch.equal(found.rows, GratingModel(rig).trace(pixels, depth, order, nm).rows)


def test_other_orders_of_the_grid_are_those_of_the_grating() -> None:
    rig = grid_rig(published_rig())
    pixels, depth = all_colours(rig)
    nm = np.array([450.0, 550.0])
    model = GridModel(rig)
    for order in (2, -2):
        second = model.trace(pixels, depth, order, nm)
        assert torch.equal(second.columns, GratingModel(rig).trace(pixels, depth, order, nm).columns)
    zero = model.trace(pixels, depth, 0, nm)
    assert torch.equal(zero.columns, zero_order(rig, pixels, depth)[0].expand(2, -1))
    assert rig.correspondence is not None
    one = rig.model_copy(update={"correspondence": rig.correspondence.model_copy(update={"orders": (-1,)})})
    with pytest.raises(CalibrationError, match="covers orders"):
        GridModel(one).trace(pixels, depth, 1, nm)


def test_the_model_is_that_which_was_calibrated() -> None:
    rig = published_rig()
    assert type(correspondence(rig)) is GratingModel
    assert type(correspondence(grid_rig(rig))) is GridModel
    assert type(correspondence(with_residual(grid_rig(rig)))) is HybridModel
    assert type(correspondence(with_residual(grid_rig(rig)), "grating")) is GratingModel
    for name in ("hybrid", "grid"):
        with pytest.raises(CalibrationError, match="run the depth-stage calibration"):
            correspondence(rig, name)
    with pytest.raises(CalibrationError, match="choose auto"):
        correspondence(rig, "best")


def test_wavelengths_are_interpolated_as_polynomials_through_chebyshev_nodes() -> None:
    nodes = chebyshev_nodes(400.0, 700.0)
    assert nodes == pytest.approx(550 - 150 * np.cos(np.pi * (np.arange(6) + 0.5) / 6))
    targets = np.array([395.0, 431.0, 555.5, 710.0])
    cubic = np.polynomial.Polynomial([0.3, -0.01, 2e-5, 1e-8])
    assert interpolation_matrix(nodes, targets) @ cubic(nodes) == pytest.approx(cubic(targets), rel=1e-9)
    assert wavelength_range(np.array([450.0, 640.0])) == (450.0, 640.0)
    assert wavelength_range(np.array([550.0])) == (549.0, 551.0)
    assert wavelength_range(np.array([550.0, 551.5])) == (550.0, 551.5)


@pytest.mark.parametrize(("lines_per_mm", "order"), [(600.0, -2), (1000.0, 2), (1200.0, -1), (1400.0, 1)])
def test_light_that_ends_at_grazing_incidence_does_not_come_from_inside_the_frame(
    lines_per_mm: float, order: int
) -> None:
    rig = published_rig()
    film = rig.film.model_copy(update={"lines_per_mm": lines_per_mm})
    rig = rig.model_copy(update={"film": film, "camera": rig.camera.resized(56, 36)})
    place = torch.arange(56 * 36), torch.full((56 * 36,), 700.0, dtype=torch.float64), order
    size, nm = (rig.projector.width_px, rig.projector.height_px), np.arange(415.0, 676.0, 5.0)
    model = GratingModel(rig)
    traced, exact = model.trace(*place, nm), model.exact(*place, nm)
    inside = traced.inside(*size)
    assert bool(((traced.columns - exact.columns)[inside].abs() < 1).all())


def test_light_comes_from_inside_the_frame_or_a_margin_left_and_right_of_it() -> None:
    columns = torch.tensor([-0.6, -0.4, 9.4, 9.6, 5.0, 5.0, 5.0, 5.0])
    rows = torch.tensor([2.0, 2.0, 2.0, 2.0, -0.6, -0.4, 7.4, 7.6])
    there = Footprint(columns, rows)
    assert there.inside(10, 8).tolist() == [False, True, True, False, False, True, True, False]
    assert there.inside(10, 8, 3.0).tolist() == [True] * 4 + [False, True, True, False]
    far = Footprint(torch.tensor([-3.4, -3.6, 12.4, 12.6]), torch.full((4,), 2.0))
    assert far.inside(10, 8, 3.0).tolist() == [True, False, True, False]


def test_a_column_that_no_ray_meets_gives_no_depth() -> None:
    rig = published_rig()
    far, _ = triangulate(rig, PIXELS[:1], torch.tensor([1e5], dtype=torch.float64))
    assert far.isnan().all()


@pytest.mark.parametrize("step", [1, 700])
def test_rays_of_large_pictures_are_those_of_small_ones(monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    rig = published_rig()
    pixels = torch.arange(100_000, 100_000 + 500 * step, step)
    depth = torch.linspace(500.0, 900.0, len(pixels), dtype=torch.float64)
    wanted = zero_order(rig, pixels, depth)
    for place in (module, pinhole):
        monkeypatch.setattr(place, "KEPT_PX", 1000)
    for seen, known in zip(zero_order(rig, pixels, depth), wanted, strict=True):
        assert torch.equal(seen, known)


@pytest.mark.parametrize(("rows", "columns"), [(2, 3), (3, 2), (4, 5)])
def test_few_nodes_make_polynomials_of_the_degree_they_allow(rows: int, columns: int) -> None:
    at_rows, at_columns = np.linspace(0, 11, rows), np.linspace(0, 17, columns)

    def polynomial(y: np.ndarray, x: np.ndarray) -> np.ndarray:
        return 1 + (y / 5) ** min(3, rows - 1) - 0.3 * (x / 7) ** min(3, columns - 1)

    nodes = polynomial(at_rows[:, None], at_columns[None])
    grid = CorrespondenceGrid(
        orders=(-1, 1), wavelengths_nm=(450.0, 650.0), rows_px=tuple(at_rows), columns_px=tuple(at_columns),
        depth_range_mm=(500.0, 900.0),
        coefficients=tuple(np.stack([k * nodes for k in range(12)]).reshape(2, 2, 3, rows, columns)
                           .transpose(0, 1, 3, 4, 2).ravel()),
    )  # fmt: skip
    found = _upsampled(grid, 1, 18, 12)
    wanted = polynomial(np.arange(12)[:, None], np.arange(18)[None]).ravel()
    for coefficient, wavelength in np.ndindex(3, 2):
        scale = 6 + 3 * wavelength + coefficient
        assert found[coefficient, wavelength] == pytest.approx(scale * wanted, rel=1e-5)


def test_values_between_nodes_are_linear_and_go_on_beyond_the_last() -> None:
    nodes, targets = np.array([1.0, 2.0, 4.0]), np.array([0.0, 1.0, 1.25, 2.0, 3.5, 4.0, 5.0])
    values = np.array([3.0, 5.0, -1.0])
    assert _linear_matrix(nodes, targets) @ values == pytest.approx([1.0, 3.0, 3.5, 5.0, 0.5, -1.0, -4.0])
