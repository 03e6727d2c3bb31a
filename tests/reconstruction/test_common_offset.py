"""An offset that all frames of a pixel share is one more unknown, whichever way it is eliminated."""

from __future__ import annotations

import pytest
import torch

from dsl_core.reconstruction.spectral.solver import Prior, Spectra
from dsl_core.reconstruction.spectral.spectra import with_offset
from dsl_core.reconstruction.spectral.system import without_offset

FRAMES, BANDS = 12, 4


def numbers() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Operator (frames, bands), data (frames, 1) and weight (frames, 1)."""
    random = torch.Generator().manual_seed(3)
    operator, data, weight = (
        torch.rand((FRAMES, n), generator=random, dtype=torch.float64) for n in (BANDS, 1, 1)
    )
    weight[4] = 0
    return operator, data, weight


@pytest.mark.parametrize("variance", [0.0, 0.3, 1e6])
def test_equations_without_the_offset_are_those_of_correlated_noise(variance: float) -> None:
    operator, data, weight = numbers()
    used = weight[:, 0] > 0
    covariance = torch.diag(1 / weight[used, 0]) + variance
    exact = operator[used].T @ torch.linalg.solve(covariance, torch.cat([operator, data], 1)[used])
    model, y = (without_offset(v, weight, torch.tensor(variance)) for v in (operator, data))
    assert torch.allclose((weight * model).T @ torch.cat([model, y], 1), exact, rtol=1e-6, atol=1e-9)


def test_an_offset_that_looks_like_a_grey_makes_spectra_as_unsure() -> None:
    prior = Prior()
    matrix = torch.full((1, BANDS, 1), 1e8)
    like_grey = (matrix[0] + prior.level_std**-2).expand(3, -1, -1)
    spectra = Spectra.empty(torch.zeros((BANDS, 1)))
    spectra.std[:] = 0.004
    variance = torch.tensor([[0.003**2], [0.0], [0.0]])
    assert with_offset(spectra, matrix, like_grey, variance, prior).std.numpy() == pytest.approx(0.005)
