"""Smooth, bounded, weighted least squares for many spectra, with the smoothness found in each pixel's data.

The prior is Gaussian: second differences of reflectance have the standard deviation ``tau``, levels a wide
one. For each of a few values of tau the evidence of the data is computed from the same factorisation that
solves the system; a pixel takes the tau under which its data are most probable. Narrow peaks then get a
loose prior and smooth spectra a tight one, from one setting. Bounds follow by an active-set iteration.
"""

from __future__ import annotations

import torch
from torch import Tensor

from dsl_core.reconstruction.spectral.solving.prior import Prior, parabola_peak, roughness, too_faint
from dsl_core.reconstruction.spectral.solving.solution import Spectra, band_mean, data_share, within_band
from dsl_core.solve import banded
from dsl_core.solve.many import Check, never

#: How far outside a bound counts, how stiffly a bound holds, and how often bands change sides.
TOLERANCE, PENALTY, ACTIVE_SET_ROUNDS = 1e-4, 1e4, 5


def solve_tensors(
    data: Tensor, right: Tensor, rows: Tensor | None, prior: Prior, check: Check = never
) -> Spectra:
    """Posterior of every pixel's spectrum, with tensors, as a GPU needs it.

    ``data`` (bandwidth + 1, bands, pixels) and ``right`` (bands, pixels) are the first orders' normal
    equations in reflectance; ``rows`` (bands, n, pixels) are weighted broad-band equations whose values are
    already in ``right``. ``check`` is called where this may stop.
    """
    faint = too_faint(data[0], prior)
    if not bool(faint.any()):
        return _solve(data, right, rows, prior, check)
    found = Spectra.empty(right)
    for where, dtype in ((~faint, data.dtype), (faint, torch.float64)):
        if bool(where.any()):
            some_rows = None if rows is None else rows[..., where].to(dtype)
            some = (data[..., where].to(dtype), right[:, where].to(dtype), some_rows)
            found.put(where, _solve(*some, prior, check))
    return found


def _solve(data: Tensor, right: Tensor, rows: Tensor | None, prior: Prior, check: Check) -> Spectra:
    """Solve in the precision of the equations."""
    if data.shape[0] < 3:
        data = torch.nn.functional.pad(data, (0, 0, 0, 0, 0, 3 - data.shape[0]))
    shape = roughness(data.shape[1], data)
    ridge = torch.zeros_like(shape)
    ridge[0] = prior.level_std**-2
    right = right + prior.level * prior.level_std**-2
    tau = _most_probable_tau(data, right, rows, shape, ridge, prior, check)
    weights = shape[..., None] * tau**-2 + ridge[..., None]
    posterior = Posterior(data, weights, rows)
    mean = posterior.solve(right)
    mean, at_bound = _bounded(data, weights, rows, right, mean, prior.bounds, check)
    std = torch.hypot(posterior.band_mean_variance().clip(min=1e-12).sqrt(), within_band(mean))
    return Spectra(mean, band_mean(mean), std, data_share(data), tau, at_bound)


def _most_probable_tau(
    data: Tensor,
    right: Tensor,
    rows: Tensor | None,
    shape: Tensor,
    ridge: Tensor,
    prior: Prior,
    check: Check,
) -> Tensor:
    """The second-difference deviation with the largest evidence in each pixel, (pixels,).

    The evidence is a smooth function of log tau: a parabola through the best candidate and its neighbours
    gives the place of the maximum between the candidates.
    """
    evidence = []
    for tau in prior.taus:
        check()
        weights = shape * tau**-2 + ridge
        posterior = Posterior(data, weights[..., None], rows)
        volume = banded.factorise(weights[..., None].double()).log_determinant.to(right)
        evidence.append(volume - posterior.log_determinant + posterior.quadratic_form(right))
    return parabola_peak(
        torch.stack(evidence), torch.tensor(prior.taus, dtype=torch.float64).log().to(right)
    ).exp()


def _bounded(
    data: Tensor,
    prior: Tensor,
    rows: Tensor | None,
    right: Tensor,
    mean: Tensor,
    bounds: tuple[float, float],
    check: Check,
) -> tuple[Tensor, Tensor]:
    """Minimum inside the bounds by an active-set iteration where it is needed, and the active bands."""
    low, high = bounds
    x, pinned = mean.clone(), torch.zeros_like(mean, dtype=torch.bool)
    slope = torch.zeros_like(mean)
    todo = torch.nonzero(((mean < low - TOLERANCE) | (mean > high + TOLERANCE)).any(0)).ravel()
    for _ in range(ACTIVE_SET_ROUNDS):
        check()
        here, held = x[:, todo], pinned[:, todo]
        at = torch.where(here < 0.5 * (low + high), low, high)
        release = held & torch.where(at == low, slope[:, todo] < 0, slope[:, todo] > 0)
        wanted = (held & ~release) | (here < low - TOLERANCE) | (here > high + TOLERANCE)
        # Pixels whose bands stay on their sides are done.
        moved = (wanted != held).any(0)
        if not bool(moved.any()):
            break
        todo, at, wanted = todo[moved], at[:, moved], wanted[:, moved]
        sub_rows = None if rows is None else rows[..., todo]
        b, part, weights = right[:, todo], data[..., todo], prior[..., todo]
        matrix = _sum(part, weights)
        stiffness = torch.where(wanted, PENALTY * matrix[0], 0.0)
        weights[0] += stiffness
        solved = Posterior(part, weights, sub_rows).solve(b + stiffness * at)
        slope[:, todo] = gradient(matrix, sub_rows, solved, b)
        x[:, todo], pinned[:, todo] = solved, wanted
    return x.clip(low, high), pinned


def gradient(matrix: Tensor, rows: Tensor | None, x: Tensor, right: Tensor) -> Tensor:
    """Gradient of the quadratic with a banded matrix and broad-band rows at x, (bands, pixels)."""
    g = banded.multiply(matrix, x) - right
    if rows is not None:
        g += (rows * (rows * x[:, None]).sum(0)).sum(1)
    return g


class Posterior:
    """One factorisation of data and prior: banded, plus a few broad-band rows by Woodbury's identity.

    With ``A = L D L'`` banded and rows ``R``, all that the rows need is ``Y = L^-1 R`` and the few-by-few
    matrix ``S = I + Y' D^-1 Y``, which is banded too, with the full bandwidth.
    """

    def __init__(self, data: Tensor, prior: Tensor, rows: Tensor | None) -> None:
        """Factorise: ``data`` (bandwidth + 1, bands, pixels) and ``prior`` (3, bands, 1 or pixels).

        ``rows`` (bands, n, pixels) are weighted broad-band equations.
        """
        self.factor = banded.factorise(_sum(data, prior), overwrite=True)
        self._rows: Tensor | None = None
        if rows is not None:
            self._rows = banded.solve_lower(self.factor, rows)
            self._scaled = self._rows / self.factor.diagonal[:, None]
            self._small = banded.factorise(self._gram(), overwrite=True)

    def _gram(self) -> Tensor:
        """``S`` in banded storage, (rows, rows, pixels)."""
        assert self._rows is not None
        count = self._rows.shape[1]
        gram = torch.zeros((count, count, self._rows.shape[2])).to(self._rows)
        gram[0] += 1
        for offset in range(count):
            gram[offset, : count - offset] += (
                self._rows[:, : count - offset] * self._scaled[:, offset:]
            ).sum(0)
        return gram

    @property
    def log_determinant(self) -> Tensor:
        """Logarithm of the determinant, (pixels,)."""
        value = self.factor.log_determinant
        return value if self._rows is None else value + self._small.log_determinant

    def solve(self, right: Tensor) -> Tensor:
        """Solution for a right side (bands, pixels)."""
        z = banded.solve_lower(self.factor, right)
        if self._rows is not None:
            inner = banded.solve(self._small, self._seen(z))
            for a in range(len(inner)):
                z.addcmul_(self._rows[:, a], inner[a], value=-1)
        return banded.solve_upper(self.factor, z)

    def _seen(self, z: Tensor) -> Tensor:
        """What the rows see of a half-solved right side: ``Y' D^-1 z``, (rows, pixels)."""
        return (self._scaled * z[:, None]).sum(0)

    def quadratic_form(self, right: Tensor) -> Tensor:
        """``right' (posterior covariance) right``, (pixels,), at half the cost of a solution."""
        z = banded.solve_lower(self.factor, right)
        value = (z * z / self.factor.diagonal).sum(0)
        if self._rows is not None:
            inner = banded.solve_lower(self._small, self._seen(z))
            value = value - (inner * inner / self._small.diagonal).sum(0)
        return value

    def band_mean_variance(self) -> Tensor:
        """Variance of the band means, (bands, pixels); the outermost repeat their neighbours."""
        diagonal, first, second = banded.inverse_band(self.factor)[:3]
        inner = (
            diagonal[:-2]
            + 16 * diagonal[1:-1]
            + diagonal[2:]
            + 8 * (first[:-2] + first[1:-1])
            + 2 * second[:-2]
        ) / 36
        if self._rows is not None:
            spread = banded.solve_upper(self.factor, self._rows)
            means = ((spread[:-2] + 4 * spread[1:-1] + spread[2:]) / 6).transpose(0, 1).contiguous()
            half = banded.solve_lower(self._small, means)
            inner = inner - (half * half / self._small.diagonal[:, None]).sum(0)
        return torch.cat([inner[:1], inner, inner[-1:]])


def _sum(data: Tensor, prior: Tensor) -> Tensor:
    """Banded matrix of data and prior together."""
    matrix = data.clone()
    matrix[:3] += prior
    return matrix
