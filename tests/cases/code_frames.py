"""All frames of a binary code at once, encoded and decoded."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsl_core.model.plan import BinaryCode
from dsl_core.patterns.binary_code import binary_image
from dsl_core.patterns.gray_code import DecodedCode, GrayDecoder, frame_count


def code_images(code: BinaryCode, size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Frames of a Gray or XOR code, shape (frames, height, width), 0 or 255; white and black are last."""
    return np.stack([binary_image(code, size_px, i) for i in range(frame_count(code, size_px))])


def decode(
    positive: ArrayLike,
    inverse: ArrayLike,
    spec: BinaryCode,
    size_px: tuple[int, int],
    min_margin: float = 0.0,
) -> DecodedCode:
    """Decode whole stacks, shape (pairs, ...), columns before rows, most significant bit first."""
    decoder = GrayDecoder(spec, size_px)
    for one, other in zip(np.asarray(positive), np.asarray(inverse), strict=True):
        decoder.add(one, other)
    return decoder.finish(min_margin=min_margin)
