"""The loops of the banded solver, uncompiled, against dense linear algebra pixel by pixel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.optics.colour_neighbours import AROUND
from tests.solve.plain import plain

Floats = NDArray[np.float64]

kernels = plain("dsl_core.solve.lane_kernels")
neighbour_sums = plain("dsl_core.solve.neighbour_sums")
LANES, ROWS, SUMS = int(kernels.LANES), int(kernels.ROWS), int(kernels.SUMS)
BANDS, LEVEL, RIDGE, UNEVEN, LOCAL = 11, 0.4, 2.5, 1 / 36, 100.0
TAUS = np.array([0.005, 0.03, 0.18, 1.1])
#: Lowest, highest, tolerance, stiffness and rounds.
BOUNDS = np.array([0.05, 1.0, 1e-4, 1e4, 5])
SECOND = np.diff(np.eye(BANDS), 2, axis=0)
ROUGHNESS = SECOND.T @ SECOND
MEAN = np.eye(BANDS) * 4 / 6 + np.eye(BANDS, k=1) / 6 + np.eye(BANDS, k=-1) / 6
MEAN[0, 0] = MEAN[-1, -1] = 5 / 6


def prior_of(tau: float) -> Floats:
    return np.asarray(ROUGHNESS / tau**2 + RIDGE * np.eye(BANDS))


PRIOR = np.zeros((4, BANDS))
for diagonal in range(3):
    PRIOR[diagonal, : BANDS - diagonal] = np.diagonal(ROUGHNESS, diagonal)
PRIOR[3] = RIDGE
VOLUMES = np.array([1 / np.diagonal(np.linalg.cholesky(prior_of(tau))) ** 2 for tau in TAUS])


def banded(matrix: Floats, size: int) -> Floats:
    """The rows of a symmetric matrix from its diagonal on, (bands, size)."""
    out = np.zeros((len(matrix), size))
    for o in range(size):
        out[: len(matrix) - o, o] = np.diagonal(matrix, o)
    return out


def dense(rows: Floats) -> Floats:
    """The symmetric matrix of `banded` rows."""
    full = np.zeros((len(rows), len(rows)))
    for j, row in enumerate(rows):
        for o in range(min(len(row), len(rows) - j)):
            full[j, j + o] = full[j + o, j] = row[o]
    return full


def nan(*rows: int) -> Iterator[Floats]:
    """Buffers in which a number that nobody wrote would be noticed."""
    return (np.full(count * LANES, np.nan) for count in rows)


def window_of(band: int) -> int:
    size = band + 1
    return size * size + size + size * ROWS + SUMS + size


@dataclass
class Scene:
    """A grid of pixels, what is measured of them, and where their results belong."""

    band: int
    neighbours: bool
    offsets: bool
    has_broad: bool
    parameters: float
    rows: int = 2
    columns: int = 16

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.band)
        size, margin = self.band + 1, 2 * self.neighbours
        self.channels = BANDS * size + BANDS + 2 + (BANDS if self.offsets else 0)
        shape = self.rows + margin, self.columns + margin
        self.equations = np.stack([np.stack([self.sample(rng) for _ in range(shape[1])])
                                   for _ in range(shape[0])])  # fmt: skip
        self.shares = rng.uniform(0.0, 1.0, (self.rows, 8, self.columns)).round(1)
        self.shading = rng.uniform(0.4, 1.6, (self.rows, self.columns))
        # The last block has no pixel, and nothing that could be solved; some others of its row have none.
        self.equations[-1, self.columns - 3, : BANDS * size : size] = -1e9
        self.index = np.full((self.rows, self.columns), -1, np.int64)
        wanted = np.ones(self.index.shape, bool)
        wanted[1, [0, 2, 5, *range(8, 16)]] = False
        self.pixels = int(wanted.sum())
        self.index[wanted] = rng.permutation(self.pixels)
        # Only the first block sees broad bands.
        self.broad = np.zeros((self.rows, BANDS, ROWS, self.columns))
        self.broad[0, :, :, :LANES] = rng.uniform(0.5, 3.0, (BANDS, ROWS, LANES))
        self.levels = rng.uniform(0.0, 8.0, (self.rows, ROWS, self.columns))
        if not self.has_broad:
            self.broad[:] = 0

    def sample(self, rng: np.random.Generator) -> Floats:
        """The equations of rows that see neighbouring bands each, of a spectrum that passes the bounds."""
        reach = self.band + 1
        x = np.arange(BANDS)
        truth = rng.uniform(0.2, 0.8) + rng.choice([0.02, 0.3, 0.9]) * np.sin(
            rng.uniform(0.2, 1.5) * x + rng.random()
        )
        noise = 10 ** rng.uniform(-1.5, 0.3)
        seen = np.zeros((2 * BANDS, BANDS))
        for row in seen:
            first = rng.integers(1 - reach, BANDS)
            part = slice(max(first, 0), first + reach)
            row[part] = rng.uniform(0.0, 1.0, len(row[part])) / noise
        values = seen @ truth + rng.normal(size=len(seen))
        parts = [banded(seen.T @ seen, reach).ravel(), seen.T @ values, [values @ values, len(values)]]
        return np.concatenate([*parts, rng.uniform(0.1, 2.0, BANDS)] if self.offsets else parts)

    def equations_of(self, y: int, x: int) -> Floats:
        """What is known of a pixel: its own sample, or those around it."""
        if not self.neighbours:
            return np.asarray(self.equations[y, x])
        total = self.equations[y + 1, x + 1].copy()
        for share, (dy, dx) in zip(self.shares[y, :, x], AROUND, strict=True):
            total += share * self.equations[y + 1 + dy, x + 1 + dx]
        return np.asarray(total)

    def found(self) -> SimpleNamespace:
        """The kernels' results."""
        band, margin = self.band, BANDS + 2 * self.band
        sizes = (self.channels, *(BANDS,) * 3, BANDS * ROWS, window_of(band), BANDS * (band + 2 + ROWS),
                 band * (band + 1), 3 * BANDS)  # fmt: skip
        ones = np.zeros(margin * LANES)
        ones[band * LANES : (band + BANDS) * LANES] = 1.0
        solutions = [
            np.zeros(margin * LANES),
            np.zeros(margin * LANES),
            *nan(margin, margin),
            ones,
            *nan(BANDS),
        ]
        marks = tuple(np.ones(count * LANES, bool) for count in (BANDS, BANDS, 1, 1))
        names = "nodes", "mean", "std", "share", "at_bound", "tau", "misfit"
        out: dict[str, Any] = {name: np.full((BANDS, self.pixels), np.nan) for name in names[:4]}
        out |= {"at_bound": np.zeros((BANDS, self.pixels), bool)}
        out |= {name: np.full(self.pixels, np.nan) for name in names[5:]}
        gathered = np.full((*self.index.shape, self.channels), np.nan)
        size = BANDS * (band + 1)
        neighbour_sums.gather(
            self.equations, self.neighbours, self.shares, self.shading, size, BANDS, gathered
        )
        sound = kernels.solve_blocks(
            gathered, self.index, self.shading, self.offsets,
            self.broad if self.has_broad else np.zeros((0, 0, 0, 0)),
            self.levels, PRIOR, VOLUMES, TAUS, BOUNDS, LEVEL, UNEVEN, LOCAL, self.parameters, (0,) * band,
            (*nan(*sizes), np.zeros(ROWS * margin * LANES)), tuple(solutions),
            np.full((len(TAUS) + 1, LANES), np.nan), marks, *(out[name] for name in names),
        )  # fmt: skip
        return SimpleNamespace(sound=sound, **out)


def peak(evidence: Floats) -> float:
    """The smoothness at the top of a parabola through three candidates."""
    best = int(np.clip(evidence.argmax(), 1, len(TAUS) - 2))
    left, middle, right = evidence[best - 1 : best + 2]
    bend = 2 * middle - left - right
    shift = np.clip(0.5 * (right - left) / bend, -1, 1) if bend > 1e-6 else np.sign(right - left)
    return float(TAUS[best] * (TAUS[1] / TAUS[0]) ** shift)


def wanted(scene: Scene, y: int, x: int) -> SimpleNamespace:
    """The same of one pixel by dense algebra."""
    size, s = scene.band + 1, scene.shading[y, x]
    known = scene.equations_of(y, x)
    data = dense(known[: BANDS * size].reshape(BANDS, size)) * s**2
    own = known[BANDS * size : BANDS * (size + 1)] * s
    square, number = known[BANDS * (size + 1) : BANDS * (size + 1) + 2]
    broad = scene.broad[y, :, :, x]
    right = own + LEVEL * RIDGE + broad @ scene.levels[y, :, x]
    seen = data + broad @ broad.T

    def evidence(tau: float) -> float:
        whole = seen + prior_of(tau)
        volume = np.linalg.slogdet(prior_of(tau))[1] - np.linalg.slogdet(whole)[1]
        return float(volume + right @ np.linalg.solve(whole, right))

    tau = peak(np.array([evidence(each) for each in TAUS]))
    whole = seen + prior_of(tau)
    nodes = np.linalg.solve(whole, right)
    variance = np.diagonal(MEAN @ np.linalg.inv(whole) @ MEAN.T).copy()
    variance[[0, -1]] = variance[[1, -2]]
    low, high, tolerance, penalty = BOUNDS[:4]
    held, slope, rounds = np.zeros(BANDS, bool), np.zeros(BANDS), 0
    for _ in range(int(BOUNDS[4])):
        is_free = np.where(nodes < 0.5 * (low + high), slope < 0, slope > 0)
        next_held = (held & ~is_free) | (nodes < low - tolerance) | (nodes > high + tolerance)
        if (next_held == held).all():
            break
        held, rounds = next_held, rounds + 1
        stiff = np.where(held, penalty * np.diagonal(data + prior_of(tau)), 0.0)
        at = np.where(nodes < 0.5 * (low + high), low, high)
        nodes = np.linalg.solve(whole + np.diag(stiff), right + stiff * at)
        slope = whole @ nodes - right
    nodes = nodes.clip(low, high)
    bend = np.pad(np.diff(nodes, 2), 1, "edge")
    fourth = np.pad(np.diff(bend, 2), 1, "edge")
    std = np.hypot(np.sqrt(np.maximum(variance, 1e-12)), UNEVEN * np.maximum(abs(bend), abs(fourth)))
    if scene.offsets:
        grey = (data.sum(1) + RIDGE) / s
        std = np.sqrt(std**2 + known[-BANDS:] / grey**2)
    near = (data * np.tri(BANDS, k=2) * np.tri(BANDS, k=2).T).sum(1)
    left = square - nodes @ (2 * own - data @ nodes)
    return SimpleNamespace(
        nodes=nodes, mean=MEAN @ nodes, std=std, share=near / (near + LOCAL), at_bound=held, tau=tau,
        misfit=left / max(number - min(scene.parameters, number / 3), 1.0), rounds=rounds,
    )  # fmt: skip


@pytest.mark.parametrize(
    "scene",
    [Scene(2, False, False, False, 30.0), Scene(3, False, True, True, 9.0), Scene(4, True, True, True, 25.0)],
    ids=["alone", "with broad bands", "with neighbours"],
)
def test_every_pixel_of_a_grid_gets_what_dense_algebra_gives(scene: Scene) -> None:
    found = scene.found()
    assert found.sound
    held, rounds = 0, set[int]()
    for y, x in zip(*np.nonzero(scene.index >= 0), strict=True):
        p, exact = scene.index[y, x], wanted(scene, y, x)
        for name in ("nodes", "mean", "std", "share"):
            assert getattr(found, name)[:, p] == pytest.approx(getattr(exact, name), rel=1e-7, abs=1e-8), name
        assert found.at_bound[:, p].tolist() == exact.at_bound.tolist()
        assert found.tau[p] == pytest.approx(exact.tau, rel=1e-8)
        assert found.misfit[p] == pytest.approx(exact.misfit, rel=1e-6)
        held += exact.at_bound.sum()
        rounds.add(exact.rounds)
    assert held > 5
    assert {0, 1, 2} <= rounds


@pytest.mark.parametrize(("lane", "is_sound"), [(3, False), (2, True)])
def test_a_system_that_is_not_positive_is_told_where_a_pixel_wants_it(lane: int, is_sound: bool) -> None:
    scene = Scene(2, False, False, False, 9.0)
    scene.equations[1, lane, 3 * 2 : 3 * 4 : 3] = -1e9
    assert (scene.index[1, lane] >= 0) is not is_sound
    assert scene.found().sound is is_sound


def test_what_is_known_exactly_has_a_deviation_of_a_millionth() -> None:
    scene = Scene(2, False, False, False, 9.0)
    rows = banded(1e14 * np.eye(BANDS), 3).ravel()
    scene.equations[:] = np.concatenate([rows, np.full(BANDS, 0.5e14), [0.25e14 * BANDS, 20]])
    scene.shading[:] = 1.0
    assert scene.found().std == pytest.approx(1e-6, rel=1e-3)


def eliminated(matrix: Floats, right: Floats, broad: Floats, volume: Floats) -> dict[str, Floats]:
    """What is left of the elimination of (lanes, bands, bands), (lanes, bands) and (bands, 3, lanes)."""
    band, lanes = 2, np.stack([banded(each, 3) for each in matrix], -1)
    (window,) = nan(window_of(band))
    prior, nothing = np.zeros((4, BANDS)), np.zeros(BANDS * LANES)
    kernels.eliminate(
        lanes.ravel(), nothing, right.T.ravel(), broad.ravel(), bool(broad.any()), prior, np.zeros(LANES),
        volume, (0, 0), window, nothing, False,
    )  # fmt: skip
    sums = window[: -3 * LANES].reshape(-1, LANES)[-SUMS:]
    return {"evidence": sums[kernels.EVIDENCE], "bad": sums[kernels.BAD]}


@pytest.mark.parametrize("is_broad", [False, True])
def test_evidence_is_the_quadratic_form_less_the_logarithm_of_the_determinant(is_broad: bool) -> None:
    rng = np.random.default_rng(4)
    seen = rng.normal(size=(LANES, 30, BANDS)) * (
        abs(np.subtract.outer(np.arange(30) // 3, np.arange(BANDS))) < 2
    )
    near = abs(np.subtract.outer(np.arange(BANDS), np.arange(BANDS))) < 3
    matrix = np.einsum("lrj,lrk->ljk", seen, seen) * near + 9 * np.eye(BANDS)
    right, volume = rng.normal(size=(LANES, BANDS)), rng.uniform(0.5, 2.0, BANDS)
    broad = rng.normal(size=(BANDS, ROWS, LANES)) * is_broad
    found = eliminated(matrix, right, broad, volume)
    whole = matrix + np.einsum("jrl,krl->ljk", broad, broad)
    form = np.einsum("lj,lj->l", right, np.linalg.solve(whole, right[..., None])[..., 0])
    assert found["evidence"] == pytest.approx(form - np.linalg.slogdet(whole)[1] - np.log(volume).sum())
    assert not found["bad"].any()


@pytest.mark.parametrize("is_broad", [False, True])
def test_the_gradient_is_that_of_data_prior_and_broad_bands(is_broad: bool) -> None:
    band, rng = 2, np.random.default_rng(6)
    data, broad = rng.normal(size=(BANDS, band + 1, LANES)), rng.normal(size=(BANDS, ROWS, LANES))
    right, weight = rng.normal(size=(BANDS, LANES)), rng.uniform(5, 9, LANES)
    x, found = np.zeros((2, BANDS + 2 * band, LANES))
    x[band:-band] = rng.normal(size=(BANDS, LANES))
    kernels.gradient(
        data.ravel(), right.ravel(), broad.ravel(), is_broad, PRIOR, weight, (0, 0), x.ravel(),
        found.reshape(-1),
    )  # fmt: skip
    for lane in range(LANES):
        seen = broad[:, :, lane] * is_broad
        whole = dense(data[:, :, lane]) + seen @ seen.T + np.diag(PRIOR[3])
        whole += weight[lane] * dense(PRIOR[:3].T)
        wanted = whole @ x[band:-band, lane] - right[:, lane]
        assert found[band:-band, lane] == pytest.approx(wanted)


def test_pivots_of_single_precision_are_multiplied_eight_at_a_time() -> None:
    """Nine of the largest would be more than a double holds, and eight take fewer logarithms than seven."""
    matrix, nothing = np.tile(np.eye(BANDS), (LANES, 1, 1)) * 3e38, np.zeros((LANES, BANDS))
    found = eliminated(matrix, nothing, np.zeros((BANDS, ROWS, LANES)), np.ones(BANDS))
    assert found["evidence"] == pytest.approx(-BANDS * np.log(3e38))
    assert kernels.TOGETHER == 8
    assert LANES * np.dtype(np.float64).itemsize == 64, "a line of the cache, and the widest register"


@pytest.mark.parametrize(("value", "is_bad"), [(np.inf, True), (-2.0, True), (1e-100, False), (np.nan, True)])
def test_a_pivot_that_is_not_positive_and_finite_is_marked_in_its_own_lane(
    value: float, is_bad: bool
) -> None:
    matrix, nothing = np.tile(np.eye(BANDS), (LANES, 1, 1)), np.zeros((LANES, BANDS))
    matrix[5, 2, 2] = matrix[5, 4, 4] = value
    found = eliminated(matrix, nothing, np.zeros((BANDS, ROWS, LANES)), np.ones(BANDS))
    assert found["bad"].tolist() == [float(is_bad and lane == 5) for lane in range(LANES)]


@pytest.mark.parametrize(
    ("gram", "is_bad"),
    [((1, 0, 0, 2, 0, 3), False), ((-3, 0, 0, -3, 0, 3), True), ((-3, 0, 0, 2, 0, -4), True)],
)
def test_broad_rows_that_are_not_positive_are_marked(gram: tuple[float, ...], is_bad: bool) -> None:
    sums = np.zeros((SUMS, LANES))
    sums[kernels.GRAM : kernels.GRAM + 6] = np.array(gram)[:, None]
    kernels.eliminate_small(sums.ravel(), 0)
    assert sums[kernels.BAD].tolist() == [float(is_bad)] * LANES


@pytest.mark.parametrize(
    ("evidence", "place"),
    [
        ((0, 4, 4, 0), 1.5),  # the first of two that are equal, and the peak between them
        ((0, 1, 9, 5), 2 + 0.5 * 4 / 12),
        ((9, 1, 0, 0), 0),  # the better end of a slope that sags
        ((0, 0, 1, 9), 3),
        ((9, 5, 0, 0), 0),  # not beyond the ends
        ((0, 0, 5, 9), 3),
        ((9, 8, 0, 0), 1 - 9 / 14),
        ((5, 0, 5, 0), 1),
        ((0, 0, 0, 0), 1),
        ((0, 4e-7, 2e-7, 0), 1.1),  # rounding has no peak
    ],
)
def test_the_most_evident_smoothness(evidence: tuple[float, ...], place: float) -> None:
    candidates = np.full((5, LANES), 7.0)
    candidates[1:, 3] = evidence
    taus = np.array([0.01, 0.1, 1.0, 10.0])
    assert kernels.most_evident(candidates, 3, taus) == pytest.approx(np.log(taus[0]) + place * np.log(10))


def test_bands_beyond_a_bound_are_held_until_the_light_draws_them_back() -> None:
    low, high = 0.2, 0.9
    # Value, slope there, whether it was held, whether it is to be held now.
    cases = [
        (low - 2e-4, 0, False, True), (low - 0.9e-4, 0, False, False), (low, -1, True, False),
        (low, 1, True, True), (0.5, -1, True, False), (0.6, -1, True, True), (0.6, 1, True, False),
        (high, 1, True, False), (high, -1, True, True), (high + 0.9e-4, 0, False, False),
        (high + 2e-4, 0, False, True),
    ]  # fmt: skip
    band, rng = 2, np.random.default_rng(2)
    x, slope = np.zeros((2, BANDS + 2 * band, LANES))
    pinned, held = np.zeros((2, BANDS, LANES), bool)
    for j, (value, rise, was, _) in enumerate(cases):
        x[band + j], slope[band + j], pinned[j] = value, rise, was
    todo = np.arange(LANES) % 2 == 0
    pinned[:, 4] = held[:, 4] = [each[3] for each in cases]
    x[band:-band, 4], slope[band:-band, 4] = 0.5 * low + 0.5 * high - 0.1, 1.0
    slope[band:-band, 4] = np.where(pinned[:, 4], 1.0, 0.0)
    data, right = rng.uniform(1, 2, (BANDS, band + 1, LANES)), rng.uniform(0, 1, (BANDS, LANES))
    weight = rng.uniform(5, 9, LANES)
    stiffness, stiff_right = np.full((2, BANDS, LANES), np.nan)
    bounds = np.array([low, high, 1e-4, 100.0, 5])
    moved = kernels.pin(
        data.ravel(), right.ravel(), PRIOR, weight, (0, 0), bounds, x.ravel(), slope.ravel(), pinned.ravel(),
        todo, held.ravel(), stiffness.ravel(), stiff_right.ravel(),
    )  # fmt: skip
    assert moved
    assert todo.tolist() == [True, False, True, False, False, False, True, False], "the fifth stays as it is"
    assert held[:, 0].tolist() == [each[3] for each in cases]
    main = data[:, 0] + PRIOR[0][:, None] * weight + RIDGE
    stiff = np.where(held & todo, 100 * main, 0)
    bound = np.where(x[band:-band] < 0.5 * (low + high), low, high)
    assert stiffness == pytest.approx(stiff)
    assert stiff_right == pytest.approx(right + stiff * bound)
    pinned[:] = held
    slope[band:-band] = np.where(bound == low, 1, -1)
    x[band:-band] = bound
    again = kernels.pin(
        data.ravel(), right.ravel(), PRIOR, weight, (0, 0), bounds, x.ravel(), slope.ravel(), pinned.ravel(),
        todo, held.ravel(), stiffness.ravel(), stiff_right.ravel(),
    )  # fmt: skip
    assert not again
    assert not todo.any()
