"""Columns from any pattern set: combs in three colours and random levels, with honest deviations."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, Columns, GrayCode, LineComb, ScanLines, Setting, SpectralSet
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence, triangulate, zero_order
from dsl_core.optics.image_formation import BlurredProfiles, one_if_grey
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.optics.spectra import Bands
from dsl_core.patterns.images import pattern_image
from dsl_core.planning.noise import own_channel
from dsl_core.planning.samples import plane_samples
from dsl_core.planning.virtual import VirtualPixels
from dsl_core.reconstruction.columns import pattern_column
from dsl_core.reconstruction.columns.column import MAX_CHI_SQUARE, Column
from dsl_core.reconstruction.columns.pattern_column import (
    first_order_share,
    radiance_profiles,
    refine_by_profiles,
    rounding_error,
)
from dsl_core.simulation.published_rig import published_rig
from tests.cases.small_rig import small_rig

WHITE = 300.0
NOISE = 1.0


def random_columns() -> Columns:
    rng = np.random.default_rng(4)
    levels = (rng.random((24, 640, 1)) < 0.2) * np.ones(3)
    return Columns(levels=tuple(tuple(tuple(rgb) for rgb in frame) for frame in levels.tolist()))


def refined(
    spectral: SpectralSet, rig: Rig, shares: tuple[float, float, float]
) -> tuple[Column, torch.Tensor]:
    """Fit pixels whose LEDs give ``shares`` of white, from a decoded column half a pixel off at most."""
    plan = CapturePlan(code=GrayCode(rows=False), spectral=spectral)
    profiles = radiance_profiles(rig, plan)
    draw = torch.Generator().manual_seed(3)
    true = 100 + 400 * torch.rand(200, generator=draw)
    light = BlurredProfiles(rig.projector_response, profiles, 0.0, true).at(true)
    y = WHITE * torch.einsum("plf,l->fp", light, torch.tensor(shares))
    y = y + NOISE * torch.randn(y.shape, generator=draw)
    return refine_by_profiles(
        true.round(), y, torch.full_like(y, NOISE), profiles, rig.projector_response
    ), true


@pytest.mark.parametrize(
    "spectral",
    [LineComb(width_px=5, step_px=3, period_px=96, shifts_px=(0, 32, 64)), random_columns()],
    ids=["comb in three colours", "random"],
)
def test_columns_are_found_far_better_than_decoded(spectral: SpectralSet) -> None:
    column, true = refined(spectral, small_rig(), (0.5, 0.3, 0.2))
    assert column.refined.float().mean() > 0.9
    error = (column.column_px - true)[column.refined]
    assert float(error.square().mean().sqrt()) < 0.06
    assert float((error / column.std_px[column.refined]).abs().median()) < 1.5


def test_columns_between_candidates_are_found_as_sure_as_stated() -> None:
    """Light of exactly the model, and noise that is far above its allowance, not below it."""
    rig = small_rig()
    profiles = radiance_profiles(rig, CapturePlan(code=GrayCode(rows=False), spectral=random_columns()))
    draw = torch.Generator().manual_seed(5)
    true = 100 + 400 * torch.rand(400, generator=draw, dtype=torch.float64)
    light = WHITE / 3 * BlurredProfiles(rig.projector_response, profiles, 0.0, true).at(true).sum(1).T
    found = [
        refine_by_profiles(
            true.round(),
            light + noise * torch.randn(light.shape, generator=draw, dtype=torch.float64),
            torch.full_like(light, max(noise, 1.0)),
            profiles,
            rig.projector_response,
        )
        for noise in (0.0, 40.0)
    ]
    exact, noisy = ((column.column_px - true)[column.refined] for column in found)
    assert len(exact) > 350
    assert float(exact.abs().quantile(0.9)) < 0.01
    stated = found[1].std_px[found[1].refined]
    assert 0.7 < float((noisy / stated).square().median().sqrt() / 0.6745) < 1.4


def test_amplitude_is_that_of_white() -> None:
    column, _ = refined(random_columns(), small_rig(), (0.5, 0.3, 0.2))
    assert float(column.amplitude[column.refined].median()) == pytest.approx(WHITE, rel=0.02)


def test_saturated_frames_take_no_part() -> None:
    rig = small_rig()
    plan = CapturePlan(code=GrayCode(rows=False), spectral=random_columns())
    profiles = radiance_profiles(rig, plan)
    true = torch.tensor([200.3, 300.2])
    light = BlurredProfiles(rig.projector_response, profiles, 0.0, true).at(true)
    y = WHITE * light.sum(1).T / 3
    std = torch.full_like(y, NOISE)
    y[:4], std[:4] = 5 * WHITE, torch.inf
    column = refine_by_profiles(true.round(), y, std, profiles, rig.projector_response)
    assert torch.allclose(column.column_px, true, atol=0.06)


def test_a_comb_in_three_colours_is_no_set_of_white_lines() -> None:
    comb = LineComb(width_px=5, step_px=3, period_px=96, shifts_px=(0, 32, 64))
    assert LineSet.of(CapturePlan(spectral=comb)) is None
    assert LineSet.of(CapturePlan(spectral=comb.model_copy(update={"shifts_px": (0, 0, 0)}))) is not None


def test_first_orders_of_a_coloured_surface_move_columns_less_when_they_are_modelled() -> None:
    """Lines in an order of their own put other first orders under their two edges."""
    rig, random = published_rig(), random_columns()
    plan = CapturePlan(code=GrayCode(rows=False), spectral=random)
    pixels = VirtualPixels(rig, plan, WavelengthGrid(step_nm=10), plane_samples(rig, grid=(12, 4)))
    ramp = np.tile(np.linspace(0.2, 0.6, pixels.bands.count), (len(pixels.pixels), 1, 1))
    first, zero = pixels.signals(torch.as_tensor(ramp, dtype=torch.float32))
    own = torch.as_tensor(own_channel(rig, pixels.view.pixels))
    y = (first + zero)[torch.arange(len(own)), 0, own].T.contiguous()
    profiles = one_if_grey(radiance_profiles(rig, plan))
    start = pixels.column.float().round()
    share = first_order_share(rig, profiles, pixels.pixels, start)
    errors = []
    for light in (None, share):
        column = refine_by_profiles(
            start, y, torch.full_like(y, 1e-3), profiles, rig.projector_response, light
        )
        errors.append(float((column.column_px - pixels.column).abs().median()))
    assert errors[1] < 0.5 * errors[0]


def test_an_led_that_is_dark_spoils_no_frame() -> None:
    """Beside a comb of the red LED, what the green and blue zero order may get wrong stays out of it."""
    rig = published_rig()
    bands = Bands.of(rig, WavelengthGrid(step_nm=10))
    plan = CapturePlan(
        spectral=LineComb(width_px=6, step_px=4, period_px=96, shifts_px=(0, 32, 64)), code=GrayCode()
    )
    model = PixelModel(rig, bands, radiance_profiles(rig, plan), correspondence(rig))
    white = torch.as_tensor(bands.moments[0].sum((1, 2)), dtype=torch.float32)[:, None]
    found = model.direct_light(model.zero_light(white), torch.tensor([2.5]), white)
    red, blue = found[0, :, 0] / white[0], found[2, :, 0] / white[2]
    assert float(red[0]) > 0.5
    assert float(blue[0]) < 0.1


GREYS = (0.1, 0.25, 0.5, 0.75, 1.0)


def grey_plan(*levels: float) -> CapturePlan:
    """One frame of grey steps across a projector of a few columns, at drive levels of equal exposure."""
    return CapturePlan(
        projector_size_px=(len(GREYS), 4),
        spectral=Columns(levels=(tuple((grey, grey, grey) for grey in GREYS),)),
        settings=tuple(Setting(exposure_ms=100.0, level=level) for level in levels),
        code_settings=(0,),
    )


@pytest.mark.parametrize("level", [0.2, 0.8])
def test_grey_is_as_bright_as_the_drive_level_that_a_setting_rounds_it_to(level: float) -> None:
    rig = published_rig()
    radiance, plan = rig.projector_response.radiance, grey_plan(level)
    drive = pattern_image(plan, next(shot for shot in plan.shots() if shot.role == "spectral"))[0, :, 0]
    shown = (radiance(drive / 255) - radiance(0.0)) / (radiance(level) - radiance(0.0))
    assert radiance_profiles(rig, plan)[0, :, 0] == pytest.approx(shown)
    assert rounding_error(rig, plan) < 1e-9


def test_settings_that_round_grey_apart_are_granted_the_difference() -> None:
    rig, plan = published_rig(), grey_plan(0.1, 0.8)
    dark, bright, both = (radiance_profiles(rig, p)[0, :, 0] for p in (grey_plan(0.1), grey_plan(0.8), plan))
    assert (both <= np.maximum(dark, bright) + 1e-12).all()
    assert (both >= np.minimum(dark, bright) - 1e-12).all()
    used = both > 0.05
    assert rounding_error(rig, plan) == pytest.approx(np.abs(dark / both - 1)[used].max())
    assert rounding_error(rig, plan) > 0.03


def test_lines_and_combs_leave_nothing_to_round() -> None:
    for spectral in (ScanLines(), LineComb()):
        plan = CapturePlan(spectral=spectral)
        assert np.isin(radiance_profiles(published_rig(), plan).round(12), (0.0, 1.0)).all()
        assert rounding_error(published_rig(), plan) < 1e-9


def from_costs(
    monkeypatch: pytest.MonkeyPatch,
    costs: list[tuple[float, float, float]],
    frames: int = 14,
    amplitude: float = 5.0,
) -> Column:
    """Columns from 100 on whose squares are a parabola in the shift: its least, its place, its strength."""
    least, place, strength = torch.tensor(costs, dtype=torch.float64).T
    shifts = iter(torch.linspace(-1, 1, 17, dtype=torch.float64))

    def fit(light: torch.Tensor, y: torch.Tensor, weight: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        shift = next(shifts)
        return least + strength * (shift - place) ** 2, amplitude + 0 * place + shift

    monkeypatch.setattr(pattern_column, "_fit", fit)
    start = torch.full((len(costs),), 100.0, dtype=torch.float64)
    y = torch.ones((frames, len(costs)), dtype=torch.float64)
    profiles = np.ones((frames, 640, 1))
    return refine_by_profiles(start, y, y, profiles, published_rig().projector_response)


def test_a_column_is_at_the_bottom_of_a_parabola(monkeypatch: pytest.MonkeyPatch) -> None:
    # Fourteen frames less one amplitude and a column leave twelve degrees of freedom.
    found = from_costs(monkeypatch, [(6.0, 0.3, 400.0), (24.0, -0.71, 100.0), (12.0, 0.0, 50.0)])
    assert found.refined.all()
    assert found.column_px.tolist() == pytest.approx([100.3, 99.29, 100.0])
    assert found.std_px.tolist() == pytest.approx([0.05, np.sqrt(0.01 * 24.16 / 12), np.sqrt(0.02)])
    assert found.amplitude.tolist() == pytest.approx([5.25, 4.25, 5.0]), "that of the nearest candidate"
    assert found.amplitude_std.tolist() == pytest.approx([0.105, 0.085, 0.1])


def test_a_fit_that_says_little_or_is_bad_leaves_the_decoded_column(monkeypatch: pytest.MonkeyPatch) -> None:
    bad = 12 * MAX_CHI_SQUARE
    cases = {
        (0.99 * bad, 0.25, 1e4): True, (1.01 * bad, 0.25, 1e4): False, (1.0, 0.3, 12.1): True,
        (1.0, 0.3, 11.9): False, (1.0, 0.93, 1e3): True, (1.0, 0.95, 1e3): False, (1.0, -0.95, 1e3): False,
    }  # fmt: skip
    found = from_costs(monkeypatch, list(cases))
    assert found.refined.tolist() == list(cases.values())
    left = ~found.refined
    assert (found.column_px[left] == 100.0).all()
    assert found.std_px[left].tolist() == pytest.approx([12**-0.5] * 4)
    assert torch.isinf(found.amplitude_std[left]).all()
    assert not from_costs(monkeypatch, [(1.0, 0.3, 1e3)], amplitude=-3.0).refined.any()
    assert from_costs(monkeypatch, [(1.0, 0.3, 1e3)], frames=4).refined.all()
    assert not from_costs(monkeypatch, [(1.0, 0.3, 1e3)], frames=3).refined.any()


def test_amplitudes_are_weighted_least_squares_that_a_ridge_keeps_apart() -> None:
    draw = torch.Generator().manual_seed(1)
    light = torch.rand((4, 3, 9), generator=draw, dtype=torch.float64)
    y = torch.rand((4, 9), generator=draw, dtype=torch.float64)
    weight = torch.rand((4, 9), generator=draw, dtype=torch.float64)
    left, total = pattern_column._fit(light, y, weight)
    for p in range(4):
        design = light[p].T.numpy()
        normal = design.T @ (design * weight[p].numpy()[:, None])
        normal += 1e-4 * np.diag(normal).max() * np.eye(3)
        own = np.linalg.solve(normal, design.T @ (weight[p] * y[p]).numpy())
        assert float(total[p]) == pytest.approx(own.sum())
        assert float(left[p]) == pytest.approx(float(weight[p].numpy() @ (y[p].numpy() - design @ own) ** 2))


def test_a_column_that_meets_no_ray_has_no_first_orders_and_harms_no_other() -> None:
    rig = small_rig()
    profiles = radiance_profiles(rig, CapturePlan(code=GrayCode(rows=False), spectral=random_columns()))
    pixels = torch.tensor([40 * 222 + 100, 41 * 222 + 101])
    column = float(zero_order(rig, pixels[:1], torch.tensor([700.0], dtype=torch.float64))[0])
    columns = torch.tensor([column, column - 5000.0])
    depth, _ = triangulate(rig, pixels, columns.double())
    assert torch.isfinite(depth).tolist() == [True, False]
    found = first_order_share(rig, profiles, pixels, columns)
    assert float(found[0].abs().max()) > 0
    assert not found[1].any()
    alone = first_order_share(rig, profiles, pixels[:1], columns[:1])
    assert found[:1].numpy() == pytest.approx(alone.numpy(), rel=1e-5)
