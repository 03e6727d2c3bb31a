"""The loops of the dense solver, uncompiled, against linear algebra of numpy pixel by pixel."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.solve.plain import plain

Floats = NDArray[np.float64]

kernels = plain("dsl_core.solve.dense_kernels")
PANEL = int(kernels.PANEL)
#: One more than a panel: rows of the second one are filled up.
BANDS, LEVEL, RIDGE = 9, 0.4, 2.5
WIDE = int(kernels.panelled(BANDS))
TAUS = np.array([0.005, 0.03, 0.18, 1.1])
#: Lowest, highest, tolerance, stiffness and rounds.
BOUNDS = np.array([0.05, 1.0, 1e-4, 1e4, 5])
SECOND = np.diff(np.eye(BANDS), 2, axis=0)
ROUGHNESS = SECOND.T @ SECOND
MEAN = np.eye(BANDS) * 4 / 6 + np.eye(BANDS, k=1) / 6 + np.eye(BANDS, k=-1) / 6
TRIANGLE = np.triu_indices(BANDS)


def prior_of(tau: float) -> Floats:
    return np.asarray(ROUGHNESS / tau**2 + RIDGE * np.eye(BANDS))


PRIOR = np.zeros((4, BANDS))
for diagonal in range(3):
    PRIOR[diagonal, : BANDS - diagonal] = np.diagonal(ROUGHNESS, diagonal)
PRIOR[3] = RIDGE
VOLUMES = np.ones((len(TAUS), WIDE))
VOLUMES[:, :BANDS] = [1 / np.diagonal(np.linalg.cholesky(prior_of(tau))) ** 2 for tau in TAUS]


def some_pixels(count: int) -> tuple[Floats, Floats, Floats]:
    """Matrices, right sides, and sum of squares and number of data, of spectra that pass the bounds."""
    rng = np.random.default_rng(5)
    x = np.arange(BANDS)
    made = []
    for _ in range(count):
        truth = rng.uniform(0.2, 0.8) + rng.choice([0.02, 0.3, 0.9]) * np.sin(rng.uniform(0.2, 1.5) * x)
        seen = rng.uniform(0, 1, (2 * BANDS, BANDS)) / 10 ** rng.uniform(-1.5, 0.3)
        values = seen @ truth + rng.normal(size=len(seen))
        made.append((seen.T @ seen, seen.T @ values, np.array([values @ values, len(values)])))
    matrix, right, others = (np.stack(each) for each in zip(*made, strict=True))
    return matrix, right, others


def solved(matrix: Floats, right: Floats, others: Floats, parameters: float = 9.0) -> SimpleNamespace:
    """The kernel's results, from buffers in which a number that nobody wrote would be noticed."""
    equations = np.concatenate([matrix[:, *TRIANGLE], right, others], 1)
    assert equations.shape[1] == kernels.channels(BANDS)
    sizes = WIDE * (WIDE + PANEL), WIDE, WIDE * WIDE, *(BANDS,) * 3, WIDE, len(TAUS)
    names = "nodes", "variance", "local", "at_bound", "tau", "misfit", "sound"
    out: dict[str, Any] = {name: np.full(right.shape, np.nan) for name in names[:3]}
    out |= {"at_bound": np.ones(right.shape, bool)}
    out |= {name: np.full(len(right), np.nan) for name in names[4:6]} | {"sound": np.zeros(len(right), bool)}
    kernels.solve_full(
        equations, PRIOR, VOLUMES, TAUS, LEVEL, BOUNDS, parameters, 1 / 3,
        tuple(np.full(size, np.nan) for size in sizes), *(out[name] for name in names),
    )  # fmt: skip
    return SimpleNamespace(**out)


def peak(evidence: Floats) -> float:
    """The smoothness at the top of a parabola through three candidates."""
    best = int(np.clip(evidence.argmax(), 1, len(TAUS) - 2))
    left, middle, right = evidence[best - 1 : best + 2]
    bend = 2 * middle - left - right
    shift = np.clip(0.5 * (right - left) / bend, -1, 1) if bend > 1e-6 else np.sign(right - left)
    return float(TAUS[best] * (TAUS[1] / TAUS[0]) ** shift)


def wanted(data: Floats, own: Floats, others: Floats, parameters: float) -> SimpleNamespace:
    """The same of one pixel by numpy."""
    right = own + LEVEL * RIDGE

    def evidence(tau: float) -> float:
        whole = data + prior_of(tau)
        volume = np.linalg.slogdet(prior_of(tau))[1] - np.linalg.slogdet(whole)[1]
        return float(volume + right @ np.linalg.solve(whole, right))

    tau = peak(np.array([evidence(each) for each in TAUS]))
    whole = data + prior_of(tau)
    nodes = np.linalg.solve(whole, right)
    variance = np.diagonal(MEAN @ np.linalg.inv(whole) @ MEAN.T).copy()
    variance[[0, -1]] = variance[[1, -2]]
    low, high, tolerance, penalty = BOUNDS[:4]
    held, rounds = np.zeros(BANDS, bool), 0
    for _ in range(int(BOUNDS[4])):
        slope = whole @ nodes - right
        is_free = np.where(nodes < 0.5 * (low + high), slope < 0, slope > 0)
        next_held = (held & ~is_free) | (nodes < low - tolerance) | (nodes > high + tolerance)
        if (next_held == held).all():
            break
        held, rounds = next_held, rounds + 1
        stiff = np.where(held, penalty * np.diagonal(whole), 0.0)
        at = np.where(nodes < 0.5 * (low + high), low, high)
        nodes = np.linalg.solve(whole + np.diag(stiff), right + stiff * at)
    nodes = nodes.clip(low, high)
    near = (data * np.tri(BANDS, k=2) * np.tri(BANDS, k=2).T).sum(1)
    left = others[0] - nodes @ (2 * own - data @ nodes)
    return SimpleNamespace(
        nodes=nodes, variance=variance, local=near, at_bound=held, tau=tau, rounds=rounds,
        misfit=left / max(others[1] - min(parameters, others[1] / 3), 1.0),
    )  # fmt: skip


@pytest.mark.parametrize("parameters", [4.0, 9.0])
def test_every_pixel_gets_what_dense_algebra_gives(parameters: float) -> None:
    pixels = some_pixels(12)
    found = solved(*pixels, parameters)
    assert found.sound.all()
    held, rounds = 0, set[int]()
    for p, own in enumerate(zip(*pixels, strict=True)):
        exact = wanted(*own, parameters)
        for name in ("nodes", "variance", "local"):
            assert getattr(found, name)[p] == pytest.approx(getattr(exact, name), rel=1e-7, abs=1e-8), name
        assert found.at_bound[p].tolist() == exact.at_bound.tolist()
        assert found.tau[p] == pytest.approx(exact.tau, rel=1e-8)
        assert found.misfit[p] == pytest.approx(exact.misfit, rel=1e-6)
        held += exact.at_bound.sum()
        rounds.add(exact.rounds)
    assert held > 5
    assert {0, 1, 3} <= rounds


@pytest.mark.parametrize("value", [-1e9, np.inf, np.nan])
def test_a_system_that_is_not_definite_is_told_and_spoils_no_other(value: float) -> None:
    matrix, right, others = some_pixels(3)
    alone = solved(matrix[2:], right[2:], others[2:])
    matrix[1, 4, 4] = value
    found = solved(matrix, right, others)
    assert found.sound.tolist() == [True, False, True]
    assert found.nodes[2].tolist() == alone.nodes[0].tolist()


def test_pixels_without_data_have_the_prior() -> None:
    nothing = np.zeros((1, BANDS, BANDS))
    found = solved(nothing, nothing[:, 0], np.zeros((1, 2)))
    assert found.nodes == pytest.approx(LEVEL)
    assert found.local.tolist() == [[0.0] * BANDS]
    assert found.misfit.tolist() == [0.0]


def test_rows_of_a_spectrum_fill_whole_panels() -> None:
    assert [int(kernels.panelled(n)) for n in (1, 8, 9, 47)] == [8, 8, 16, 48]
