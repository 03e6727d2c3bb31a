"""The loop over samples, uncompiled, against sums over whole frames."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.optics.lines.sums import add_samples, by_line

Floats = NDArray[np.float64]

BANDS, FRAMES, SIZE, FIRST, STEP, MODEL_ERROR, SURPLUS = 5, 14, 3, 6, 4, 0.02, 0.25
#: Orders: the steps of the table on either side of a line, and the frames that show it.
SUPPORTS, LIT = np.array([10, 7]), np.array([[0, 13], [3, 14]])
#: The first pixel of the grid in the picture.
CORNER = 2, 1
INDEX = np.array([[-1, 3, 0, -1], [5, 1, -1, 4], [2, -1, 6, 7]])
SAMPLES = INDEX.max() + 1
DECAY = 0.3


def scene(orders: tuple[int, ...] = (0, 1)) -> SimpleNamespace:
    """Frames, deviations and light of a few samples; some bands of some are outside the projector."""
    rng = np.random.default_rng(3)
    entries = np.zeros((2, 2 * SUPPORTS.max() + 1))
    for values, support in zip(entries, SUPPORTS, strict=True):
        values[1 : 2 * support] = rng.uniform(0.1, 1.0, 2 * support - 1)
    # Order +1 rises with the bands, beyond the lit frames, and order -1 falls; one sample has one band, the
    # last has none.
    start = rng.integers(6, 32, (1, SAMPLES))
    rising = np.cumsum(np.vstack([start, rng.integers(2, 9, (BANDS - 1, SAMPLES))]), 0)
    columns = np.stack([rising, 60 - rising]).astype(np.int32)
    inside = rng.random(columns.shape) < 0.8
    inside[:, :, 7] = False
    inside[:, :, 6] = False
    inside[0, 0, 6] = True
    place = rng.uniform(2.0, 10.0, SAMPLES)
    distance = np.stack([place % 1, 1 - place % 1])
    return SimpleNamespace(
        radiance=rng.uniform(1.0, 9.0, (FRAMES, 6, 6)).astype(np.float32),
        std=rng.uniform(0.1, 0.4, (FRAMES, 6, 6)).astype(np.float16),
        columns=columns[list(orders)], inside=inside[list(orders)], tables=entries[list(orders)],
        supports=SUPPORTS[list(orders)], lit=LIT[list(orders)],
        white=rng.uniform(0.5, 2.0, (2, 3, BANDS))[list(orders)], colour=rng.integers(0, 3, SAMPLES),
        offset=rng.uniform(-0.5, 0.5, SAMPLES), offset_variance=rng.uniform(0.1, 0.5, SAMPLES),
        amplitude=rng.uniform(1.0, 3.0, SAMPLES), place=place,
        halos=0.4 * np.exp(-DECAY * distance), ratio=np.exp(-DECAY * np.arange(FRAMES + 1)),
    )  # fmt: skip


def summed(
    made: SimpleNamespace, rows: tuple[int, int] = (0, 3), *, half: bool = False, with_offsets: bool = True
) -> Floats:
    """What the loop adds up, (rows, columns, channels)."""
    channels = BANDS * SIZE + BANDS + 2 + (BANDS if with_offsets else 0)
    equations = np.full((rows[1] - rows[0] + 1, 4, channels), np.nan)
    squares = np.arange(65536, dtype=np.uint16).view(np.float16)
    nobody = np.zeros((0, 0, 0))
    with np.errstate(all="ignore"):
        variances = squares.astype(np.float32) ** 2
        add_samples(
            made.radiance, made.std.view(np.uint16) if half else nobody.astype(np.uint16),
            nobody if half else made.std.astype(np.float32), variances, CORNER, INDEX, rows,
            made.columns, made.inside, np.stack([by_line(table, STEP) for table in made.tables]),
            made.supports, made.lit, FIRST, STEP, made.white,
            made.colour, made.offset, made.offset_variance, made.amplitude,
            np.floor(made.place).astype(np.int64), made.halos, made.ratio, MODEL_ERROR, SURPLUS, SIZE,
            with_offsets, equations,
        )  # fmt: skip
    assert np.isnan(equations[-1]).all(), "only the rows that were asked for"
    return equations[:-1]


def wanted(made: SimpleNamespace, row: int, column: int) -> Floats:
    """The same of one sample, from each band's light in every frame."""
    s, y, x = INDEX[row, column], CORNER[0] + row, CORNER[1] + column
    line = np.arange(FRAMES)
    halo = 0.4 * np.exp(-DECAY * abs(line - made.place[s]))
    values = made.radiance[:, y, x] - made.offset[s] - made.amplitude[s] * halo
    with np.errstate(all="ignore"):
        weight = 1 / (made.std[:, y, x].astype(float) ** 2 + (MODEL_ERROR * values) ** 2)
    known = np.isfinite(values) & np.isfinite(weight)
    values, weight = np.where(known, values, 0), np.where(known, weight, 0)
    matrix, right, grey = np.zeros((BANDS, BANDS)), np.zeros(BANDS), np.zeros(BANDS)
    square = number = 0.0
    for m, support in enumerate(made.supports):
        away = made.columns[m, :, s, None] - FIRST - STEP * line
        is_lit = (line >= made.lit[m, 0]) & (line < made.lit[m, 1])
        reached = made.inside[m, :, s, None] & (abs(away) < support) & is_lit
        light = np.where(reached, made.tables[m, (away + support).clip(0, 2 * support)], 0.0)
        light *= made.white[m, made.colour[s], :, None]
        matrix += (light * weight) @ light.T
        right += light @ (weight * values)
        grey += light @ weight
        # Data count where any band from the first to the last one of the order might be.
        at = made.columns[m, made.inside[m, :, s], s] - FIRST
        if len(at):
            window = (STEP * line > at.min() - support) & (STEP * line < at.max() + support) & is_lit
            square += float((weight * values**2)[window].sum())
            number += float((weight > 0)[window].sum())
    bands = np.zeros((BANDS, SIZE))
    for o in range(SIZE):
        bands[: BANDS - o, o] = np.diagonal(matrix, o)
    bands[:, 0] *= 1 + SURPLUS
    return np.concatenate([bands.ravel(), right, [square, number], grey**2 * made.offset_variance[s]])


def assert_same(found: Floats, made: SimpleNamespace, first_row: int = 0) -> None:
    for row, column in np.ndindex(len(found), 4):
        if INDEX[first_row + row, column] < 0:
            assert not found[row, column].any()
        else:
            exact = wanted(made, first_row + row, column)[: found.shape[2]]
            assert found[row, column] == pytest.approx(exact, rel=1e-6, abs=1e-9), (row, column)


@pytest.mark.parametrize("half", [True, False])
@pytest.mark.parametrize("orders", [(0,), (1,), (0, 1)])
def test_equations_are_sums_over_the_frames_of_each_order(orders: tuple[int, ...], half: bool) -> None:
    made = scene(orders)
    assert_same(summed(made, half=half), made)


def test_rows_may_be_added_one_after_the_other_and_without_offsets() -> None:
    made = scene()
    assert_same(summed(made, (1, 3)), made, 1)
    assert_same(summed(made, (2, 3), with_offsets=False), made, 2)


def test_what_is_no_number_has_no_weight() -> None:
    made = scene()
    rng = np.random.default_rng(1)
    for values, bad in (
        (made.radiance, np.nan),
        (made.radiance, np.inf),
        (made.std, np.nan),
        (made.std, np.inf),
    ):
        values[rng.random(values.shape) < 0.05] = bad
    # Nothing is known of the sign of an infinite weight either.
    made.std[5], made.radiance[5] = 0.0, 0.0
    made.offset[:], made.amplitude[:] = 0.0, 0.0
    assert_same(summed(made), made)


def test_a_sample_without_a_band_of_its_own_knows_nothing() -> None:
    assert not summed(scene())[2, 3].any()


@pytest.mark.parametrize("half", [True, False])
def test_data_count_however_little_they_weigh(half: bool) -> None:
    made = scene()
    made.std *= np.float16(50)
    found = summed(made, half=half)
    assert_same(found, made)
    assert float(found[0, 1, BANDS * SIZE + BANDS + 1]) > 5, "of weights below a hundredth"
