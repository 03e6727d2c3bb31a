"""Binary reflected Gray code of projector columns and rows, encoded here and decoded next to it.

Bits run from the most significant to the least, columns before rows, each bit followed by its
inverse: the order of OpenCV's ``GrayCodePattern``, with white and black appended.

Under a diffraction film a pixel that is dark through the zero order still receives first-order
light. Decoding stays valid because a pixel that is lit through the zero order is at least as
bright as equations (4) and (7) of the supplement of "Dispersed Structured Light" (Shin et al.,
CVPR 2024) say, one that is not is at most as bright as equations (5) and (8), and the efficiency
of the zero order exceeds the sum of both first orders. A pattern and its inverse therefore
always differ with the right sign, whatever the albedo: no threshold is needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.errors import DecodeError, PlanError
from dsl_core.model.plan import BinaryCode
from dsl_core.patterns.digits import gray_word


def bit_counts(spec: BinaryCode, size_px: tuple[int, int]) -> tuple[int, int]:
    """Column bits and row bits (0 when rows are not coded) for a projector of (width, height) px.

    Raises `PlanError` for a projector that has nothing to tell apart.
    """
    width, height = size_px
    if width < 2 or height < 1 or (spec.rows and height < 2):
        raise PlanError(
            f"A Gray code needs a projector of at least 2 x 2 pixels, given {width} x {height}."
            " Correct projector_size_px of the plan."
        )
    return (width - 1).bit_length(), (height - 1).bit_length() if spec.rows else 0


def frame_count(spec: BinaryCode, size_px: tuple[int, int]) -> int:
    """Frames of the code including white and black."""
    return 2 * sum(bit_counts(spec, size_px)) + 2


def gray_bit(count: int, bit: int) -> NDArray[np.uint8]:
    """Bit ``bit`` (0 is the least significant) of the Gray code of 0 .. count-1, shape (count,), 0/1."""
    return (gray_word(np.arange(count, dtype=np.int32)) >> bit & 1).astype(np.uint8)


def code_image(spec: BinaryCode, size_px: tuple[int, int], index: int) -> NDArray[np.uint8]:
    """Frame ``index`` of the code, shape (height, width), 0 or 255.

    The last two indices are white and black. Raises `PlanError` for an index outside the code.
    """
    width, height = size_px
    columns, rows = bit_counts(spec, size_px)
    pair, inverse = divmod(index, 2)
    if not 0 <= pair <= columns + rows:
        raise PlanError(
            f"Frame {index} of the Gray code does not exist: {width} x {height} pixels need frames"
            f" 0 to {frame_count(spec, size_px) - 1}. Use the shots of the plan."
        )
    if pair == columns + rows:
        line = np.ones((1, 1), np.uint8)
    elif pair < columns:
        line = gray_bit(width, columns - 1 - pair)[None, :]
    else:
        line = gray_bit(height, columns + rows - 1 - pair)[:, None]
    image = np.empty((height, width), np.uint8)
    image[:] = 255 * (line ^ inverse)
    return image


@dataclass(frozen=True)
class DecodedCode:
    """What a Gray code says of each camera pixel; arrays share one shape.

    ``column`` and ``row`` are projector pixels, int32, -1 where ``undecided``; ``row`` is None when rows are
    not coded. ``likely_column`` is the better guess there too, within the projector. ``margin`` is the
    smallest ``|positive - inverse|`` over all bits, float32, in the unit of the input; ``margin_sigmas`` the
    smallest in standard deviations, None when none were given.

    The rest only codes with fine stripes can say. ``straight``: the light comes straight from the projector.
    ``rival_column``, int32: what the other code of an ensemble says where the two disagree, else -1.
    ``at_edge``: two codes name neighbouring columns, ``likely_column`` and the next; the truth is between.
    ``fine_column_px`` and ``fine_std_px``, float32: columns as codes of other programs tell them, which may
    be finer or coarser than a column, and their deviation; None for our own codes.
    """

    column: NDArray[np.int32]
    likely_column: NDArray[np.int32]
    row: NDArray[np.int32] | None
    margin: NDArray[np.float32]
    margin_sigmas: NDArray[np.float32] | None
    undecided: NDArray[np.bool_]
    straight: NDArray[np.bool_] | None = None
    rival_column: NDArray[np.int32] | None = None
    at_edge: NDArray[np.bool_] | None = None
    fine_column_px: NDArray[np.float32] | None = None
    fine_std_px: NDArray[np.float32] | None = None


class GrayDecoder:
    """Decodes pair by pair, in the order of the code, so that a stack is never held in memory."""

    def __init__(self, spec: BinaryCode, size_px: tuple[int, int]) -> None:
        """Expect the pairs of ``spec`` on a projector of ``size_px`` = (width, height)."""
        self._size_px = size_px
        self._bits = bit_counts(spec, size_px)
        self._pairs = 0
        self._margin_sigmas: NDArray[np.float32] | None = None

    @property
    def missing_pairs(self) -> int:
        """Pairs that have not been added yet."""
        return sum(self._bits) - self._pairs

    def add(self, positive: ArrayLike, inverse: ArrayLike, std: ArrayLike | None = None) -> None:
        """Add the next pair: two linear images of equal shape, in any unit, black subtracted or not.

        ``std`` is the standard deviation of their difference, in the same unit, broadcastable; give it
        with every pair or with none. Raises `DecodeError` for a surplus pair or another shape.
        """
        one, other = np.asarray(positive), np.asarray(inverse)
        self._check(one.shape, other.shape, std is not None)
        # Buffers are kept from pair to pair: fresh pages would cost more than the arithmetic.
        difference = self._difference
        np.copyto(difference, one)
        difference -= np.asarray(other, np.float32)
        np.greater(difference, 0, out=self._digit)
        # A binary digit is the exclusive or of the Gray digits so far, most significant first.
        if self._pairs in (0, self._bits[0]):
            self._bit[...] = False
        self._bit ^= self._digit
        code = self._column if self._pairs < self._bits[0] else self._row
        code += code
        code |= self._bit
        np.abs(difference, out=difference)
        np.minimum(self._margin, difference, out=self._margin)
        if std is not None and self._margin_sigmas is not None:
            difference /= np.asarray(std, np.float32)
            np.minimum(self._margin_sigmas, difference, out=self._margin_sigmas)
        self._pairs += 1

    def finish(self, min_margin: float = 0.0, min_sigmas: float = 0.0) -> DecodedCode:
        """Columns and rows of all pixels; raises `DecodeError` when pairs are missing.

        Undecided is a pixel whose margin is zero, not a number or below ``min_margin`` or ``min_sigmas``,
        and one whose code is outside the projector.
        """
        if self.missing_pairs:
            raise DecodeError(
                f"The binary code is incomplete: {self._pairs} of {sum(self._bits)} pattern pairs were given."
                " Capture the missing frames."
            )
        decided = (self._margin >= min_margin) & (self._margin > 0)
        if self._margin_sigmas is not None:
            decided &= self._margin_sigmas >= min_sigmas
        decided &= self._column < self._size_px[0]
        if self._bits[1]:
            decided &= self._row < self._size_px[1]
        undecided = ~decided
        return DecodedCode(
            column=_without(self._column, undecided),
            likely_column=self._column.clip(0, self._size_px[0] - 1),
            row=_without(self._row, undecided) if self._bits[1] else None,
            margin=self._margin,
            margin_sigmas=self._margin_sigmas,
            undecided=undecided,
        )

    def _check(self, shape: tuple[int, ...], inverse: tuple[int, ...], with_sigmas: bool) -> None:
        if not self.missing_pairs:
            raise DecodeError(f"The binary code has {self._pairs} pattern pairs; one more was given.")
        if shape != inverse:
            raise DecodeError(
                f"A pattern has shape {shape}, its inverse {inverse}. Both must come from one camera setting."
            )
        if self._pairs == 0:
            self._start(shape, with_sigmas)
        if shape != self._margin.shape:
            raise DecodeError(
                f"Pair {self._pairs} of the binary code has shape {shape}, the pairs before it"
                f" {self._margin.shape}. All frames must come from one camera setting."
            )
        if with_sigmas != (self._margin_sigmas is not None):
            raise DecodeError("Give the standard deviation with every pair of the binary code, or with none.")

    def _start(self, shape: tuple[int, ...], with_sigmas: bool) -> None:
        self._difference = np.empty(shape, np.float32)
        self._digit = np.empty(shape, bool)
        self._bit = np.empty(shape, bool)
        self._column = np.zeros(shape, np.int32)
        self._row = np.zeros(shape if self._bits[1] else 0, np.int32)
        self._margin = np.full(shape, np.inf, np.float32)
        self._margin_sigmas = np.full(shape, np.inf, np.float32) if with_sigmas else None


def lit_mask(white: ArrayLike, black: ArrayLike, threshold: ArrayLike) -> NDArray[np.bool_]:
    """Where ``white - black > threshold`` (all in one unit); the rest is in shadow, or not a number."""
    difference = np.asarray(white, np.float32) - np.asarray(black, np.float32)
    return np.asarray(difference > np.asarray(threshold))


def _without(code: NDArray[np.int32], undecided: NDArray[np.bool_]) -> NDArray[np.int32]:
    # The decoder keeps its own codes, so that finish() may be asked again with other limits.
    return np.where(undecided, np.int32(-1), code)
