"""The published objective on intensities that it models exactly."""

from __future__ import annotations

import torch

from dsl_core.reconstruction.spectral.published_objective import AdamOptions, LineData, fit, objective


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
