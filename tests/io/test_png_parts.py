"""PNGs whose parts declare more than there is."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.pictures.picture_file import Picture, load_values
from dsl_core.io.png_parts import declares_too_much
from dsl_core.io.published.layout import PngInfo, probe_png

WHOLE = cv2.imencode(".png", np.full((8, 12, 3), 9000, np.uint16))[1].tobytes()
#: Where the first part after the header says how long it is.
LENGTH_AT = 33


def swollen() -> bytes:
    """A part of it says that it is two thousand megabytes long."""
    return WHOLE[:LENGTH_AT] + b"\x7f" + WHOLE[LENGTH_AT + 1 :]


@pytest.mark.parametrize("data", [WHOLE, b"", b"BM", WHOLE[:8], WHOLE[:60]])
def test_what_decoders_can_bear(data: bytes) -> None:
    assert declares_too_much(data) == (data == WHOLE[:60])


def test_a_swollen_part_is_told_before_it_is_decoded(tmp_path: Path) -> None:
    assert declares_too_much(swollen())
    path = tmp_path / "a.png"
    path.write_bytes(swollen())
    assert probe_png(path) == "is damaged: a part of it declares more bytes than it has"
    with pytest.raises(StoreError, match="cannot be decoded"):
        load_values(Picture(path))
    path.write_bytes(WHOLE)
    assert probe_png(path) == PngInfo(12, 8, 16, 3)
