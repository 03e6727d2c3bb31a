"""XOR codes have fine stripes only, decode exactly, and survive light that breaks Gray codes."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.plan import GrayCode, XorCode
from dsl_core.patterns.gray_code import DecodedCode, GrayDecoder
from dsl_core.patterns.xor_code import XorDecoder
from tests.cases.code_frames import code_images

SIZE = (640, 360)
COLUMNS = GrayCode(rows=False)
FINE = XorCode(rows=False, base_px=2)
BaseWidth = Literal[2, 4]


def decode(
    frames: NDArray[np.uint8] | NDArray[np.float64], decoder: XorDecoder | GrayDecoder, pairs: int
) -> DecodedCode:
    for positive, inverse in zip(frames[0 : 2 * pairs : 2], frames[1 : 2 * pairs : 2], strict=True):
        decoder.add(positive, inverse)
    return decoder.finish()


def widest_stripe_px(line: NDArray[np.uint8]) -> int:
    edges = np.flatnonzero(np.diff(line.astype(int))) + 1
    return int(np.diff([0, *edges, len(line)]).max())


@pytest.mark.parametrize("base_px", [2, 4])
@pytest.mark.parametrize("size", [SIZE, (37, 20)])
def test_round_trip_of_every_projector_pixel(base_px: BaseWidth, size: tuple[int, int]) -> None:
    code = XorCode(base_px=base_px)
    images = code_images(code, size)
    found = decode(images, XorDecoder(code, size), len(images) // 2 - 1)
    rows, columns = np.indices(size[::-1])
    assert not found.undecided.any()
    np.testing.assert_array_equal(found.column, columns)
    np.testing.assert_array_equal(found.likely_column, columns)
    np.testing.assert_array_equal(found.row, rows)


@pytest.mark.parametrize("base_px", [2, 4])
def test_stripes_are_fine(base_px: BaseWidth) -> None:
    images = code_images(XorCode(base_px=base_px), SIZE)
    np.testing.assert_array_equal(images[-2:], np.stack([np.full(SIZE[::-1], 255), np.zeros(SIZE[::-1])]))
    assert max(widest_stripe_px(image[0]) for image in images[:20]) <= 2 * base_px
    assert max(widest_stripe_px(image[:, 0]) for image in images[20:38]) <= 2 * base_px
    assert widest_stripe_px(code_images(GrayCode(), SIZE)[0, 0]) == 512


def test_interreflection_breaks_gray_but_not_xor() -> None:
    """60 % of the light of a pixel comes from 200 columns further on, smeared over 41 columns."""
    smear = np.ones(41) / 41

    def seen(images: NDArray[np.uint8]) -> NDArray[np.float64]:
        lines = images[:, 0].astype(float)
        far = np.stack([np.convolve(np.roll(line, -200), smear, "same") for line in lines])
        return np.asarray(0.4 * lines + 0.6 * far)[:, 50:400]

    gray = decode(seen(code_images(COLUMNS, SIZE)), GrayDecoder(COLUMNS, SIZE), 10)
    xor = decode(seen(code_images(FINE, SIZE)), XorDecoder(FINE, SIZE), 10)
    np.testing.assert_array_equal(xor.column, np.arange(50, 400))
    assert xor.row is None
    assert (gray.column != np.arange(50, 400)).mean() > 0.3


def test_undecided_and_outside_stay_marked() -> None:
    code = XorCode(rows=False)
    images = code_images(code, (1024, 1))[:20].astype(float)
    images[4, 0, 9] = images[5, 0, 9] = np.nan
    found = decode(images, XorDecoder(code, SIZE), 10)
    expected = np.arange(1024) >= 640
    expected[9] = True
    np.testing.assert_array_equal(found.undecided[0], expected)
    np.testing.assert_array_equal(found.column[0], np.where(expected, -1, np.arange(1024)))


def test_too_small_for_the_base() -> None:
    with pytest.raises(PlanError, match="more than 4 columns"):
        code_images(XorCode(), (640, 2))
