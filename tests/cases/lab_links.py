"""What devices do behind their connections: restart with their own settings, hold pictures back, run freely.

Each takes all pictures that were right since it began, the latest last: raw mosaics (rows, columns), DN, of
the camera, and pictures (rows, columns, 3) sent to the projector.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.cases.spoiled_pictures import BLACK_DN, Mosaic, counts_of

Image = NDArray[np.uint8]
CameraLink = Callable[[Sequence[Mosaic]], Mosaic]
ProjectorLink = Callable[[Sequence[Image]], Image]


def _two_held(pictures: Sequence[Mosaic]) -> Mosaic:
    """A driver that keeps two buffers filled: pictures come two late, numbered anew."""
    return pictures[max(len(pictures) - 3, 0)]


def _runs_freely(pictures: Sequence[Mosaic]) -> Mosaic:
    """The trigger is off after a restart: exposures begin while the pattern before is still shown."""
    before = pictures[max(len(pictures) - 2, 0)]
    share = (0.37 * len(pictures)) % 1.0
    return counts_of((1 - share) * pictures[-1] + share * before)


def _own_gain(pictures: Sequence[Mosaic]) -> Mosaic:
    """Gain and black level as the maker leaves them."""
    return counts_of(BLACK_DN + 24.0 + 1.6 * (pictures[-1] - float(BLACK_DN)))


def _ten_bits(pictures: Sequence[Mosaic]) -> Mosaic:
    """Another pixel format that the driver still fills up to the bits that were promised."""
    return np.asarray(pictures[-1] // 4 * 4, np.uint16)


def _misses_triggers(pictures: Sequence[Mosaic]) -> Mosaic:
    """Every ninth trigger is lost, and the picture before comes once more with a new number."""
    return pictures[-2] if len(pictures) % 9 == 5 else pictures[-1]


#: Of the camera.
CAMERA_LINKS: dict[str, CameraLink] = {
    "two held back": _two_held,
    "runs freely": _runs_freely,
    "own gain": _own_gain,
    "ten bits": _ten_bits,
    "misses triggers": _misses_triggers,
}


def _half_the_rate(images: Sequence[Image]) -> Image:
    """A link at half the rate: every other picture is never shown."""
    return images[len(images) - 1 - (len(images) - 1) % 2]


def _another_size(images: Sequence[Image]) -> Image:
    """A link with three quarters of the columns and rows, which the projector enlarges again."""
    rows, columns = images[-1].shape[:2]
    small = cv2.resize(images[-1], (3 * columns // 4, 3 * rows // 4), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR), np.uint8)


def _narrower(images: Sequence[Image]) -> Image:
    """A link with another shape of picture: 4:3 in the middle, black beside it."""
    rows, columns = images[-1].shape[:2]
    narrow = cv2.resize(images[-1], (3 * columns // 4, rows), interpolation=cv2.INTER_AREA)
    image = np.zeros_like(images[-1])
    left = (columns - narrow.shape[1]) // 2
    image[:, left : left + narrow.shape[1]] = narrow
    return image


def _half_the_colours(images: Sequence[Image]) -> Image:
    """A link that saves bandwidth: one colour for two columns (4:2:2)."""
    space = cv2.cvtColor(images[-1], cv2.COLOR_RGB2YCrCb)
    space[:, 1::2, 1:] = space[:, : space.shape[1] // 2 * 2 : 2, 1:]
    return np.asarray(cv2.cvtColor(space, cv2.COLOR_YCrCb2RGB), np.uint8)


#: Of the projector.
PROJECTOR_LINKS: dict[str, ProjectorLink] = {
    "half the rate": _half_the_rate,
    "another link": _another_size,
    "narrower link": _narrower,
    "half the colours": _half_the_colours,
}
