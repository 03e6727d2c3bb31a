"""The smooth bounded solvers against dense algebra, a reference for bounds, and each other."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from torch import Tensor

from dsl_core.reconstruction.spectral.solving.dense_solver import solve_dense
from dsl_core.reconstruction.spectral.solving.lane_solver import solve_spectra
from dsl_core.reconstruction.spectral.solving.prior import Prior, parabola_peak, roughness, too_faint
from dsl_core.reconstruction.spectral.solving.solution import band_mean, within_band
from dsl_core.reconstruction.spectral.solving.solver import Posterior, gradient
from dsl_core.solve import banded

BANDS, PIXELS, HALF = 30, 5, 3
ONE_TAU = (0.05, 0.05001, 0.05002)


def observations(
    truth: NDArray[np.float64], noise: float, seed: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted rows (pixels, rows, BANDS), each seeing a few neighbouring bands; values (pixels, rows)."""
    rng = np.random.default_rng(seed)
    bands = np.arange(BANDS)
    centres = np.linspace(-1, BANDS, 4 * BANDS)
    profile = np.clip(1 - np.abs(centres[:, None] - bands) / 2, 0, None)
    rows = profile[None] * rng.uniform(0.8, 1.2, (PIXELS, centres.size, 1)) / noise
    values = np.einsum("prj,pj->pr", rows, truth) + rng.standard_normal((PIXELS, centres.size))
    return rows, values


def banded_equations(rows: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[Tensor, Tensor]:
    """Normal equations in banded storage and right side (BANDS, PIXELS), float64."""
    full = np.einsum("prj,prk->pjk", rows, rows)
    data = np.zeros((HALF + 1, BANDS, PIXELS))
    for o in range(HALF + 1):
        data[o, : BANDS - o] = np.diagonal(full, o, 1, 2).T
    return torch.as_tensor(data), torch.as_tensor(np.einsum("prj,pr->jp", rows, values))


def prior_rows(tau: float, prior: Prior) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The Gaussian prior as rows and values of a least-squares problem."""
    differences = np.diff(np.eye(BANDS), 2, axis=0) / tau
    level = np.eye(BANDS) / prior.level_std
    return np.vstack([differences, level]), np.append(
        np.zeros(BANDS - 2), np.full(BANDS, prior.level / prior.level_std)
    )


def smooth_truth() -> NDArray[np.float64]:
    x = np.linspace(0, 1, BANDS)
    return np.array([0.4 + 0.3 * np.sin(3 * x + i) for i in range(PIXELS)])


def test_free_solution_is_that_of_dense_least_squares() -> None:
    rows, values = observations(smooth_truth(), 0.02)
    prior = Prior(taus=ONE_TAU, bounds=(-10.0, 10.0))
    found = solve_spectra(*banded_equations(rows, values), None, prior)
    for p in range(PIXELS):
        more, right = prior_rows(float(found.tau[p]), prior)
        system = np.vstack([rows[p], more])
        expected = np.linalg.lstsq(system, np.append(values[p], right), rcond=None)[0]
        assert found.nodes[:, p].numpy() == pytest.approx(expected, abs=1e-8)
        covariance = np.linalg.inv(system.T @ system)
        mean = band_mean(torch.eye(BANDS, dtype=torch.float64)).numpy()
        spread = np.sqrt(np.diag(mean @ covariance @ mean.T))[1:-1]
        # The stated deviation also holds what a band's mean cannot say of its centre; it is never smaller.
        assert (found.std[1:-1, p].numpy() >= spread * (1 - 1e-9)).all()
        assert found.std[1:-1, p].numpy() == pytest.approx(spread, rel=0.3)


def test_bounds_are_those_of_a_reference_solver() -> None:
    x = np.arange(BANDS)
    truth = np.array([np.clip(np.sin(0.5 * x + i) * 1.2, 0, 1.0) for i in range(PIXELS)])
    rows, values = observations(truth, 0.05, seed=3)
    prior = Prior(taus=ONE_TAU, bounds=(0.0, 1.0))
    found = solve_spectra(*banded_equations(rows, values), None, prior)
    touched = 0
    for p in range(PIXELS):
        more, right = prior_rows(float(found.tau[p]), prior)
        exact = lsq_linear(
            np.vstack([rows[p], more]), np.append(values[p], right), bounds=(0, 1), tol=1e-12
        ).x
        assert found.nodes[:, p].numpy() == pytest.approx(exact, abs=2e-3)
        assert found.at_bound[:, p].numpy()[(exact > 0.01) & (exact < 0.99)].sum() == 0
        touched += int(found.at_bound[:, p].sum())
    assert touched > 5
    assert found.nodes.min() >= 0
    assert found.nodes.max() <= 1


def test_evidence_prefers_loose_priors_for_peaks_and_tight_ones_for_smooth_spectra() -> None:
    peak = np.full((PIXELS, BANDS), 0.05)
    peak[:, 14:17] = (0.5, 0.9, 0.5)
    chosen = {}
    for name, truth in (("smooth", np.tile(np.linspace(0.3, 0.6, BANDS), (PIXELS, 1))), ("peak", peak)):
        rows, values = observations(truth, 0.02)
        spectra = solve_spectra(*banded_equations(rows, values), None, Prior())
        chosen[name] = spectra.tau
        assert np.sqrt(np.mean((spectra.nodes.T.numpy() - truth) ** 2)) < 0.03
    assert chosen["smooth"].max() < 0.02
    assert chosen["peak"].min() > 0.08


@pytest.mark.parametrize("diagonals", [1, 2])
def test_diagonals_of_zeros_may_be_left_out(diagonals: int) -> None:
    data, right = banded_equations(*observations(smooth_truth(), 0.1))
    whole = torch.zeros_like(data)
    # What two bands have in common is less than what each has.
    whole[0] = 2 * data[0]
    whole[1:diagonals] = data[1:diagonals]
    found = solve_spectra(whole[:diagonals], right, None, Prior())
    assert (found.mean - solve_spectra(whole, right, None, Prior()).mean).abs().max() < 1e-9


def test_broad_rows_by_the_woodbury_identity_equal_dense_algebra() -> None:
    rows, values = observations(smooth_truth(), 0.1)
    data, right = banded_equations(rows, values)
    generator = torch.Generator().manual_seed(0)
    broad = torch.rand((BANDS, 3, PIXELS), generator=generator, dtype=torch.float64)
    weights = roughness(BANDS, data)[..., None] * 400
    posterior = Posterior(data, weights, broad)
    padded = data.clone()
    padded[:3] += weights
    full = banded.to_dense(padded) + torch.einsum("jap,kap->pjk", broad, broad)
    expected = torch.linalg.solve(full, right.T[..., None])[..., 0].T
    assert (posterior.solve(right) - expected).abs().max() < 1e-9
    assert (posterior.log_determinant - torch.logdet(full)).abs().max() < 1e-9
    assert gradient(padded, broad, expected, right).abs().max() < 1e-7 * float(right.abs().max())
    mean = band_mean(torch.eye(BANDS, dtype=torch.float64))
    variance = torch.einsum("jk,pkl,jl->jp", mean, torch.linalg.inv(full), mean)[1:-1]
    assert (posterior.band_mean_variance()[1:-1] / variance - 1).abs().max() < 1e-9


def test_banded_and_dense_solver_agree() -> None:
    x = np.arange(BANDS)
    truth = np.array([np.clip(0.5 + np.sin(0.4 * x + i), 0, 1.5) for i in range(PIXELS)])
    rows, values = observations(truth, 0.05, seed=5)
    data, right = banded_equations(rows, values)
    prior = Prior(taus=ONE_TAU)
    by_band = solve_spectra(data, right, None, prior)
    dense = solve_dense(banded.to_dense(data), right.T.contiguous(), prior)
    assert (by_band.mean - dense.mean).abs().max() < 2e-3
    assert (by_band.std / dense.std - 1).abs().max() < 0.05
    assert (by_band.data_share - dense.data_share).abs().max() < 1e-9


def test_equations_that_are_not_positive_lose_that_part_and_others_stay() -> None:
    random = torch.Generator().manual_seed(2)
    vectors = torch.linalg.qr(torch.randn((BANDS, BANDS), generator=random, dtype=torch.float64)).Q
    values = torch.linspace(50, 5000, BANDS, dtype=torch.float64)
    sound = (vectors * values) @ vectors.T
    negative, without = values.clone(), values.clone()
    negative[0], without[0] = -1e3, 0.0
    right = torch.full((2, BANDS), 40.0, dtype=torch.float64)
    prior = Prior(taus=ONE_TAU)
    broken = torch.stack([sound, (vectors * negative) @ vectors.T])
    found = solve_dense(broken, right, prior)
    wanted = solve_dense(torch.stack([sound, (vectors * without) @ vectors.T]), right, prior)
    assert (found.mean - wanted.mean).abs().max() < 1e-6
    assert (found.std / wanted.std - 1).abs().max() < 1e-6


def test_band_mean_keeps_straight_lines_and_area() -> None:
    line = torch.linspace(0, 1, 9, dtype=torch.float64)[:, None]
    assert (band_mean(line) - line)[1:-1].abs().max() < 1e-12
    spike = torch.zeros((9, 1), dtype=torch.float64)
    spike[4] = 1
    assert band_mean(spike)[3:6, 0].tolist() == pytest.approx([1 / 6, 2 / 3, 1 / 6])


def test_a_line_under_one_band_makes_it_and_its_neighbours_less_certain() -> None:
    nodes = torch.zeros((11, 2), dtype=torch.float64)
    nodes[5, 0] = 1
    nodes[:, 1] = torch.linspace(0, 1, 11, dtype=torch.float64)
    spread = within_band(nodes)
    # The shares of 1, 4, 6, 4, 1 that a spike's fourth difference has, not those of its second.
    assert (36 * spread[3:8, 0]).tolist() == pytest.approx([1, 4, 6, 4, 1])
    assert spread[:, 1].max() < 1e-12


def test_what_bright_data_leave_open_stays_open_in_single_precision() -> None:
    # Sums of four neighbours at a time leave three of four bands to the prior; in single precision the
    # rounding of these equations is more than the prior, and negative for some.
    sums = torch.kron(torch.eye(3), torch.ones(1, 4)) * torch.tensor([[3e4], [7e4], [2e4]])
    mixed = torch.tensor([[1.0, 0.3, -0.7], [0.1, 0.9, 0.4], [0.6, -0.2, 0.8]]) @ sums
    truth = torch.tensor([0.2, 0.5, 0.7]).repeat_interleave(4)
    data = (mixed.T @ mixed)[None] * torch.tensor([1.0, 0.37, 2.3])[:, None, None]
    right = data @ truth
    loose = Prior(taus=(6.0, 6.1, 6.2), bounds=(-9.0, 9.0))
    with pytest.raises(torch.linalg.LinAlgError):  # type: ignore[attr-defined]
        torch.linalg.cholesky(data + torch.eye(12) * loose.level_std**-2)
    found = solve_dense(data, right, loose)
    assert (found.nodes.reshape(3, 4, 3).mean(1) - torch.tensor([[0.2], [0.5], [0.7]])).abs().max() < 0.01
    assert found.std.min() > 0.05
    assert found.nodes.dtype == torch.float32  # beside the results of tiles that needed no double


def test_faint_pixels_are_solved_in_double_whoever_is_beside_them() -> None:
    rows, values = observations(smooth_truth(), 0.05)
    data, right = banded_equations(rows, values)
    share = torch.tensor([1.0, 1e-6, 1.0, 1e-7, 1.0], dtype=torch.float64)
    exact = solve_spectra(data * share, right * share, None, Prior())
    some = solve_spectra((data * share).float(), (right * share).float(), None, Prior())
    alone = [solve_spectra((data * share).float()[..., [i]], (right * share).float()[:, [i]], None, Prior())
             for i in range(PIXELS)]  # fmt: skip
    assert some.mean.dtype == torch.float32
    assert (some.mean - exact.mean).abs().max() < 1e-3
    for i, one in enumerate(alone):
        assert (some.mean[:, i] - one.mean[:, 0]).abs().max() < 1e-5


def test_a_prior_means_the_same_spectra_on_other_bands() -> None:
    fine = Prior().at_step(2.5)
    assert Prior().at_step(5.0) == Prior()
    assert fine.taus == pytest.approx([tau / 8**0.5 for tau in Prior().taus])
    assert (fine.level, fine.level_std, fine.bounds) == (Prior().level, Prior().level_std, Prior().bounds)


def test_the_peak_of_a_parabola_is_found_between_its_samples() -> None:
    positions = torch.linspace(-4.0, 4.0, 5, dtype=torch.float64)
    tops = torch.tensor([-2.7, -0.4, 0.0, 1.1, 2.9], dtype=torch.float64)
    samples = 5.0 - 0.3 * (positions[:, None] - tops) ** 2
    assert parabola_peak(samples, positions) == pytest.approx(tops, abs=1e-12)


def test_a_peak_is_at_the_better_end_where_samples_only_rise_fall_or_sag() -> None:
    positions = torch.tensor([1.0, 2.0, 3.0], dtype=torch.float64)
    samples = torch.tensor([[0.0, 9.0, 3.0, 2.0], [4.0, 4.0, 0.0, 0.0], [9.0, 0.0, 2.0, 3.0]])
    assert parabola_peak(samples.double(), positions).tolist() == [3.0, 1.0, 1.0, 3.0]


def test_data_with_less_than_a_hundredth_of_the_tightest_prior_are_too_faint_for_single_precision() -> None:
    prior = Prior(taus=(0.5, 0.1, 2.0))
    information = torch.tensor([[0.2, 0.2], [0.9, 1.1]])
    assert too_faint(information, prior).tolist() == [True, False]
    assert too_faint(information.double(), prior).tolist() == [False, False]
