"""The Gray code survives the film, says when it is unsure, and decodes real captures as OpenCV does."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.plan import GrayCode
from dsl_core.patterns.gray_code import GrayDecoder, lit_mask
from tests.cases.code_frames import code_images, decode

SHARED = Path(os.environ.get("DSL_SHARED", Path(__file__).parents[3] / "shared"))
CAPTURES = SHARED / "data" / "procam_checkerboard" / "half_res"


def test_round_trip_of_every_projector_pixel() -> None:
    size = (640, 360)
    images = code_images(GrayCode(), size)
    found = decode(images[0:38:2], images[1:38:2], GrayCode(), size)
    rows, columns = np.indices((360, 640))
    assert not found.undecided.any()
    assert found.column.dtype == np.int32
    np.testing.assert_array_equal(found.column, columns)
    np.testing.assert_array_equal(found.row, rows)
    np.testing.assert_array_equal(found.margin, 255)


def test_columns_only_has_no_rows() -> None:
    images = code_images(GrayCode(rows=False), (37, 4))
    found = decode(images[0:12:2], images[1:12:2], GrayCode(rows=False), (37, 4))
    assert found.row is None
    np.testing.assert_array_equal(found.column, np.tile(np.arange(37), (4, 1)))


def test_first_orders_do_not_flip_a_bit() -> None:
    """Two first orders at 20 % each reach every pixel, over three decades of albedo (Eqs. 4-8)."""
    size = (640, 360)
    rng = np.random.default_rng(5)
    images = code_images(GrayCode(rows=False), size)[:, 0].astype(float) / 255
    albedo = 10.0 ** rng.uniform(-3, 0, 640)
    seen = albedo * (images + 0.2 * np.roll(images, 130, axis=1) + 0.2 * np.roll(images, -130, axis=1))
    found = decode(seen[0:20:2], seen[1:20:2], GrayCode(rows=False), size)
    np.testing.assert_array_equal(found.column, np.arange(640))
    np.testing.assert_array_less(0.599 * albedo, found.margin)


def test_margin_names_the_weakest_bit_and_sigmas_follow_the_noise() -> None:
    decoder = GrayDecoder(GrayCode(rows=False), (8, 1))
    for positive, inverse, std in (([9, 1], [1, 9], 2.0), ([1, 7], [4, 1], 0.5), ([8, 1], [0, 2], 2.0)):
        decoder.add(np.array(positive, np.uint16), np.array(inverse, np.uint16), std)
    found = decoder.finish()
    np.testing.assert_array_equal(found.column, [0b110, 0b011])  # Gray 101 and 010
    np.testing.assert_array_equal(found.margin, [3, 1])
    assert found.margin_sigmas is not None
    np.testing.assert_array_equal(found.margin_sigmas, [4, 0.5])
    np.testing.assert_array_equal(decoder.finish(min_margin=2).column, [6, -1])
    np.testing.assert_array_equal(decoder.finish(min_sigmas=4.5).undecided, [True, True])


@pytest.mark.parametrize("bad", [0.0, np.nan])
def test_ties_and_missing_values_stay_undecided(bad: float) -> None:
    images = code_images(GrayCode(), (8, 8))[:12].astype(float)
    images[4, 3, 3] = images[5, 3, 3] = bad
    found = decode(images[0::2], images[1::2], GrayCode(), (8, 8))
    assert found.row is not None
    assert np.argwhere(found.undecided).tolist() == [[3, 3]]
    assert found.column[3, 3] == found.row[3, 3] == -1


def test_codes_outside_the_projector_stay_undecided() -> None:
    images = code_images(GrayCode(rows=False), (1024, 1))[:20]
    found = decode(images[0::2], images[1::2], GrayCode(rows=False), (640, 1))
    np.testing.assert_array_equal(found.undecided[0], np.arange(1024) >= 640)


def test_wrong_pairs_are_refused() -> None:
    decoder = GrayDecoder(GrayCode(rows=False), (4, 1))
    with pytest.raises(DecodeError, match="0 of 2"):
        decoder.finish()
    with pytest.raises(DecodeError, match="its inverse"):
        decoder.add(np.zeros(3), np.zeros(4))
    decoder.add(np.ones(3), np.zeros(3))
    with pytest.raises(DecodeError, match="pairs before it"):
        decoder.add(np.ones(4), np.zeros(4))
    with pytest.raises(DecodeError, match="with none"):
        decoder.add(np.ones(3), np.zeros(3), std=1.0)
    decoder.add(np.ones(3), np.zeros(3))
    with pytest.raises(DecodeError, match="one more"):
        decoder.add(np.ones(3), np.zeros(3))


def test_shadow_is_where_white_is_not_brighter() -> None:
    mask = lit_mask(np.array([10, 4, 3], np.uint16), np.array([1, 5, 1], np.uint16), 2)
    np.testing.assert_array_equal(mask, [True, False, False])


@pytest.fixture(scope="module")
def pose() -> NDArray[np.uint8]:
    """The 42 images of the first real pose, shape (42, 512, 640)."""
    cv2 = pytest.importorskip("cv2")
    folder = CAPTURES / "capture_0"
    if not folder.is_dir():
        pytest.skip(f"real captures are not here: {folder} (set DSL_SHARED)")
    return np.stack([cv2.imread(str(folder / f"graycode_{i:02d}.png"), 0) for i in range(42)])


@pytest.mark.parametrize("threshold", [5, 0])
def test_real_captures_decode_as_opencv_does(pose: NDArray[np.uint8], threshold: int) -> None:
    """Same columns, rows and undecided pixels as getProjPixel on one pixel in 60, threshold for threshold."""
    cv2 = pytest.importorskip("cv2")
    theirs = cv2.structured_light.GrayCodePattern.create(1024, 768)
    theirs.setWhiteThreshold(threshold)
    frames = list(pose[:40])
    found = decode(pose[0:40:2], pose[1:40:2], GrayCode(), (1024, 768), min_margin=threshold)
    assert found.row is not None
    compared = 0
    for index in range(0, 512 * 640, 61):
        y, x = divmod(index, 640)
        failed, point = theirs.getProjPixel(frames, x, y)
        if failed:
            assert found.undecided[y, x]
        elif not found.undecided[y, x]:
            assert (found.column[y, x], found.row[y, x]) == point
            compared += 1
    assert compared > 2000
