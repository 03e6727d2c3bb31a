"""Encoded pictures as arrays: by OpenCV, and TIFF of kinds that it does not decode by Pillow.

These are some compressions, such as ZSTD and LZMA, and 8 bits in tiles that reach over the edge.
"""

from __future__ import annotations

import io
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.pictures.heads import Head

#: Pillow's modes whose values are those of the file, and the bits that they have there. Colours of more bits
#: are cut down to 8 by it without a word.
_BITS = {"L": 8, "RGB": 8, "I;16": 16, "I;16B": 16, "F": 32}


def decode(data: bytes, page: int | None, head: Head | None) -> NDArray[Any] | None:
    """A picture, or a page of a file: (rows, columns), or (rows, columns, 3 or 4) in the order B, G, R, A.

    ``head`` is what the file says of that page. None where nothing can decode it.
    """
    found = _by_opencv(np.frombuffer(data, np.uint8), page)
    return _by_pillow(data, page or 0, head) if found is None and head is not None else found


def _by_opencv(stored: NDArray[np.uint8], page: int | None) -> NDArray[Any] | None:
    import cv2

    # It prints to the terminal what it cannot decode; whoever asks for the picture says so.
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        if page is None:
            return cv2.imdecode(stored, cv2.IMREAD_UNCHANGED)
        pages = cv2.imdecodemulti(stored, cv2.IMREAD_UNCHANGED, None, (page, page + 1))[1]
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(level)
    return pages[0] if pages else None


def _by_pillow(data: bytes, page: int, head: Head) -> NDArray[Any] | None:
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data)) as picture:
                picture.seek(page)
                if _BITS.get(picture.mode) != head.bits:
                    return None
                values = np.array(picture)
    except (OSError, EOFError, ValueError, SyntaxError, TypeError, LookupError, Image.DecompressionBombError):
        return None
    return values[..., ::-1] if values.ndim == 3 else values.astype(values.dtype.newbyteorder("="))
