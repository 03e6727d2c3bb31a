"""Two codes of one scene: Gray code, which needs no sharp stripes, and XOR code, which no reflection upsets.

Where both name the same column, or neighbours, it is certain. Where they differ, light reaches the pixel by
another way than straight, or something blurs the fine stripes: the code that looks sound is taken first, the
other kept as its rival, for the scan lines to decide. After the ensemble of four codes in Gupta, Agrawal,
Veeraraghavan, Narasimhan: "Structured light 3D scanning in the presence of global illumination", CVPR 2011,
which keeps what two codes agree on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.model.plan import EnsembleCode
from dsl_core.patterns.gray_code import DecodedCode, GrayDecoder, bit_counts, code_image
from dsl_core.patterns.xor_code import XorDecoder, xor_image

#: Codes that name columns this far apart agree: at the edge of a column either answer is right.
AGREE_PX = 1


def ensemble_image(spec: EnsembleCode, size_px: tuple[int, int], index: int) -> NDArray[np.uint8]:
    """Frame ``index`` of the ensemble, shape (height, width), 0 or 255; raises `PlanError` outside of it."""
    half = 2 * sum(bit_counts(spec, size_px))
    if 0 <= index < half:
        return code_image(spec, size_px, index)
    # White and black come once, after both.
    return xor_image(spec, size_px, index - half)


class EnsembleDecoder:
    """Decodes pair by pair, Gray pairs first; the counterpart of `GrayDecoder`."""

    def __init__(self, spec: EnsembleCode, size_px: tuple[int, int]) -> None:
        """Expect the pairs of ``spec`` on a projector of ``size_px`` = (width, height)."""
        self._gray, self._xor = GrayDecoder(spec, size_px), XorDecoder(spec, size_px)

    def add(self, positive: ArrayLike, inverse: ArrayLike, std: ArrayLike | None = None) -> None:
        """Add the next pair; see `GrayDecoder.add`."""
        decoder = self._gray if self._gray.missing_pairs else self._xor
        decoder.add(positive, inverse, std)

    def finish(self, min_margin: float = 0.0, min_sigmas: float = 0.0) -> DecodedCode:
        """Columns and rows of all pixels, as far as the two agree; see `GrayDecoder.finish`."""
        return combine(self._gray.finish(min_margin, min_sigmas), self._xor.finish(min_margin, min_sigmas))


def combine(gray: DecodedCode, xor: DecodedCode) -> DecodedCode:
    """One answer of two codes: that of the XOR code where its stripes arrive straight, else the Gray code's.

    Light comes straight where both agree or the XOR code is sound. Undecided is what neither decides.
    """
    assert xor.straight is not None
    both = ~gray.undecided & ~xor.undecided
    apart = np.abs(gray.likely_column - xor.likely_column)
    agree = both & (apart <= AGREE_PX)
    # Of two neighbours the lower one, so that the edge between is half a pixel further.
    at_edge = agree & (apart == 1)
    take_xor = ~agree & ~xor.undecided & (xor.straight | gray.undecided)
    likely = np.where(take_xor, xor.likely_column, gray.likely_column)
    likely = np.where(at_edge, np.minimum(gray.likely_column, xor.likely_column), likely)
    rival = np.where(take_xor, gray.likely_column, xor.likely_column)
    undecided = gray.undecided & xor.undecided
    row = None
    if gray.row is not None and xor.row is not None:
        row = np.where(undecided, np.int32(-1), np.where(take_xor, xor.row, gray.row))
    sigmas = None
    if gray.margin_sigmas is not None and xor.margin_sigmas is not None:
        sigmas = np.where(take_xor, xor.margin_sigmas, gray.margin_sigmas)
    return DecodedCode(
        column=np.where(undecided, np.int32(-1), likely),
        likely_column=likely,
        row=row,
        margin=np.where(take_xor, xor.margin, gray.margin),
        margin_sigmas=sigmas,
        undecided=undecided,
        straight=agree | xor.straight,
        rival_column=np.where(undecided | agree, np.int32(-1), rival),
        at_edge=at_edge,
    )
