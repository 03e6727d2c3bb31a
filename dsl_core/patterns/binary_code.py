"""Binary codes of any kind: what to show, and how it is decoded."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.model.plan import BinaryCode, EnsembleCode, GrayCode, XorCode
from dsl_core.patterns.ensemble_code import EnsembleDecoder, ensemble_image
from dsl_core.patterns.gray_code import DecodedCode, GrayDecoder, code_image
from dsl_core.patterns.xor_code import XorDecoder, xor_image


class CodeDecoder(Protocol):
    """Takes pairs of pattern and inverse in the order of a code, then says what every pixel sees."""

    def add(self, positive: ArrayLike, inverse: ArrayLike, std: ArrayLike | None = None) -> None:
        """Add the next pair; see `GrayDecoder.add`."""

    def finish(self, min_margin: float = 0.0, min_sigmas: float = 0.0) -> DecodedCode:
        """Columns and rows of all pixels; see `GrayDecoder.finish`."""


def binary_image(code: BinaryCode, size_px: tuple[int, int], index: int) -> NDArray[np.uint8]:
    """Frame ``index`` of a code, shape (height, width), 0 or 255; raises `PlanError` outside the code."""
    match code:
        case GrayCode():
            return code_image(code, size_px, index)
        case XorCode():
            return xor_image(code, size_px, index)
        case EnsembleCode():
            return ensemble_image(code, size_px, index)


def decoder_of(code: BinaryCode, size_px: tuple[int, int]) -> CodeDecoder:
    """A fresh decoder for a code on a projector of ``size_px`` = (width, height); raises `PlanError`."""
    match code:
        case GrayCode():
            return GrayDecoder(code, size_px)
        case XorCode():
            return XorDecoder(code, size_px)
        case EnsembleCode():
            return EnsembleDecoder(code, size_px)
