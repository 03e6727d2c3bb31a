"""Banded normal equations of scan lines against the full image model."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.lines.equations import CENTROID_SLACK_PX, DROPPED, LineEquations, closeness_px
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import band_profile
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import ORDERS, Bands
from dsl_core.reconstruction.columns.pattern_column import radiance_profiles
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve import banded

PIXELS = 6


def model_of(rig: Rig, grid: WavelengthGrid, plan: CapturePlan) -> PixelModel:
    lines = LineSet.of(plan)
    assert lines is not None
    profiles = radiance_profiles(rig, plan)
    return PixelModel(rig, Bands.of(rig, grid), profiles, GratingModel(rig), lines)


@pytest.mark.parametrize("order", ORDERS)
def test_banded_equations_are_those_of_the_full_model(order: int) -> None:
    rig, plan = published_rig(), CapturePlan()
    model = model_of(rig, WavelengthGrid(), plan)
    # Pixels of the middle row: order +1 reaches the left ones whole, order -1 the right ones, others in part.
    pixels = 290 * 890 + torch.linspace(60, 830, PIXELS).long()
    traced = model.trace(pixels, torch.full((PIXELS,), 700.0, dtype=torch.float64), orders=(order,))
    columns = traced.orders[order].columns
    inside = model.inside(traced.orders[order])
    assert inside.any()
    assert not inside.all()
    generator = torch.Generator().manual_seed(0)
    values = torch.rand((2, plan.spectral_count, PIXELS), generator=generator, dtype=torch.float64)
    # Two pixels of each colour; the full model has all three of each.
    colour = torch.arange(PIXELS) % 3
    radiance, weight = values[:, None] * (colour == torch.arange(3)[:, None])[:, None]
    system = model.line_equations(colour, columns[0], offsets=True)
    lit = model.frames(columns, inside)
    part = slice(lit.start, lit.stop)
    system.add(order, columns, inside, values[0, part], values[1, part], lit.start)
    operator = model.operator(traced, torch.ones_like(columns[0]), orders=(order,))
    matrix = operator.matrix()
    full = matrix.reshape(PIXELS, -1, model.bands.count)
    weighted = full * weight.permute(2, 0, 1).reshape(PIXELS, -1, 1)
    expected = weighted.mT @ full
    found = banded.to_dense(system.matrix)
    assert (found - expected).abs().max() < 0.01 * expected.abs().max()
    right = torch.einsum("pcfj,cfp->jp", matrix, radiance * weight)
    assert (system.right - right).abs().max() < 0.01 * right.abs().max()
    assert not system.right[~inside].any()
    # An offset of one DN per ms is data of one in all frames.
    assert system.offset is not None
    offset = torch.einsum("pcfj,cfp->jp", matrix, weight)
    assert (system.offset - offset).abs().max() < 0.01 * offset.abs().max()


@pytest.mark.parametrize("order", ORDERS)
def test_misfit_and_samples_are_those_of_the_lines_that_light_a_pixels_bands(order: int) -> None:
    model = model_of(published_rig(), WavelengthGrid(step_nm=10.0), CapturePlan())
    pixels = 290 * 890 + torch.linspace(60, 830, PIXELS).long()
    traced = model.trace(pixels, torch.full((PIXELS,), 700.0, dtype=torch.float64), orders=(order,))
    columns = traced.orders[order].columns
    inside = model.inside(traced.orders[order])
    operator = model.operator(traced, torch.ones_like(columns[0]), orders=(order,))
    spectrum = 0.5 + 0.3 * torch.sin(torch.arange(model.bands.count, dtype=torch.float64))
    spectra = spectrum[:, None].expand(-1, PIXELS)
    colour = torch.arange(PIXELS) % 3
    light = operator.forward(spectra)[colour, :, torch.arange(PIXELS)].T
    # What is saturated has no weight, whatever it says.
    weight, frames = torch.full_like(light, 3.0), light.clone()
    weight[::2], frames[::2] = 0.0, 7.0
    system = model.line_equations(colour, columns[0])
    system.add(order, columns, inside, frames, weight, 0)
    seen = banded.to_dense(system.matrix)
    spread = torch.einsum("jp,pjk,kp->p", spectra, seen, spectra)
    misfit = system.square - 2 * (spectra * system.right).sum(0) + spread
    used = inside.any(0)
    assert used.sum() >= 3
    assert (misfit[used].abs() < 0.01 * system.square[used]).all()
    assert system.square == pytest.approx((light**2 * weight).sum(0), rel=1e-3)
    bright, faint = (((light > share * light.amax(0)) & (weight > 0)).sum(0)[used] for share in (1e-2, 1e-6))
    assert (system.samples[used] >= bright).all()
    # Half a column of the table's ends is without light: at most a line more on either side.
    assert (system.samples[used] <= faint + 2).all()
    assert not system.samples[~used].any()


def bright_equations(step_nm: float) -> LineEquations:
    """Lines so bright that the data weigh far more than any prior."""
    rig, plan = published_rig(), CapturePlan()
    model = model_of(rig, WavelengthGrid(step_nm=step_nm), plan)
    pixels = torch.arange(0, 890 * 580, 8009)
    depth = torch.full((len(pixels),), 700.0, dtype=torch.float64)
    bright = torch.full((plan.spectral_count, len(pixels)), 1e5, dtype=torch.float64)
    system = model.line_equations(torch.arange(len(pixels)) % 3, depth)
    for order, footprint in model.trace(pixels, depth).orders.items():
        inside = model.inside(footprint, margin_px=0.0)
        system.add(order, footprint.columns, inside, bright, bright, 0)
    return system


def test_bands_that_the_response_moves_towards_each_other_overlap_as_near_as_they_are() -> None:
    # Bands of 35 nm: some are 7 columns apart, though 13 in the mean.
    rig, plan = published_rig(), CapturePlan()
    model = model_of(rig, WavelengthGrid(stop_nm=640.0, step_nm=35.0), plan)
    pixels = torch.arange(0, 890 * 580, 8009)
    depth = torch.full((len(pixels),), 700.0, dtype=torch.float64)
    footprint = model.trace(pixels, depth).orders[1]
    columns, inside = footprint.columns, model.inside(footprint, margin_px=0.0)
    spacing = float((columns[-1] - columns[0]).abs().min() / (len(columns) - 1))
    slack = closeness_px(columns, inside, spacing, 40.0)
    assert slack > 5.0
    for apart in (1, 2, 3):
        both = inside[apart:] & inside[:-apart]
        nearest = float((columns[apart:] - columns[:-apart]).abs()[both].min())
        assert nearest > 40.0 or apart * spacing - slack <= nearest + 1e-9
    even = 5.0 * torch.arange(9, dtype=torch.float64)[:, None]
    assert closeness_px(even, torch.ones_like(even, dtype=torch.bool), 5.0, 40.0) == CENTROID_SLACK_PX


def test_bands_narrower_than_a_column_leave_the_equations_positive() -> None:
    matrix = bright_equations(step_nm=1.0).positive_matrix()
    matrix[0] += 2.8
    assert bool((banded.factorise(matrix).diagonal > 0).all())


def test_the_main_diagonal_holds_what_the_left_out_ones_may_add_up_to() -> None:
    """A chain of neighbours has this bound: eigenvalues move by the sum of a row that is left out."""
    system = bright_equations(step_nm=1.0)
    guarded = system.positive_matrix()
    assert torch.equal(guarded[1:], system.matrix[1:])
    share = (guarded[0] / system.matrix[0] - 1)[system.matrix[0] > 0]
    assert torch.allclose(share, torch.full_like(share, system.dropped))


@pytest.mark.parametrize("pitch_px", [1.0, 2.5, 4.0])
def test_the_guard_is_what_both_sides_of_the_main_diagonal_leave_out(pitch_px: float) -> None:
    rig, width_px = published_rig(), 5
    bands = Bands.of(rig, WavelengthGrid())
    lines = LineSet(width_px, 1, (width_px - 1) / 2, 640, 640)
    columns = 100.0 + pitch_px * torch.arange(bands.count, dtype=torch.float64)[:, None]
    blur_px = rig.projector_response.blur_px
    system = LineEquations(bands, lines, blur_px, torch.tensor([1]), columns[0])
    one = torch.ones((lines.frames, 1), dtype=torch.float64)
    system.add(1, columns, torch.ones_like(columns, dtype=torch.bool), one, one, 0)
    # The overlap of two bands' light, by how far apart they are; the table cuts its faint ends off.
    x = np.arange(-40, 40, 1 / 64)
    half_px = bands.half_width_px(columns)
    light = band_profile(x, width_px, blur_px, half_px)
    apart = np.arange(1, 30) * pitch_px - CENTROID_SLACK_PX
    overlaps = [light @ band_profile(x - d, width_px, blur_px, half_px) / (light @ light) for d in apart]
    kept = len(system.matrix) - 1
    assert sum(overlaps[kept:]) < DROPPED <= sum(overlaps[kept - 1 :])
    assert system.dropped == pytest.approx(max(2 * sum(overlaps[kept:]), 1e-6), rel=0.2)


def test_wider_lines_are_those_of_a_wider_spread() -> None:
    rig = published_rig()
    bands = Bands.of(rig, WavelengthGrid())
    lines = LineSet(5, 2, 2.0, 320, 320)
    columns = 100.0 + 2.5 * torch.arange(bands.count, dtype=torch.float64)[:, None]
    one = torch.ones((lines.frames, 1), dtype=torch.float64)
    inside = torch.ones_like(columns, dtype=torch.bool)
    blur_px = rig.projector_response.blur_px
    matrices = []
    for width, own_px in ((1.4, blur_px), (1.0, 1.4 * blur_px)):
        system = LineEquations(bands, lines, own_px, torch.tensor([1]), columns[0])
        system.add(1, columns, inside, one, one, 0, width)
        matrices.append(system.matrix)
    assert torch.equal(*matrices)


@pytest.mark.parametrize("outside", [0, 20, -1])
def test_a_band_outside_the_frame_has_no_part_in_the_equations(outside: int) -> None:
    rig = published_rig()
    bands = Bands.of(rig, WavelengthGrid())
    lines = LineSet(5, 2, 2.0, 320, 320)
    columns = 100.0 + 2.5 * torch.arange(bands.count, dtype=torch.float64)[:, None].expand(-1, 2)
    inside = torch.ones_like(columns, dtype=torch.bool)
    inside[outside, 1] = False
    one = torch.ones((lines.frames, 2), dtype=torch.float64)
    system = LineEquations(bands, lines, rig.projector_response.blur_px, torch.tensor([1, 1]), columns[0])
    system.add(1, columns, inside, one, one, 0)
    full = banded.to_dense(system.matrix)
    assert not full[1, outside].any()
    assert not full[1, :, outside].any()
    assert float(system.right[outside, 1]) == 0.0
    others = torch.ones(bands.count, dtype=torch.bool)
    others[outside] = False
    assert torch.allclose(full[1][others][:, others], full[0][others][:, others])
    # Without any band inside there is nothing to add.
    before = system.matrix.clone()
    system.add(1, columns, torch.zeros_like(inside), one, one, 0)
    assert torch.equal(system.matrix, before)


@pytest.mark.parametrize("stop", [18, 19, 20])
def test_bands_that_no_pixel_has_inside_the_frame_stay_without_light(stop: int) -> None:
    rig = published_rig()
    bands = Bands.of(rig, WavelengthGrid())
    lines = LineSet(5, 2, 2.0, 320, 320)
    columns = 100.0 + 2.5 * torch.arange(bands.count, dtype=torch.float64)[:, None].expand(-1, 2)
    inside = (torch.arange(bands.count) < stop)[:, None].expand(-1, 2)
    one = torch.ones((lines.frames, 2), dtype=torch.float64)
    system = LineEquations(bands, lines, rig.projector_response.blur_px, torch.tensor([1, 1]), columns[0])
    system.add(1, columns, inside, one, one, 0)
    full = banded.to_dense(system.matrix)
    assert not full[:, :, stop:].any()
    assert (full[:, stop - 2, stop - 1] > 0).all()


def test_the_first_and_the_last_of_the_frames_that_are_given_count_as_all_others() -> None:
    rig = published_rig()
    bands = Bands.of(rig, WavelengthGrid())
    lines = LineSet(5, 2, 2.0, 320, 320)
    columns = 100.0 + 2.5 * torch.arange(bands.count, dtype=torch.float64)[:, None].expand(-1, 2)
    inside = torch.ones_like(columns, dtype=torch.bool)
    first, last = 60, 80
    weight = torch.zeros((lines.frames, 2), dtype=torch.float64)
    weight[first : last + 1] = 1.0
    found = []
    for part in (slice(None), slice(first, last + 1)):
        system = LineEquations(bands, lines, rig.projector_response.blur_px, torch.tensor([1, 1]), columns[0])
        system.add(1, columns, inside, weight[part], weight[part], part.start or 0)
        found.append((system.matrix, system.right))
    whole, some = found
    assert whole[1].any()
    assert torch.equal(whole[0], some[0])
    assert torch.equal(whole[1], some[1])
