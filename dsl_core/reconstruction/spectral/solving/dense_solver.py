"""The smooth, bounded solver for patterns that couple distant bands: full matrices, same prior."""

from __future__ import annotations

import torch
from torch import Tensor

from dsl_core.reconstruction.spectral.solving.prior import Prior, parabola_peak, roughness, too_faint
from dsl_core.reconstruction.spectral.solving.solution import Spectra, band_mean, share_of, within_band
from dsl_core.reconstruction.spectral.solving.solver import ACTIVE_SET_ROUNDS, PENALTY, TOLERANCE
from dsl_core.solve import banded


def solve_dense(data: Tensor, right: Tensor, prior: Prior) -> Spectra:
    """Posterior of every pixel's spectrum from full normal equations.

    ``data`` is (pixels, bands, bands), ``right`` (pixels, bands).
    """
    try:
        found = _solve(data, right, prior)
    except torch.linalg.LinAlgError:  # type: ignore[attr-defined]
        data = data.double()
        ridge = torch.eye(data.shape[1]).to(data) * prior.level_std**-2
        broken = torch.linalg.cholesky_ex(data + ridge).info > 0
        data[broken] = semidefinite(data[broken])
        found = _solve(data, right.double(), prior).to(right.dtype)
    faint = too_faint(torch.diagonal(data, dim1=1, dim2=2).T, prior)
    if bool(faint.any()):
        found.put(faint, _solve(data[faint].double(), right[faint].double(), prior))
    return found


def semidefinite(data: Tensor) -> Tensor:
    """Equations (pixels, bands, bands) in double precision, without what rounding left below zero.

    Bright data that leave a combination of bands open have there the rounding of the others as information,
    which may be negative and more than the prior's. It is zero; anything else would claim knowledge.
    """
    values, vectors = torch.linalg.eigh(data.double())
    clipped: Tensor = (vectors * values.clip(min=0)[:, None]) @ vectors.mT
    return clipped


def _solve(data: Tensor, right: Tensor, prior: Prior) -> Spectra:
    """Solve in the precision of the equations."""
    bands = right.shape[1]
    shape = banded.to_dense(roughness(bands, data)[..., None])[0]
    ridge = torch.eye(bands).to(data) * prior.level_std**-2
    right = right + prior.level * prior.level_std**-2
    evidence = []
    for candidate in prior.taus:
        weights = shape * candidate**-2 + ridge
        factor = torch.linalg.cholesky(data + weights)
        half = torch.linalg.solve_triangular(factor, right[..., None], upper=False)[..., 0]
        volume = torch.logdet(weights.double()).to(right)
        evidence.append(volume - 2 * _log_diagonal(factor) + (half * half).sum(1))
    tau = parabola_peak(
        torch.stack(evidence), torch.tensor(prior.taus, dtype=torch.float64).log().to(right)
    ).exp()
    matrix = data + shape * tau[:, None, None] ** -2 + ridge
    factor = torch.linalg.cholesky(matrix)
    mean = torch.cholesky_solve(right[..., None], factor)[..., 0]
    variance = _band_mean_variance(torch.cholesky_inverse(factor))
    nodes, active = _bounded(matrix, right, mean, prior.bounds)
    nodes = nodes.T
    std = torch.hypot(variance.clip(min=1e-12).sqrt().T, within_band(nodes))
    return Spectra(nodes, band_mean(nodes), std, _share(data).T, tau, active.T)


def _band_mean_variance(inverse: Tensor) -> Tensor:
    """Variance of the band means, (pixels, bands), the ends repeated as in the banded solver.

    Weights of 1/6, 2/3 and 1/6 need the inverse's main diagonal and the two next to it.
    """
    main, beside, next_but_one = (torch.diagonal(inverse, o, 1, 2) for o in range(3))
    inner = main[:, :-2] + 16 * main[:, 1:-1] + main[:, 2:]
    inner = (inner + 8 * (beside[:, :-1] + beside[:, 1:]) + 2 * next_but_one) / 36
    return torch.cat([inner[:, :1], inner, inner[:, -1:]], 1)


def _log_diagonal(factor: Tensor) -> Tensor:
    return torch.log(torch.diagonal(factor, dim1=1, dim2=2)).sum(1)


def _share(data: Tensor) -> Tensor:
    """As `solution.data_share`, from full matrices, (pixels, bands)."""
    near = torch.ones_like(data[0]).triu(-2).tril(2)
    return share_of((data * near).sum(2))


def _bounded(
    matrix: Tensor, right: Tensor, mean: Tensor, bounds: tuple[float, float]
) -> tuple[Tensor, Tensor]:
    """Minimum inside the bounds by an active-set iteration where it is needed, and the active bands."""
    low, high = bounds
    active = torch.zeros_like(mean, dtype=torch.bool)
    outside = (mean < low - TOLERANCE) | (mean > high + TOLERANCE)
    todo = torch.nonzero(outside.any(1)).ravel()
    x, b, sub = mean[todo], right[todo], matrix[todo]
    pinned = torch.zeros_like(x, dtype=torch.bool)
    scale = torch.diagonal(sub, dim1=1, dim2=2)
    for _ in range(ACTIVE_SET_ROUNDS):
        at = torch.where(x < 0.5 * (low + high), low, high)
        slope = (sub @ x[..., None])[..., 0] - b
        release = pinned & torch.where(at == low, slope < 0, slope > 0)
        changed = (pinned & ~release) | (x < low - TOLERANCE) | (x > high + TOLERANCE)
        if bool((changed == pinned).all()):
            break
        pinned = changed
        stiff = torch.where(pinned, PENALTY * scale, 0.0)
        factor = torch.linalg.cholesky(sub + torch.diag_embed(stiff))
        x = torch.cholesky_solve((b + stiff * torch.where(pinned, at, 0.0))[..., None], factor)[..., 0]
    out = mean.clone()
    out[todo], active[todo] = x, pinned
    return out.clip(low, high), active
