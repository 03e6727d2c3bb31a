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
#: Where nobody knows which way columns rise, undoing that pair makes columns smoother than undoing any other
#: by so many columns, too, and as smooth as this: pixels that see many columns give them at random.
SMOOTHER_PX, SMOOTH_PX = 0.25, 2.0
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
#: Columns change so many times as much down the picture as across it where the camera is upright.
UPRIGHT = 2.0


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
    rows_px: float = 1.0,
) -> tuple[int, ...]:
    """Pairs of which one seems to have pattern and inverse exchanged; empty if all seem right.

    Neighbours in the raster, whose ``shape`` is given, are compared where pixels are ``trusted``: on
    surfaces, columns rise (``rises``, None if that is not known) steadily from pixel to pixel. Its rows are
    ``rows_px`` times as far apart as its columns.
    """
    asked = _Neighbours(shape, trusted, decode(code, size_px, pairs)[0], rows_px)
    as_taken = asked.as_taken
    if as_taken is None:
        return ()
    others = {
        number: asked.judge(decode(code, size_px, pairs, number)[0])
        for number in _of_columns(code, pairs, size_px)
    }
    undone = {number: found for number, found in others.items() if found is not None}
    if rises is None or asked.is_upright:
        return _smoothest(as_taken, undone)
    sign = 1.0 if rises else -1.0
    rising = {number: found[0] for number, found in undone.items() if sign * found[1] >= RISING}
    if not rising:
        return ()
    best = min(rising.values())
    if sign * as_taken[1] >= TURNED:
        number = min(rising, key=lambda each: rising[each])
        return (number,) if as_taken[0] > ROUGHER * best else ()
    return tuple(sorted(number for number, rough in rising.items() if rough <= AS_SMOOTH * best))


def _smoothest(as_taken: tuple[float, float], undone: Mapping[int, tuple[float, float]]) -> tuple[int, ...]:
    """The pair that alone makes columns smooth once its exchange is undone, whichever way they rise."""
    if len(undone) < 2:
        return ()
    number, *others = sorted(undone, key=lambda each: undone[each][0])
    rough, rises = undone[number]
    if rough > SMOOTH_PX:
        return ()
    next_best = min(as_taken[0], undone[others[0]][0])
    return (number,) if next_best > ROUGHER * rough + SMOOTHER_PX and abs(rises) >= RISING else ()


def run_backwards(
    code: BinaryCode,
    size_px: tuple[int, int],
    pairs: Mapping[int, Pair],
    trusted: NDArray[np.bool_],
    shape: tuple[int, int],
    rises: bool,
    rows_px: float = 1.0,
) -> bool:
    """Whether columns fall where they should rise, or rise where they should fall, nearly everywhere.

    No surface does that, however it is shaped: camera or projector is mirrored. An upright camera sees them
    rise or fall across its picture as surfaces are tilted.
    """
    asked = _Neighbours(shape, trusted, decode(code, size_px, pairs)[0], rows_px)
    found = asked.as_taken
    return found is not None and not asked.is_upright and (1.0 if rises else -1.0) * found[1] <= -RISING


def _of_columns(code: BinaryCode, pairs: Mapping[int, Pair], size_px: tuple[int, int]) -> list[int]:
    """Pairs that code columns: exchanging one of rows changes no column."""
    bits = (size_px[0] - 1).bit_length(), (size_px[1] - 1).bit_length() if code.rows else 0
    return [number for number in sorted(pairs) if number % sum(bits) < bits[0]]


class _Neighbours:
    """Compares columns of neighbouring pixels: how rough they are, and whether they rise.

    Pixels are neighbours across the picture, or down it if the camera ``is_upright``.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        trusted: NDArray[np.bool_],
        column: NDArray[np.int32],
        rows_px: float = 1.0,
    ) -> None:
        """``column`` are the projector's columns as taken, of which those that are ``trusted`` count."""
        self._shape, self._trusted = shape, trusted
        self._clip: float | None = None
        grid, usable = column.reshape(shape), (trusted & (column >= 0)).reshape(shape)
        across, down = (abs(_near_steps(*each).sum()) for each in ((grid, usable), (grid.T, usable.T)))
        self.is_upright = down / rows_px > UPRIGHT * across
        self.as_taken = self.judge(column)

    def judge(self, column: NDArray[np.int32]) -> tuple[float, float] | None:
        """Mean second difference, and rising less falling neighbours as a share; None if these are few."""
        usable = (self._trusted & (column >= 0)).reshape(self._shape)
        grid = column.reshape(self._shape)
        if self.is_upright:
            usable, grid = usable.T, grid.T
        three = usable[:, 2:] & usable[:, 1:-1] & usable[:, :-2]
        if int(three.sum()) < FEWEST_NEIGHBOURS:
            return None
        second = np.abs(grid[:, 2:] - 2 * grid[:, 1:-1] + grid[:, :-2])[three].astype(np.float64)
        if self._clip is None:
            self._clip = CLIP * max(float(np.median(second)), 1.0)
        near = _near_steps(grid, usable)
        rises = float(np.sign(near).mean()) if near.size else 0.0
        return float(np.minimum(second, self._clip).mean()), rises


def _near_steps(grid: NDArray[np.int32], usable: NDArray[np.bool_]) -> NDArray[np.int32]:
    """By how much columns change across the picture, from pixel to pixel of one surface."""
    steps = np.diff(grid, axis=1)[usable[:, 1:] & usable[:, :-1]]
    return steps[np.abs(steps) <= STEP_PX]
