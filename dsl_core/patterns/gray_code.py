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

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import GrayCode


def bit_counts(spec: GrayCode, size_px: tuple[int, int]) -> tuple[int, int]:
    """Column bits and row bits (0 when rows are not coded) for a projector of (width, height) px."""
    width, height = size_px
    if width < 2 or height < 1 or (spec.rows and height < 2):
        raise PlanError(
            f"A Gray code needs a projector of at least 2 x 2 pixels, given {width} x {height}."
            " Correct projector_size_px of the plan."
        )
    return (width - 1).bit_length(), (height - 1).bit_length() if spec.rows else 0


def frame_count(spec: GrayCode, size_px: tuple[int, int]) -> int:
    """Frames of the code including white and black."""
    return 2 * sum(bit_counts(spec, size_px)) + 2


def gray_bit(count: int, bit: int) -> NDArray[np.uint8]:
    """Bit ``bit`` (0 is the least significant) of the Gray code of 0 .. count-1, shape (count,), 0/1."""
    index = np.arange(count)
    return ((index ^ (index >> 1)) >> bit & 1).astype(np.uint8)


def code_image(spec: GrayCode, size_px: tuple[int, int], index: int) -> NDArray[np.uint8]:
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


def code_images(spec: GrayCode, size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """All frames of the code, shape (frames, height, width), 0 or 255; white and black are last."""
    return np.stack([code_image(spec, size_px, i) for i in range(frame_count(spec, size_px))])
