"""Codes of other programs tell the columns that were drawn, and how sure they are of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import DecodeError, PlanError
from dsl_core.model.captured_code import CapturedCode, Phases, Stripes
from dsl_core.patterns.captured_code import captured_levels, decode_captured
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.patterns.reading import Measured

SIZE = (100, 36)
NOISE = 0.02


def _frames(
    code: CapturedCode, seed: int, std: float = NOISE, size: tuple[int, int] = SIZE
) -> Iterator[Measured]:
    rng = np.random.default_rng(seed)
    variance = np.full((size[1], size[0]), std**2, np.float32)
    for index in range(code.frame_count):
        clean = captured_levels(code, size, index)
        yield (clean + rng.normal(0, std, clean.shape)).astype(np.float32), variance


def _decoded(code: CapturedCode, std: float = NOISE, seed: int = 1) -> DecodedCode:
    white = (np.ones((SIZE[1], SIZE[0]), np.float32), np.full((SIZE[1], SIZE[0]), std**2, np.float32))
    return decode_captured(code, SIZE, _frames(code, seed, std), white)


def _columns() -> NDArray[np.float64]:
    return np.broadcast_to(np.arange(SIZE[0], dtype=float), (SIZE[1], SIZE[0]))


@pytest.mark.parametrize(
    "sets",
    [
        (Stripes(bits=7, inverse=False),),
        (Stripes(bits=7, code="binary"),),
        (Stripes(bits=7, code="xor", inverse=False, base_bit=1),),
        (Stripes(bits=8, offset=78, lacking=(1, 4)),),
        (Phases(periods_px=(100, 25, 5), steps=4),),
        (Phases(periods_px=(100 / 7, 100 / 8, 100 / 9), steps=5, start_deg=-90, direction=-1),),
        (Stripes(bits=4, inverse=False, unit_px=8), Phases(periods_px=(16,), steps=3)),
    ],
)
def test_every_code_tells_the_columns_it_was_drawn_for(sets: tuple[Stripes | Phases, ...]) -> None:
    found = _decoded(CapturedCode(column_sets=sets, row_sets=(Stripes(bits=6),)))
    assert found.fine_column_px is not None
    assert found.fine_std_px is not None
    error = np.abs(found.fine_column_px - _columns())
    assert np.mean(found.undecided) < 0.01
    assert np.all(error[~found.undecided] <= np.maximum(4.5 * found.fine_std_px[~found.undecided], 0.51))
    assert found.row is not None
    assert np.array_equal(found.row, np.broadcast_to(np.arange(36)[:, None], found.row.shape))


def test_wide_stripes_are_as_unsure_as_they_are_wide() -> None:
    found = _decoded(CapturedCode(column_sets=(Stripes(bits=5, unit_px=4),)))
    assert found.fine_column_px is not None
    assert found.fine_std_px is not None
    assert np.sqrt(np.mean((found.fine_column_px - _columns()) ** 2)) == pytest.approx(np.sqrt(1.25), rel=0.1)
    assert np.median(found.fine_std_px) == pytest.approx(4 / np.sqrt(12))


def test_the_deviation_holds_the_errors_of_noisy_digits() -> None:
    code = CapturedCode(column_sets=(Stripes(bits=7, inverse=False),))
    found = _decoded(code, std=0.2)
    assert found.fine_column_px is not None
    assert found.fine_std_px is not None
    error = found.fine_column_px - _columns()
    assert np.mean(np.abs(error) > 1) > 0.01
    stated = np.sqrt(np.mean(found.fine_std_px**2))
    assert stated == pytest.approx(1.2 * np.sqrt(np.mean(error**2)), rel=0.2)
    assert np.mean(np.abs(error) < 1.96 * found.fine_std_px) > 0.95


@pytest.mark.parametrize(
    "digits", [Stripes(bits=7, inverse=False), Stripes(bits=7, code="binary", inverse=False)]
)
def test_digits_that_a_pixel_sees_at_an_edge_are_as_unsure_as_what_they_change(digits: Stripes) -> None:
    code = CapturedCode(column_sets=(digits,))
    frames = [(value.copy(), variance) for value, variance in _frames(code, 1, 1e-3)]
    # Half of column 31 and half of 32: of Gray code one digit is between, of binary code six.
    for value, _ in frames:
        value[:, 31] = 0.49 * value[:, 32] + 0.51 * value[:, 31]
    white = (np.ones((SIZE[1], SIZE[0]), np.float32), np.full((SIZE[1], SIZE[0]), 1e-6, np.float32))
    found = decode_captured(code, SIZE, frames, white)
    assert found.fine_std_px is not None
    std = float(np.median(found.fine_std_px[:, 31]))
    assert (0.4 < std < 1) if digits.code == "gray" else std > 10
    assert np.median(found.fine_std_px[:, 40]) == pytest.approx(1 / np.sqrt(12), rel=0.01)


def test_a_tie_between_neighbours_keeps_its_column_and_another_does_not() -> None:
    code = CapturedCode(column_sets=(Stripes(bits=7, inverse=False),))
    frames = [(value.copy(), variance) for value, variance in _frames(code, 1, 1e-3)]
    # Columns 31 and 32 differ in the second digit alone, 40 and 23 as well.
    for column in (31, 40):
        frames[1][0][:, column] = 0.5
    white = (np.ones((SIZE[1], SIZE[0]), np.float32), np.full((SIZE[1], SIZE[0]), 1e-6, np.float32))
    found = decode_captured(code, SIZE, frames, white)
    assert found.fine_std_px is not None
    assert not found.undecided[:, 31].any()
    assert np.all(np.isin(found.column[:, 31], (31, 32)))
    assert found.undecided[:, 40].all()
    assert found.fine_std_px[0, 40] > 5 > 1 > found.fine_std_px[0, 31]


def test_what_cannot_be_told_is_refused() -> None:
    with pytest.raises(DecodeError, match=r"alone do not say.*second period"):
        _decoded(CapturedCode(column_sets=(Phases(periods_px=(10,), steps=4),)))
    code = CapturedCode(column_sets=(Stripes(bits=7),))
    with pytest.raises(DecodeError, match="has 14 frames, given 0"):
        decode_captured(code, SIZE, [], next(_frames(code, 1)))
    with pytest.raises(PlanError, match="0 to 13, not 14"):
        captured_levels(code, SIZE, 14)
    with pytest.raises(ValueError, match="nothing is left of bit 3"):
        Stripes(bits=7, lacking=(6, 7))
