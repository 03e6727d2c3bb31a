"""Mosaics as the sensors of photographic cameras gave them: CR2, CR3, NEF, ARW, DNG and others, by LibRaw."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.extras import names_missing_packages
from dsl_core.model.conditions import BayerPattern

if TYPE_CHECKING:
    from rawpy import RawPy

#: Endings of files with one mosaic each.
SUFFIXES = {
    *(".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dng", ".erf", ".iiq", ".kdc", ".mef", ".mos", ".mrw"),
    *(".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".rwl", ".sr2", ".srf", ".srw", ".x3f"),
}
#: Frames have so many bits: the white level of the camera, whatever its bits, becomes their full scale.
BITS = 16
#: LibRaw's builds are not all safe for files that several threads decode at once.
_lock = threading.Lock()


@names_missing_packages
def read_mosaic(content: bytes, most_px: int) -> NDArray[np.uint16]:
    """The lit part of a sensor (rows, columns), as shares of the white level in `BITS` bits, black included.

    Values stay linear in light. Raises ``ValueError`` where the content is no such file, is damaged, has more
    than ``most_px`` pixels or no mosaic of the Bayer kind, and `MissingPackageError` without rawpy.
    """
    with _opened(content, most_px) as raw:
        _pattern_of(raw)
        values = np.array(raw.raw_image_visible)
        white = int(raw.white_level or 0) or int(values.max(initial=1))
    full = 2**BITS - 1
    return np.asarray(np.rint(np.minimum(values, white) * (full / white)), np.uint16)


@names_missing_packages
def bayer_of(content: bytes, most_px: int) -> BayerPattern:
    """The colours of the mosaic, from its upper left corner; raises as `read_mosaic` does."""
    with _opened(content, most_px) as raw:
        return _pattern_of(raw)


@contextmanager
def _opened(content: bytes, most_px: int) -> Iterator[RawPy]:
    import rawpy

    with _lock:
        try:
            with rawpy.imread(io.BytesIO(content)) as raw:
                if raw.sizes.raw_width * raw.sizes.raw_height > most_px:
                    raise ValueError(f"it claims {raw.sizes.raw_width} x {raw.sizes.raw_height} px")
                yield raw
        except rawpy.LibRawError as error:
            said = error.args[0] if error.args else error
            text = said.decode(errors="replace") if isinstance(said, bytes) else str(said)
            raise ValueError(f"LibRaw says: {text}") from error


def _pattern_of(raw: RawPy) -> BayerPattern:
    import rawpy

    if raw.raw_type != rawpy.RawType.Flat:
        raise ValueError("it has all colours at each pixel")
    if raw.num_colors == 1:
        return "MONO"
    if raw.raw_pattern is None or raw.raw_pattern.shape != (2, 2):
        raise ValueError("its colour filters are not those of Bayer")
    corner = np.array(raw.raw_colors_visible[:2, :2]).ravel()
    letters = "".join(chr(raw.color_desc[colour]) for colour in corner)
    for pattern in ("RGGB", "BGGR", "GRBG", "GBRG"):
        if letters == pattern:
            return pattern
    raise ValueError(f"its colour filters are {letters}")
