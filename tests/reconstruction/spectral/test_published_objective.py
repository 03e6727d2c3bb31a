"""The published objective on intensities that it models exactly."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.pixel_model import PixelModel
from dsl_core.reconstruction.spectral.published_objective import (
    AdamOptions,
    LineData,
    PublishedReconstruction,
    fit,
    objective,
)
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectra import model_of_plan
from dsl_core.simulation.published_rig import published_rig

SHADING, GREY = 1.7, 0.4
#: Pixels of the middle row, from left to right, of a picture of 112 x 72.
FLAT = 36 * 112 + np.arange(6, 112, 10)


def measured(truth: torch.Tensor, kappa: float) -> LineData:
    """Exact data of spectra (bands, pixels) for three broad channels."""
    bands = torch.linspace(0, 1, len(truth))
    white = torch.stack([torch.exp(-0.5 * ((bands - c) / 0.3) ** 2) for c in (0.2, 0.5, 0.8)])
    zero_white = white / len(truth)
    return LineData(
        white[:, :, None] * truth,
        white[:, :, None].expand(3, *truth.shape),
        zero_white @ truth,
        zero_white,
        torch.ones_like(truth, dtype=torch.bool),
        torch.full_like(truth[0], kappa),
    )


def smooth_spectra() -> torch.Tensor:
    x = torch.linspace(0, 1, 24)[:, None]
    return 0.45 + 0.3 * torch.sin(4 * x + torch.arange(3))


@pytest.mark.slow
def test_fit_finds_spectra_from_first_orders() -> None:
    truth = smooth_spectra()
    found = fit(measured(truth, 1.0), AdamOptions(steps=400, smoothness=0.0))
    assert (found - truth).abs().max() < 0.02


def test_zero_order_alone_fixes_colour_but_not_the_spectrum() -> None:
    truth = smooth_spectra()
    data = measured(truth, 0.0)
    found = fit(data, AdamOptions(steps=400, smoothness=1e-3))
    assert (data.zero_white @ found - data.zero).abs().max() < 0.01
    assert (found - truth).abs().max() > 0.05


def test_unreached_bands_have_no_say() -> None:
    data = measured(smooth_spectra(), 1.0)
    data.reached[5:9] = False
    spectra = smooth_spectra()
    changed = spectra.clone()
    changed[5:9] = 0.9
    assert torch.equal(objective(spectra, data, 0.0), objective(changed, data, 0.0))
    assert objective(changed, data, 1.0) > objective(spectra, data, 1.0)


def test_gradient_of_the_objective_agrees_with_differences() -> None:
    data = measured(smooth_spectra(), 0.7)
    spectra = torch.full((24, 3), 0.31, dtype=torch.float64, requires_grad=True)
    double = LineData(*(part.double() if part.is_floating_point() else part for part in vars(data).values()))
    assert torch.autograd.gradcheck(lambda x: objective(x, double, 0.3), spectra, eps=1e-7, atol=1e-5)


def a_plane(options: AdamOptions | None = None) -> tuple[PublishedReconstruction, PixelModel]:
    """The reconstruction of a plane whose pixels are all known, and the forward model of its frames."""
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(112, 72)})
    plan, grid, model = CapturePlan(), WavelengthGrid(step_nm=10.0), correspondence(rig)
    depth, shading = (np.full((72, 112), value, np.float32) for value in (700.0, SHADING))
    none, frames = np.zeros_like(depth), np.zeros((plan.spectral_count, 72, 112), np.float32)
    known = Pixels(none, depth, shading, none, none, none, none, none, none, depth > 0)
    solver = PublishedReconstruction(
        rig, plan, grid, model, frames, np.ones_like(frames), known, options=options
    )
    return solver, model_of_plan(rig, plan, grid, model)


def test_steps_are_those_asked_for_and_else_the_usual_ones() -> None:
    assert a_plane()[0].options == AdamOptions()
    assert a_plane(AdamOptions(steps=7))[0].options.steps == 7


def test_pixels_are_compared_through_the_order_that_reaches_more_of_their_bands() -> None:
    solver, _ = a_plane()
    order, reached, columns = solver._valid_order(FLAT)
    assert order[0] == 1
    assert order[-1] == -1
    assert (order.diff() <= 0).all(), "each side of the picture has its order"
    for m in (1, -1):
        own = solver.model.trace(
            torch.as_tensor(FLAT), torch.full((len(FLAT),), 700.0), m, solver.grid.centres_nm
        )
        many = own.inside(*solver.plan.projector_size_px)
        assert (reached.sum(0) >= many.sum(0)).all()
        assert torch.equal(columns[:, order == m], own.columns[:, order == m])


def test_a_grey_pixel_is_its_reflectance_in_units_of_white_however_bright_it_is_lit() -> None:
    solver, model = a_plane()
    order, reached, columns = solver._valid_order(FLAT)
    pixels, depth = torch.as_tensor(FLAT), torch.full((len(FLAT),), 700.0, dtype=torch.float64)
    traced = model.trace(pixels, depth)
    grey = torch.full((model.bands.count, len(FLAT)), GREY, dtype=torch.float64)
    shading = torch.full((len(FLAT),), SHADING, dtype=torch.float64)
    first = torch.empty((3, *columns.shape))
    frame = solver.lines.nearest(columns).clip(0, solver.lines.lines - 1)
    for m in (1, -1):
        seen = model.operator(traced, shading, orders=(m,)).forward(grey)
        own = order == m
        first[..., own] = seen[:, frame, torch.arange(len(FLAT))][..., own].float()
    moments = torch.as_tensor(model.bands.moments[0].sum((1, 2)), dtype=torch.float32)
    zero = SHADING * GREY * moments[:, None].expand(-1, len(FLAT))
    data = solver._measured(FLAT, order, columns, reached, torch.ones(len(FLAT)), first, zero)
    assert data.zero_white.sum(1).max() == pytest.approx(1.0)
    assert data.zero == pytest.approx(GREY * data.zero_white.sum(1)[:, None].expand(-1, len(FLAT)), rel=0.02)
    assert data.first_white.max() == pytest.approx(1.0)
    bright = data.reached & (data.first_white > 0.2)
    assert bright.sum() > 100
    found = (data.first / data.first_white)[bright]
    assert float(found.median()) == pytest.approx(GREY, rel=0.03)
    # Of bands at the edge of what the LEDs emit, the mean dispersion of many pixels says little.
    assert found == pytest.approx(GREY, rel=0.3)


def test_the_objective_is_the_published_sum_written_out() -> None:
    draw = torch.Generator().manual_seed(2)

    def some(*shape: int) -> torch.Tensor:
        return torch.rand(shape, generator=draw, dtype=torch.float64)

    bands, pixels = 4, 3
    measured = LineData(
        first=some(3, bands, pixels),
        first_white=some(3, bands, pixels),
        zero=some(3, pixels),
        zero_white=some(3, bands),
        reached=(some(bands, pixels) > 0.4).double(),
        kappa=some(pixels),
    )
    spectra, total = some(bands, pixels), 0.0
    for p in range(pixels):
        first = zero = rough = 0.0
        for c in range(3):
            for j in range(bands):
                away = measured.first_white[c, j, p] * spectra[j, p] - measured.first[c, j, p]
                first += float(abs(away) * measured.reached[j, p]) / bands
            zero += float(abs(measured.zero_white[c] @ spectra[:, p] - measured.zero[c, p]))
        for j in range(bands - 1):
            rough += float((spectra[j + 1, p] - spectra[j, p]) ** 2) / bands
        kappa = float(measured.kappa[p])
        total += kappa * first + (1 - kappa) * zero + 0.7 * rough
    assert float(objective(spectra, measured, 0.7)) == pytest.approx(total)
