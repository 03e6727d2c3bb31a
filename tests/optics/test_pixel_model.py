"""One forward model: its parts fit together, and all that read it expect the same of the same pixel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.model.projector.spread_field import SpreadField
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.colour_neighbours import bayer_colours
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.pixel_model import DEMOSAIC_SPREAD, EDGE_PX, PixelModel, demosaic_blur_px, without_offset
from dsl_core.optics.spectra import ORDERS, SECOND_ORDERS
from dsl_core.planning.samples import _of_plane
from dsl_core.planning.virtual import VirtualPixels
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction, model_of_plan
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve import banded
from dsl_core.workflows.inspection import FrameBlock, intensity_graph

SIZE, DEPTH_MM, PITCH_PX = (40, 16), 700.0, 0.625
#: Wide bands: what is 8 px outside the frame still counts a little, so that an edge elsewhere would show.
GRID = WavelengthGrid(start_nm=430.0, stop_nm=640.0, step_nm=35.0)
#: Columns of the projector's frame to the right of the picture's middle.
BEYOND_PX = 124
LINES = ScanLines(width_px=5, step_px=4)
COMB = LineComb(width_px=5, step_px=4, period_px=104)
COLOURS = LineComb(width_px=5, step_px=4, period_px=104, shifts_px=(0, 8, 20))


def straight_rig(column: int) -> Rig:
    """Lenses side by side without distortion, so that columns are the same number of pixels apart everywhere.

    The middle of the picture sees a column, and the projector's frame ends where bands of order +1 arrive.
    """
    width, height = SIZE
    camera = Lens(width_px=width, height_px=height, fx_px=1024, fy_px=1024, cx_px=width / 2, cy_px=height / 2)
    fx = 1024 * PITCH_PX
    projector = Lens(
        width_px=column + BEYOND_PX, height_px=360, fx_px=fx, fy_px=fx, cx_px=column + 64, cy_px=180
    )
    pose = Pose(rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), translation_mm=(-70, 0, 0))
    return published_rig().model_copy(update={"camera": camera, "projector": projector, "pose": pose})


def columns_px(column: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Columns of the plane at `DEPTH_MM`, exact in single precision, (rows, columns)."""
    row = column + PITCH_PX * (np.arange(SIZE[0]) - SIZE[0] / 2)
    return np.tile(row, (SIZE[1], 1)).astype(np.float32)


def test_an_order_that_the_film_does_not_have_reaches_no_pixel() -> None:
    rig, nm = published_rig(), GRID.centres_nm
    middle = rig.camera.height_px // 2 * rig.camera.width_px + rig.camera.width_px // 2
    place = torch.tensor([middle]), torch.tensor([DEPTH_MM], dtype=torch.float64)
    for known in ((1, -1), (1,)):
        some = rig.model_copy(update={"efficiency": {order: rig.efficiency[order] for order in known}})
        model = model_of_plan(some, CapturePlan(spectral=LINES), GRID, correspondence(some))
        for order in (1, -1):
            reached = model.reached(order, *place, nm)
            assert bool(reached.any()) == (order in known)
            assert torch.equal(
                reached, model.reaches(order, model.correspondence.trace(*place, order, nm), nm)
            )


@dataclass(frozen=True)
class Readers:
    """One pixel of a plane as the solver, the prediction and the intensity graph have it."""

    spectral: ScanLines | LineComb
    column: int
    tolerance: float
    pixel: tuple[int, int] = (14, 7)

    @property
    def rig(self) -> Rig:
        """The rig."""
        return straight_rig(self.column)

    @property
    def plan(self) -> CapturePlan:
        """The plan."""
        size = (self.column + BEYOND_PX, 360)
        return CapturePlan(
            code=GrayCode(rows=False), spectral=self.spectral, camera_size_px=SIZE, projector_size_px=size
        )

    @property
    def flat(self) -> int:
        """Index of the pixel."""
        return self.pixel[1] * SIZE[0] + self.pixel[0]

    def virtual(self) -> VirtualPixels:
        """The prediction."""
        view = _of_plane(self.rig, DEPTH_MM, np.array([self.flat]), 1.0)
        return VirtualPixels(self.rig, self.plan, GRID, view, dtype=torch.float64)

    @property
    def shading(self) -> float:
        """Shading of the pixel, exact in single precision as a result holds it."""
        return float(np.float32(self.virtual().view.shading[0]))

    def solver(self) -> SpectralReconstruction:
        """The solver of frames without light, whose mosaic has a deviation of one everywhere."""
        shape = SIZE[::-1]
        none, valid = np.zeros(shape, np.float32), np.zeros(shape, bool)
        valid[self.pixel[1], self.pixel[0]] = True
        depth, shading = (np.full(shape, value, np.float32) for value in (DEPTH_MM, self.shading))
        known = Pixels(columns_px(self.column), depth, shading, none, none, none, none, none, none, valid)
        dark = np.zeros((self.plan.spectral_count, *shape), np.float32)
        model = correspondence(self.rig)
        return SpectralReconstruction(
            self.rig, self.plan, GRID, model, dark, np.ones_like(dark), known, dtype=torch.float64
        )

    def graph(self, spectrum: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
        """The curves of the intensity graph, (3, frames)."""
        from dsl_core.io.result.result_arrays import ResultArrays

        shape = SIZE[::-1]
        cube = np.broadcast_to(spectrum[:, None, None], (GRID.count, *shape))
        arrays = {
            "depth_mm": np.full(shape, DEPTH_MM, np.float32),
            "column_px": columns_px(self.column),
            "shading": np.full(shape, self.shading, np.float32),
            "reflectance": cube,
        }
        result = ResultArrays(Path("a.zarr"), GRID.centres_nm, arrays)
        dark = np.zeros((self.plan.spectral_count, *shape), np.float32)
        block = FrameBlock(dark, np.ones_like(dark), (0, 0), self.rig, self.plan)
        model = intensity_graph(block, result, self.pixel).model
        assert model is not None
        return model


#: Far to the left no other order reaches the bands at the edge; in the middle of the frame others do. Banded
#: equations take the light of lines from a table, so that they agree to a share only.
CASES: dict[str, tuple[ScanLines | LineComb, int, float]] = {
    "lines at the edge": (LINES, 100, 0.01),
    "lines": (LINES, 400, 5e-4),
    "comb": (COMB, 400, 1e-6),
    "colours": (COLOURS, 400, 1e-6),
}


@pytest.fixture(scope="module", params=CASES)
def readers(request: pytest.FixtureRequest) -> Readers:
    return Readers(*CASES[request.param])


def spectrum(centres_nm: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Linear between the bands of the grid and constant beyond, as the graph takes results."""
    values = 0.4 + 0.3 * np.sin(GRID.centres_nm / 37)
    return np.asarray(np.interp(centres_nm, GRID.centres_nm, values))


def test_the_pixel_has_bands_just_inside_and_just_outside_the_margin(readers: Readers) -> None:
    """Otherwise the next test would not see an edge that is elsewhere."""
    solver = readers.solver()
    traced = solver.trace(solver.frames(slice(0, 16), slice(0, 40)))
    beyond = traced.orders[1].columns[:, 0] - (readers.column + BEYOND_PX - 0.5)
    assert ((beyond > 0) & (beyond < EDGE_PX)).any()
    assert ((beyond > EDGE_PX) & (beyond < EDGE_PX + 2)).any(), beyond


@pytest.mark.slow
def test_solver_prediction_and_graph_expect_the_same_frames(readers: Readers) -> None:
    solver, virtual = readers.solver(), readers.virtual()
    nodes = torch.as_tensor(spectrum(solver.bands.centres_nm))
    frames = solver.frames(slice(0, 16), slice(0, 40))
    traced = solver.trace(frames)
    shading = frames.known("shading")
    blur_px = demosaic_blur_px(columns_px(readers.column))

    def expected(by_px: float, blur_px: float, orders: tuple[int, ...] | None = None) -> Tensor:
        there = replace(traced, column_px=traced.column_px + by_px)
        operator = solver.model.operator(there, shading, blur_px, orders)
        return operator.forward(nodes[:, None])[..., 0]

    solved, drawn = expected(0.0, blur_px), readers.graph(spectrum(GRID.centres_nm))
    tolerance = 1e-6 * float(solved.abs().max())
    assert np.abs(drawn - solved.numpy()).max() < tolerance
    # First orders are a few percent of the zero order: alone, they agree as well.
    first = expected(0.0, blur_px, solver.model.orders)
    calm = (virtual.matrices.first[0] @ nodes) * readers.shading
    assert float((calm - first).abs().max()) < 1e-6 * float(first.abs().max())
    # The solver has each sample of the mosaic at its own column; a colour that is shown is a mean of samples.
    here, left, right = (
        expected(by_px, 0.0) - expected(by_px, 0.0, solver.model.orders)
        for by_px in (0.0, -PITCH_PX, PITCH_PX)
    )
    share = virtual.sideways[0, :, None]
    predicted = (virtual.matrices.zero[0] @ nodes) * readers.shading
    wanted = here + share * ((left + right) / 2 - here)
    assert float((predicted - wanted).abs().max()) < tolerance
    assert float(share.min()) == 0
    assert float(share.max()) > 0.2


class Seen(Exception):
    """Ends a run that has shown enough."""


def test_the_solvers_equations_are_those_of_the_operator(
    readers: Readers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the solver really solves, on frames whose weights are known."""
    given: list[Tensor] = []

    def watched(data: Tensor, *_: Any) -> None:
        given.append(data.clone())
        raise Seen

    for solve in ("solving.dense_solver.solve_dense", "solving.tensor_tiles.solve_spectra"):
        monkeypatch.setattr(f"dsl_core.reconstruction.spectral.{solve}", watched)
    solver = readers.solver()
    with pytest.raises(Seen):
        solver.run(threads=1)
    (data,) = given
    single = solver.model.single
    # Without neighbours a pixel has its own sample only, where it is: no mean of columns blurs it.
    traced = solver.trace(solver.frames(slice(0, 16), slice(0, 40)))
    one = torch.ones(1, dtype=torch.float64)
    orders = solver.model.orders if single else None
    colour = bayer_colours(readers.rig.sensor.bayer, *(np.array([i]) for i in readers.pixel[::-1]))
    operator = solver.model.operator(traced, one, 0.0, orders).matrix()[0, colour[0]]
    wanted = torch.einsum("fi,fj->ij", operator, operator) * readers.shading**2
    found = banded.to_dense(data)[0] if single else data[0]
    assert torch.equal(found.diagonal() > 0, wanted.diagonal() > 0), "other bands belong to the model"
    assert float((found - wanted).abs().max()) < readers.tolerance * float(wanted.abs().max())


def some_model(spectral: ScanLines | LineComb = COMB) -> tuple[PixelModel, Tensor, Tensor]:
    """A model, and some pixels and depths."""
    rig = published_rig()
    plan = CapturePlan(code=GrayCode(rows=False), spectral=spectral)
    model = model_of_plan(rig, plan, WavelengthGrid(step_nm=10.0), correspondence(rig))
    pixels = 290 * 890 + torch.linspace(60, 830, 5).long()
    return model, pixels, torch.linspace(600, 900, 5, dtype=torch.float64)


def random(*shape: int) -> Tensor:
    return torch.rand(shape, generator=torch.Generator().manual_seed(len(shape)), dtype=torch.float64)


@pytest.mark.parametrize("spectral", [COMB, COLOURS], ids=["grey", "colours"])
def test_matrix_is_that_of_the_forward_model(spectral: LineComb) -> None:
    model, pixels, depth = some_model(spectral)
    operator = model.operator(model.trace(pixels, depth), random(5), blur_px=0.3)
    reflectance = random(model.bands.count, 5)
    by_matrix = torch.einsum("pcfj,jp->cfp", operator.matrix(), reflectance)
    assert torch.allclose(by_matrix, operator.forward(reflectance), rtol=1e-12)


@pytest.mark.parametrize("offset_std", [0.0, 0.2])
def test_dense_equations_are_those_of_the_matrix_with_correlated_noise(offset_std: float) -> None:
    model, pixels, depth = some_model()
    traced = model.trace(pixels, depth)
    radiance, weight = random(len(model.profiles), 5), 1 + random(len(model.profiles), 5)
    variance = torch.full((5,), offset_std**2, dtype=torch.float64)
    colour = torch.tensor([0, 1, 2, 1, 0])
    matrix, right, square = model.equations(traced, colour, radiance, weight, variance)
    full = model.operator(traced, torch.ones_like(depth)).matrix()
    for p, c in enumerate(colour.tolist()):
        inverse = torch.linalg.inv(torch.diag(1 / weight[:, p]) + offset_std**2)
        wanted = full[p, c].T @ inverse @ full[p, c]
        side = full[p, c].T @ inverse @ radiance[:, p]
        squares = float(radiance[:, p] @ inverse @ radiance[:, p])
        assert torch.allclose(matrix[..., p], wanted, rtol=1e-8, atol=1e-10 * float(wanted.abs().max()))
        assert torch.allclose(right[:, p], side, rtol=1e-8, atol=1e-10 * float(side.abs().max()))
        assert float(square[p]) == pytest.approx(squares, rel=1e-10)


@pytest.mark.parametrize("variance", [0.0, 0.3, 1e6])
def test_equations_without_the_offset_are_those_of_correlated_noise(variance: float) -> None:
    operator, data, weight = random(12, 4), random(12, 1), random(1, 12, 1)[0]
    weight[4] = 0
    used = weight[:, 0] > 0
    covariance = torch.diag(1 / weight[used, 0]) + variance
    exact = operator[used].T @ torch.linalg.solve(covariance, torch.cat([operator, data], 1)[used])
    model, y = (without_offset(v, weight, torch.tensor(variance)) for v in (operator, data))
    assert torch.allclose((weight * model).T @ torch.cat([model, y], 1), exact, rtol=1e-6, atol=1e-9)


def test_parts_and_displacements_of_traced_pixels() -> None:
    model, pixels, depth = some_model()
    traced = model.trace(pixels, depth)
    some, moved = traced.part(slice(1, 3)), traced.displaced(0.5)
    again = model.trace(pixels[1:3], depth[1:3])
    assert torch.equal(some.column_px, again.column_px)
    for order, footprint in traced.orders.items():
        assert torch.allclose(some.orders[order].columns, again.orders[order].columns, atol=1e-9)
        assert torch.equal(moved.orders[order].columns, footprint.columns + 0.5)
    assert torch.equal(moved.column_px, traced.column_px)


def test_single_lines_are_far_from_second_orders_and_other_patterns_are_not() -> None:
    assert some_model(LINES)[0].orders == ORDERS
    assert some_model(COMB)[0].orders == (*ORDERS, *SECOND_ORDERS)


def test_a_pixel_outside_the_frame_has_no_zero_order_unless_its_column_was_measured() -> None:
    model, pixels, depth = some_model()
    # So near that the projector, to one side of the camera, does not reach it.
    near = torch.full_like(depth, 150.0)
    assert model.trace(pixels, depth).direct.all()
    assert not model.trace(pixels, near).direct[0]
    assert model.trace(pixels, near, torch.full_like(depth, 300.0)).direct.all()


def test_frames_are_those_whose_lines_touch_a_band() -> None:
    model, _, _ = some_model(LINES)
    columns = torch.tensor([[100.0], [140.0], [500.0]])
    some = torch.tensor([[True], [True], [False]])
    lit = model.frames(columns, some)
    assert model.lines is not None
    centres = [model.lines.first_px + model.lines.step_px * line for line in (lit.start, lit.stop - 1)]
    reach = LINES.width_px / 2 + EDGE_PX
    assert 100 - reach - LINES.step_px < centres[0] <= 100 - reach
    assert 140 + reach <= centres[1] < 140 + reach + LINES.step_px
    assert not model.frames(columns, torch.zeros_like(some))


def test_lines_are_as_wide_as_where_the_light_of_a_tile_comes_from() -> None:
    model, pixels, depth = some_model()
    traced = model.trace(pixels, depth)
    footprint = traced.orders[1]
    inside = model.inside(footprint)
    assert model.width(footprint, inside) == 1.0
    middle = float(footprint.columns[inside].mean())
    field = SpreadField(centre_px=(middle - 100, 0.0), half_px=(2000.0, 180.0), coefficients=(0.1, 2.0))
    response = model.rig.projector_response.model_copy(update={"field": field})
    model.rig = model.rig.model_copy(update={"projector_response": response})
    assert model.width(footprint, inside) == pytest.approx(np.exp(0.1 + 2.0 * 100 / 2000), rel=0.011)
    assert model.width(footprint, torch.zeros_like(inside)) == 1.0


@pytest.mark.parametrize("many", [0, 1, 2, 3])
def test_lines_of_a_pixel_are_as_wide_as_where_its_inside_bands_lie(many: int) -> None:
    model, pixels, depth = some_model()
    footprint = model.trace(pixels, depth).orders[1]
    inside = torch.zeros_like(footprint.columns, dtype=torch.bool)
    inside[:many] = True
    first = float(footprint.columns[:many].mean()) if many else 0.0
    field = SpreadField(centre_px=(first - 100, 0.0), half_px=(2000.0, 180.0), coefficients=(0.1, 2.0))
    response = model.rig.projector_response.model_copy(update={"field": field})
    model.rig = model.rig.model_copy(update={"projector_response": response})
    own = footprint.columns[:many].mean(0) - field.centre_px[0]
    wanted = (0.1 + 2.0 * own / 2000).exp() if many else torch.ones_like(own)
    assert model.widths(footprint, inside).tolist() == pytest.approx(wanted.tolist(), rel=0.011)


def test_demosaicing_blurs_by_the_typical_distance_of_neighbours() -> None:
    columns = np.array([[0.0, 0.7, 1.4, np.nan, 9.0], [0.0, -0.7, 50.0, 50.7, np.nan]])
    assert demosaic_blur_px(columns) == pytest.approx(0.7 * DEMOSAIC_SPREAD**0.5)
    assert demosaic_blur_px(np.full((2, 3), np.nan)) == 0.0


@pytest.mark.parametrize("spectral", [COMB, COLOURS], ids=["grey", "colours"])
def test_direct_light_is_the_most_that_falls_within_a_column_of_a_pixels(spectral: LineComb) -> None:
    model, _, _ = some_model(spectral)
    light = model.zero_light(torch.zeros(1, dtype=torch.float64))
    column = torch.tensor([100.0, 101.3, 102.7, 250.4], dtype=torch.float64)
    reflectance = torch.tensor([0.2, 0.4, 0.6, 0.8], dtype=torch.float64)
    # A flat spectrum, so that its colour says what each LED adds.
    moments = model.zero_moments(column).sum(-1)
    found = model.direct_light(light, column, moments.sum(1)[:, None] * reflectance)
    seen = torch.stack([light.at(column - 1), light.at(column), light.at(column + 1)])
    wanted = torch.einsum("cl,plf->cfp", moments, seen.amax(0)) * reflectance
    assert torch.allclose(found, wanted, rtol=1e-9)
    # Neither half a column less nor more would do.
    for reach in (0.5, 1.5):
        other = torch.stack([light.at(column - reach), light.at(column), light.at(column + reach)]).amax(0)
        assert not torch.allclose(other, seen.amax(0), rtol=1e-2)


def test_light_of_a_dark_colour_is_none() -> None:
    model, _, _ = some_model(COLOURS)
    negative = torch.full((3, 2), -1.0, dtype=torch.float64)
    assert float(model._by_led(negative).abs().max()) == 0.0


def test_weights_without_frames_take_nothing_away() -> None:
    values = random(4, 2)
    none = torch.zeros((4, 1), dtype=torch.float64)
    assert torch.equal(without_offset(values, none, torch.tensor(5.0, dtype=torch.float64)), values)


def test_two_neighbours_of_three_columns_have_no_known_pitch() -> None:
    assert demosaic_blur_px(np.array([0.0, np.nan, 2.0])) == 0.0
    assert demosaic_blur_px(np.array([3.0, 1.0])) == pytest.approx(2 * 0.4**0.5)
