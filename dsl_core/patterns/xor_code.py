"""XOR codes: Gray codes without coarse stripes, so that interreflections do not flip their bits.

Every pattern of the Gray code is combined by exclusive or with a fine one of its own, the base, which is
projected as it is: the last pattern (stripes of 2 px, "XOR-02") or the last but one (4 px, "XOR-04").
Order and number of frames stay those of the Gray code. Gupta, Agrawal, Veeraraghavan, Narasimhan:
"Structured light 3D scanning in the presence of global illumination", CVPR 2011.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import EnsembleCode, XorCode
from dsl_core.patterns.digits import gray_number, gray_word, with_base
from dsl_core.patterns.gray_code import DecodedCode, GrayDecoder, bit_counts, code_image

#: Every bit of fine stripes stands this many deviations above its inverse where light comes straight.
STRAIGHT_SIGMAS = 5.0
Spec = XorCode | EnsembleCode


def xor_image(spec: Spec, size_px: tuple[int, int], index: int) -> NDArray[np.uint8]:
    """Frame ``index`` of the code, shape (height, width), 0 or 255; raises `PlanError` outside the code."""
    columns, rows = bit_counts(spec, size_px)
    base_bit = _base_bit(spec, size_px)
    image = code_image(spec, size_px, index)
    pair = index // 2
    base_pair = (columns if pair < columns else columns + rows) - 1 - base_bit
    if pair in (base_pair, columns + rows):
        return image
    return np.asarray(image ^ code_image(spec, size_px, 2 * base_pair))


class XorDecoder:
    """Decodes pair by pair; the counterpart of `GrayDecoder`."""

    def __init__(self, spec: Spec, size_px: tuple[int, int]) -> None:
        """Expect the pairs of the XOR code of ``spec`` on a projector of ``size_px`` = (width, height)."""
        self._size_px = size_px
        self._bits = bit_counts(spec, size_px)
        self._base_bit = _base_bit(spec, size_px)
        # As Gray codes the frames may name any number of these bits; the range is checked after conversion.
        self._decoder = GrayDecoder(spec, (2 ** self._bits[0], 2 ** max(self._bits[1], 1)))

    def add(self, positive: ArrayLike, inverse: ArrayLike, std: ArrayLike | None = None) -> None:
        """Add the next pair; see `GrayDecoder.add`."""
        self._decoder.add(positive, inverse, std)

    def finish(self, min_margin: float = 0.0, min_sigmas: float = 0.0) -> DecodedCode:
        """Columns and rows of all pixels; see `GrayDecoder.finish`."""
        found = self._decoder.finish(min_margin, min_sigmas)
        column = _converted(found.column, self._bits[0], self._base_bit)
        likely = _converted(found.likely_column, self._bits[0], self._base_bit)
        undecided = found.undecided | (column >= self._size_px[0])
        row = None
        if found.row is not None:
            row = _converted(found.row, self._bits[1], self._base_bit)
            undecided |= row >= self._size_px[1]
            row[undecided] = -1
        column[undecided] = -1
        straight = ~undecided
        if found.margin_sigmas is not None:
            straight &= found.margin_sigmas >= STRAIGHT_SIGMAS
        likely = likely.clip(0, self._size_px[0] - 1)
        return replace(
            found, column=column, likely_column=likely, row=row, undecided=undecided, straight=straight
        )


def _base_bit(spec: Spec, size_px: tuple[int, int]) -> int:
    base_bit = spec.base_px.bit_length() - 2
    if min(bits for bits in bit_counts(spec, size_px) if bits) <= base_bit:
        raise PlanError(
            f"An XOR-{spec.base_px:02d} code needs more than {spec.base_px} columns and rows, given"
            f" {size_px[0]} x {size_px[1]}. Use the Gray code."
        )
    return base_bit


def _converted(code: NDArray[np.int32], bits: int, base_bit: int) -> NDArray[np.int32]:
    """Numbers decoded as if the XOR digits were Gray digits -> numbers that the XOR digits mean."""
    return gray_number(with_base(gray_word(code), bits, base_bit), bits)
