"""Columns below a pixel, depth and surface from exact and noisy synthetic data."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, Columns, LineComb, ScanLines
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.correspondence import triangulate, zero_order
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import halo_of_line, zero_order_profile
from dsl_core.reconstruction.columns.column import refine
from dsl_core.reconstruction.columns.dark_offset import by_tensors, dark_offset
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.simulation.published_rig import published_rig

LINES = LineSet(width_px=5, step_px=2, first_px=2.0, lines=318, frames=318)
RESPONSE = ProjectorResponse(blur_px=0.6, halo_peak_per_px=1e-3, halo_decay_px=31.0)
PIXELS = 4000
UNLIT_PX = (80.0, 160.0)


def peaks(
    column: torch.Tensor, amplitude: torch.Tensor, response: ProjectorResponse = RESPONSE
) -> torch.Tensor:
    """Exact zero-order signal of every line frame, (frames, pixels)."""
    centre = LINES.centre_px(torch.arange(LINES.lines))[:, None]
    half = LINES.width_px / 2
    return amplitude * zero_order_profile(column - centre, -half, half, response)


def noisy(noise: float) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """True columns, amplitudes, radiance and its deviation, float32."""
    generator = torch.Generator().manual_seed(4)
    column = 100 + 400 * torch.rand(PIXELS, generator=generator)
    amplitude = 0.5 + torch.rand(PIXELS, generator=generator)
    exact = peaks(column, amplitude)
    return (
        column,
        amplitude,
        exact + noise * torch.randn(exact.shape, generator=generator),
        torch.full_like(exact, noise),
    )


def test_refinement_is_unbiased_and_states_its_deviation() -> None:
    column, amplitude, radiance, std = noisy(0.03)
    found = refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE))
    assert found.refined.all()
    error = found.column_px - column
    z = error / found.std_px
    assert abs(float(z.mean())) < 0.08
    # The stated deviation also holds a model error and is widened, never narrowed, by the chi-square.
    assert 0.85 < float((z**2).mean()) < 1.1
    assert float(error.std()) < 0.06
    relative = (found.amplitude - amplitude) / found.amplitude_std
    assert 0.8 < float(relative.std()) < 1.1


def test_columns_in_the_middle_of_lines_that_do_not_overlap_are_as_unsure_as_stated() -> None:
    apart = LineSet(width_px=5, step_px=5, first_px=2.0, lines=128, frames=128)
    column, amplitude, _, _ = noisy(0.02)
    generator = torch.Generator().manual_seed(5)
    away = column - apart.centre_px(torch.arange(apart.lines))[:, None]
    exact = amplitude * zero_order_profile(away, -2.5, 2.5, RESPONSE)
    radiance = exact + 0.02 * torch.randn(exact.shape, generator=generator)
    found = refine(LinePeaks(column.round(), radiance, torch.full_like(exact, 0.02), apart, RESPONSE))
    error = (found.column_px - column).abs()
    loose = found.refined & (found.std_px > 0.08)
    assert 0.2 < float(loose.float().mean()) < 0.6
    assert float((error < 1.96 * found.std_px)[found.refined].float().mean()) > 0.94
    assert float((error < 1.96 * found.std_px)[loose].float().mean()) > 0.94
    assert error[loose].square().mean().sqrt() < 0.25
    own = torch.ones_like(column)
    same = refine(LinePeaks(column.round(), radiance, torch.full_like(exact, 0.02), apart, RESPONSE, own))
    assert (same.column_px - found.column_px).abs().max() < 1e-3


def test_every_pixel_is_refined_by_its_own_width_of_the_spread() -> None:
    column, amplitude, _, std = noisy(0.01)
    widths = torch.where(torch.arange(PIXELS) % 2 == 0, 0.8, 1.3)
    radiance = torch.zeros_like(std)
    for width in (0.8, 1.3):
        own = RESPONSE.with_gaussian(0.6 * width)
        radiance[:, widths == width] = peaks(column, amplitude, own)[:, widths == width]
    found = refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE, widths))
    assert found.refined.all()
    assert (found.column_px - column).abs().max() < 2e-3
    common = refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE))
    assert (common.column_px - column).abs().max() > 0.01


def test_peaks_out_of_focus_or_on_other_light_are_refined_and_said_to_be_unusual() -> None:
    column, amplitude, _, std = noisy(0.002)
    radiance = peaks(column, amplitude)
    blurred = torch.arange(PIXELS) < 1000
    radiance[:, blurred] = peaks(column, amplitude, RESPONSE.with_gaussian(1.2))[:, blurred]
    veiled = (torch.arange(PIXELS) >= 1000) & (torch.arange(PIXELS) < 2000)
    radiance[:, veiled] += 0.05 * amplitude[veiled]
    found = refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE))
    assert found.refined.all()
    assert torch.equal(found.unusual, blurred | veiled)
    error = (found.column_px - column).abs()
    assert error.max() < 0.03
    assert float((error < 1.96 * found.std_px)[found.unusual].float().mean()) > 0.95
    assert (found.std_px[found.unusual] > 3 * found.std_px[~found.unusual].max()).all()


@pytest.mark.parametrize(("share", "length_px"), [(0.3, 2.0), (-0.3, 2.0), (0.1, 3.0)])
def test_light_that_travels_to_one_side_displaces_columns_by_no_more_than_stated(
    share: float, length_px: float
) -> None:
    column, amplitude, _, std = (values[..., :300] for values in noisy(0.002))
    # Light that enters a translucent surface leaves it farther along, the less the farther.
    away = torch.arange(0.0, 10.0, 0.25)
    weight = torch.exp(-away / length_px)
    weight *= abs(share) / weight.sum()
    side = 1.0 if share > 0 else -1.0
    radiance = (1 - abs(share)) * peaks(column, amplitude)
    for px, part in zip(away, weight, strict=True):
        radiance += part * peaks(column + side * px, amplitude)
    found = refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE))
    assert found.unusual.float().mean() > 0.95
    error = (found.column_px - column)[found.unusual]
    assert abs(float(error.mean())) > 0.05
    assert float((error.abs() < 1.96 * found.std_px[found.unusual]).float().mean()) > 0.9


def test_refinement_of_exact_data_is_exact() -> None:
    column, amplitude, _, std = noisy(0.01)
    found = refine(LinePeaks(column.round(), peaks(column, amplitude), std, LINES, RESPONSE))
    assert (found.column_px - column).abs().max() < 1e-3
    assert (found.amplitude / amplitude - 1).abs().max() < 1e-3


def test_pixels_without_a_peak_keep_their_decoded_column() -> None:
    column, amplitude, radiance, std = noisy(0.03)
    coarse = column.round()
    radiance[:, :100] -= peaks(column, amplitude)[:, :100]
    std[:, 100:200] = torch.inf
    coarse[200:300] += 6
    # Two surfaces in one pixel: two peaks.
    radiance[:, 300:400] += peaks(column + 3.0, amplitude)[:, 300:400]
    std[:, 300:400] = 0.003
    found = refine(LinePeaks(coarse, radiance, std, LINES, RESPONSE))
    assert found.refined[:100].float().mean() < 0.1
    assert not found.refined[100:400].any()
    assert found.refined[400:].all()
    failed = ~found.refined
    assert torch.equal(found.column_px[failed], coarse[failed])
    coarse_px = 12**-0.5
    assert found.std_px[:200][failed[:200]].numpy() == pytest.approx(coarse_px)
    assert (found.std_px[200:400] > coarse_px - 1e-6).all(), "two peaks may be farther apart than a pixel"


def test_dark_offset_is_what_unlit_frames_read_beside_the_halo() -> None:
    column, amplitude, radiance, std = noisy(0.01)
    offset, spread = dark_offset(column, amplitude, radiance + 0.05, std, LINES, RESPONSE, UNLIT_PX)
    assert abs(float(offset.mean()) - 0.05) < 1e-3
    assert float(offset.std()) < 0.01
    assert 0.9 < float((offset - 0.05).std() / spread.mean()) < 1.1


@pytest.mark.parametrize(
    ("lines", "unlit_px"),
    [(LineSet(5, 2, 2.0, 318, 53), UNLIT_PX), (LINES, (62.0, 40.0))],
    ids=["a comb", "a coarse film"],
)
def test_where_no_frame_is_unlit_the_dark_offset_is_unknown(
    lines: LineSet, unlit_px: tuple[float, float]
) -> None:
    column, amplitude, radiance, std = noisy(0.01)
    offset, spread = dark_offset(column, amplitude, radiance, std, lines, RESPONSE, unlit_px)
    assert not offset.any()
    assert torch.isinf(spread).all()


def test_halo_far_from_a_line_is_the_profile_there() -> None:
    distance = torch.tensor([30.0, -80.0], dtype=torch.float64)
    exact = zero_order_profile(distance, -2.5, 2.5, RESPONSE)
    assert (halo_of_line(distance, LINES.width_px, RESPONSE) / exact - 1).abs().max() < 0.01


def test_line_set_counts_lines_and_frames() -> None:
    lines = LineSet.of(CapturePlan(spectral=ScanLines(width_px=5, step_px=2)))
    assert lines == LINES
    comb = LineSet.of(CapturePlan(spectral=LineComb(width_px=5, step_px=2, period_px=106)))
    assert comb is not None
    assert (comb.frames, comb.lines) == (53, 319)
    line = torch.tensor([-1, 0, 54, 318, 400])
    assert comb.exists(line).tolist() == [False, True, True, True, False]
    assert comb.frame(line).tolist() == [0, 0, 1, 0, 0]
    assert lines.nearest(torch.tensor([0.0, 4.9, 5.1])).tolist() == [-1, 1, 2]
    assert lines.centre_px(torch.tensor([0, 3])).tolist() == [2.0, 8.0]


@pytest.mark.parametrize(
    "spectral", [Columns(levels=(((0.5, 0.5, 0.5),) * 640,)), LineComb(step_px=3, period_px=100)]
)
def test_other_patterns_are_no_line_set(spectral: Columns | LineComb) -> None:
    assert LineSet.of(CapturePlan(spectral=spectral)) is None


def test_triangulation_inverts_the_zero_order() -> None:
    rig = published_rig()
    rng = np.random.default_rng(0)
    pixels = torch.as_tensor(rng.integers(0, 890 * 580, 3000))
    depth = torch.as_tensor(rng.uniform(450.0, 1200.0, 3000))
    column = zero_order(rig, pixels, depth)[0]
    found, slope = triangulate(rig, pixels, column)
    # Far outside the projector's frame its lens model is not smooth.
    inside = (column > -20) & (column < 660)
    assert inside.float().mean() > 0.8
    assert (found - depth)[inside].abs().max() < 1e-6
    ahead = zero_order(rig, pixels, depth + 0.5)[0] - zero_order(rig, pixels, depth - 0.5)[0]
    assert (slope * ahead.abs() - 1)[inside].abs().max() < 0.01


def test_rays_that_miss_the_column_have_no_depth() -> None:
    rig = published_rig()
    found, _ = triangulate(rig, torch.tensor([0]), torch.tensor([3000.0], dtype=torch.float64))
    assert torch.isnan(found).all()


def test_where_lines_are_saturated_columns_are_as_unsure_as_slopes_and_code_differ() -> None:
    """The code may be off by two columns there."""
    apart = LineSet(width_px=5, step_px=5, first_px=2.0, lines=128, frames=128)
    column, _, _, _ = noisy(0.0)
    generator = torch.Generator().manual_seed(5)
    exact = zero_order_profile(
        column - apart.centre_px(torch.arange(apart.lines))[:, None], -2.5, 2.5, RESPONSE
    )
    radiance = exact + 5e-4 * torch.randn(exact.shape, generator=generator)
    std = torch.where(exact > 0.3, torch.inf, 5e-4)
    found = refine(LinePeaks((column + 1.4).round(), radiance, std, apart, RESPONSE))
    off = ((found.column_px - column) / found.std_px).abs()[found.refined]
    assert found.saturated.all()
    assert found.refined.float().mean() > 0.3
    assert (off < 2).float().mean() > 0.95


def test_a_saturated_line_is_as_bright_as_its_flanks_say() -> None:
    column, amplitude, radiance, std = noisy(0.003)
    bright = peaks(column, amplitude) > 0.2 * amplitude
    radiance[bright], std[bright] = 0.0, torch.inf
    found = refine(LinePeaks(column.round(), radiance, std, LINES, RESPONSE))
    unsure = ~found.refined
    assert unsure.float().mean() > 0.1
    # The brightest frame that was measured would have a fifth of it at most.
    share = found.amplitude[unsure] / amplitude[unsure]
    assert float(share.median()) > 0.4
    assert torch.isinf(found.amplitude_std[unsure]).all()


def test_unlit_frames_are_summed_alike_pixel_by_pixel_and_by_tensors() -> None:
    column, amplitude, radiance, std = noisy(0.02)
    # At both ends of the projector, a saturated frame, one that is no number, a pixel without any frame.
    column[:2], column[2:4] = torch.tensor([0.4, -3.0]), torch.tensor([630.2, 700.0])
    std[150:, :3000:7], std[90:210, 5], std[140:230, 6] = torch.inf, torch.inf, torch.nan
    radiance[150:160, ::7] = torch.inf
    std[:, 8], radiance[100:, 9] = torch.inf, torch.nan
    for values in (radiance, std):
        values *= torch.linspace(0.5, 2.0, LINES.lines)[:, None]
    given = column, amplitude, radiance[:, 3:-5].contiguous(), std[:, 3:-5].half()
    part = (column[3:-5], amplitude[3:-5], radiance[:, 3:-5], std.half()[:, 3:-5])
    wanted = by_tensors(part[0], part[1], given[2], given[3], LINES, RESPONSE, (80.3, 160.7))
    for radiance_seen, std_seen in (part[2:], given[2:]):
        found = dark_offset(part[0], part[1], radiance_seen, std_seen, LINES, RESPONSE, (80.3, 160.7))
        for mine, tensors in zip(found, wanted, strict=True):
            assert mine.numpy() == pytest.approx(tensors.numpy(), rel=2e-5, abs=2e-7, nan_ok=True)
    assert torch.isfinite(wanted[1]).float().mean() > 0.9
