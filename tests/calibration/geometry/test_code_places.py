"""Places are told as finely as bits can be read; a wide pixel tells the middle of a coarser stripe."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.geometry.code_places import CodePlaces, code_places
from dsl_core.model.calibration.pose_frames import PoseFrames
from dsl_core.model.plan import GrayCode
from tests.cases.code_frames import code_images

PROJECTOR_PX = (128, 96)


def _places(wide: int, first: int = 0) -> tuple[CodePlaces, NDArray[np.float64]]:
    """What pixels tell that each see ``wide`` columns and rows, and the middles of those columns."""
    pictures = []
    for pattern in code_images(GrayCode(), PROJECTOR_PX):
        seen = pattern[: 96 // wide * wide, first : first + (128 - first) // wide * wide]
        rows, columns = seen.shape[0] // wide, seen.shape[1] // wide
        pictures.append(seen.reshape(rows, wide, columns, wide).mean((1, 3)) * 0.8 + 4)
    code = code_places(PoseFrames("pose_0", pictures[:-2], pictures[-2], pictures[-1]), PROJECTOR_PX)
    return code, np.asarray(first + wide * np.arange(code.px.shape[2]) + (wide - 1) / 2, np.float64)


def test_every_bit_that_is_clear_counts() -> None:
    code, columns = _places(1)
    assert np.array_equal(code.px[0, 0], columns)
    assert np.array_equal(code.px[1, :, 0], np.arange(96))
    assert np.allclose(code.std_px, 1 / np.sqrt(12))
    assert code.outside == 0


@pytest.mark.parametrize("first", [0, 1, 3])
def test_a_pixel_as_wide_as_the_finest_stripes_tells_the_coarser_one(first: int) -> None:
    code, columns = _places(4, first)
    off_px = np.abs(code.px[0] - columns)
    assert np.isfinite(off_px).all()
    assert (off_px <= np.sqrt(12) / 2 * code.std_px[0] + 1e-6).all()
    assert code.std_px.max() <= 4 / np.sqrt(12) + 1e-6


def test_a_pixel_of_many_stripes_tells_nothing() -> None:
    code, _ = _places(16)
    assert np.isnan(code.px).all()
