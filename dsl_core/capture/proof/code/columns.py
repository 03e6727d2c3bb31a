"""Columns decoded on the raster: which way they run, and pairs whose pattern and inverse changed places."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.code.code_pairs import Pair
from dsl_core.model.plan import BinaryCode
from dsl_core.patterns.binary_code import decoder_of

#: A pattern and its inverse differ by at least this share of the contrast, else the column is uncertain.
LEAST_MARGIN = 0.12
#: An exchanged pair of fine stripes makes neighbouring columns at least so much rougher.
ROUGHER = 1.25
#: One of coarse stripes turns most of the picture around: rising neighbours less falling ones, as a share.
RISING, TURNED = 0.6, 0.2
#: Undoing any of these pairs may explain a picture that is turned around: so much rougher than the best.
AS_SMOOTH = 3.0
#: Neighbours needed to judge that.
FEWEST_NEIGHBOURS = 60
#: Second differences of columns count up to this many times their median.
CLIP = 6.0
#: Neighbours further apart than this, columns, are on different surfaces.
STEP_PX = 20


def decode(
    code: BinaryCode, size_px: tuple[int, int], pairs: Mapping[int, Pair], exchanged: int | None = None
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Projector column of every pixel, -1 where unknown, and the smallest difference of all its pairs.

    ``exchanged`` names a pair whose two pictures are taken for each other. Raises `DecodeError` while pairs
    are missing.
    """
    decoder = decoder_of(code, size_px)
    for number in sorted(pairs):
        one, other = pairs[number]
        decoder.add(*((other, one) if number == exchanged else (one, other)))
    found = decoder.finish()
    return found.column, found.margin


def exchanged_pairs(
    code: BinaryCode,
    size_px: tuple[int, int],
    pairs: Mapping[int, Pair],
    trusted: NDArray[np.bool_],
    shape: tuple[int, int],
    rises: bool | None,
) -> tuple[int, ...]:
    """Pairs of which one seems to have pattern and inverse exchanged; empty if all seem right.

    Neighbours in the rows of the raster, whose ``shape`` is given, are compared where pixels are ``trusted``:
    on surfaces, columns rise (``rises``, None if that is not known) steadily from pixel to pixel.
    """
    asked = _Neighbours(shape, trusted)
    column, _ = decode(code, size_px, pairs)
    as_taken = asked.judge(column)
    if as_taken is None:
        return ()
    others = {
        number: asked.judge(decode(code, size_px, pairs, number)[0])
        for number in _of_columns(code, pairs, size_px)
    }
    undone = {number: found for number, found in others.items() if found is not None}
    sign = -1.0 if rises is False else 1.0
    rising = {number: found[0] for number, found in undone.items() if sign * found[1] >= RISING}
    if not rising:
        return ()
    best = min(rising.values())
    if sign * as_taken[1] >= TURNED:
        number = min(rising, key=lambda each: rising[each])
        return (number,) if as_taken[0] > ROUGHER * best else ()
    if rises is None:
        return ()
    return tuple(sorted(number for number, rough in rising.items() if rough <= AS_SMOOTH * best))


def run_backwards(
    code: BinaryCode,
    size_px: tuple[int, int],
    pairs: Mapping[int, Pair],
    trusted: NDArray[np.bool_],
    shape: tuple[int, int],
    rises: bool,
) -> bool:
    """Whether columns fall where they should rise, or rise where they should fall, nearly everywhere.

    No surface does that, however it is shaped: camera or projector is mirrored.
    """
    found = _Neighbours(shape, trusted).judge(decode(code, size_px, pairs)[0])
    return found is not None and (1.0 if rises else -1.0) * found[1] <= -RISING


def _of_columns(code: BinaryCode, pairs: Mapping[int, Pair], size_px: tuple[int, int]) -> list[int]:
    """Pairs that code columns: exchanging one of rows changes no column."""
    bits = (size_px[0] - 1).bit_length(), (size_px[1] - 1).bit_length() if code.rows else 0
    return [number for number in sorted(pairs) if number % sum(bits) < bits[0]]


class _Neighbours:
    """Compares columns of neighbouring pixels: how rough they are, and whether they rise."""

    def __init__(self, shape: tuple[int, int], trusted: NDArray[np.bool_]) -> None:
        self._shape, self._trusted = shape, trusted
        self._clip: float | None = None

    def judge(self, column: NDArray[np.int32]) -> tuple[float, float] | None:
        """Mean second difference, and rising less falling neighbours as a share; None if these are few."""
        usable = (self._trusted & (column >= 0)).reshape(self._shape)
        grid = column.reshape(self._shape)
        three = usable[:, 2:] & usable[:, 1:-1] & usable[:, :-2]
        if int(three.sum()) < FEWEST_NEIGHBOURS:
            return None
        second = np.abs(grid[:, 2:] - 2 * grid[:, 1:-1] + grid[:, :-2])[three].astype(np.float64)
        if self._clip is None:
            self._clip = CLIP * max(float(np.median(second)), 1.0)
        steps = np.diff(grid, axis=1)[usable[:, 1:] & usable[:, :-1]]
        near = steps[np.abs(steps) <= STEP_PX]
        rises = float(np.sign(near).mean()) if near.size else 0.0
        return float(np.minimum(second, self._clip).mean()), rises
