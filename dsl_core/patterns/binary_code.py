"""Binary codes of any kind: what to show, and how it is decoded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.model.plan import BinaryCode
from dsl_core.patterns.ensemble_code import EnsembleDecoder, ensemble_image
from dsl_core.patterns.gray_code import DecodedCode, GrayDecoder, code_image
from dsl_core.patterns.xor_code import XorDecoder, xor_image


class CodeDecoder(Protocol):
    """Takes pairs of pattern and inverse in the order of a code, then says what every pixel sees."""

    def add(self, positive: ArrayLike, inverse: ArrayLike, std: ArrayLike | None = None) -> None:
        """Add the next pair; see `GrayDecoder.add`."""

    def finish(self, min_margin: float = 0.0, min_sigmas: float = 0.0) -> DecodedCode:
        """Columns and rows of all pixels; see `GrayDecoder.finish`."""


#: How each kind of code is drawn, and what decodes it.
_KINDS: dict[str, tuple[Callable[..., NDArray[np.uint8]], Callable[..., CodeDecoder]]] = {
    "gray": (code_image, GrayDecoder),
    "xor": (xor_image, XorDecoder),
    "ensemble": (ensemble_image, EnsembleDecoder),
}


def binary_image(code: BinaryCode, size_px: tuple[int, int], index: int) -> NDArray[np.uint8]:
    """Frame ``index`` of a code, shape (height, width), 0 or 255; raises `PlanError` outside the code."""
    return _KINDS[code.kind][0](code, size_px, index)


def stripes_across(code: BinaryCode, size_px: tuple[int, int], index: int) -> NDArray[np.bool_] | None:
    """Which columns of the projector a pattern lights; None for one that codes rows.

    Raises `PlanError`.
    """
    image = binary_image(code, size_px, index)
    return None if (image != image[:1]).any() else image[0] > 0


def decoder_of(code: BinaryCode, size_px: tuple[int, int]) -> CodeDecoder:
    """A fresh decoder for a code on a projector of ``size_px`` = (width, height); raises `PlanError`."""
    return _KINDS[code.kind][1](code, size_px)
