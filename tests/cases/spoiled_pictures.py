"""Faults that leave a picture plausible: they begin slowly, touch a part of it, or look like other light.

Each takes a raw mosaic (rows, columns), DN, and how many pictures there were since it began, 0 for the first.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Sensor

Mosaic = NDArray[np.uint16]
Spoil = Callable[[Mosaic, int], Mosaic]
#: Black level and largest count of the twin's camera, DN.
BLACK_DN, FULL_DN = Sensor().black_level_dn, float(Sensor().full_scale_dn)
#: Slow changes are complete after so many pictures.
SLOW = 60


def _share(count: int) -> float:
    """How far a slow change has gone."""
    return min((count + 1) / SLOW, 1.0)


def counts_of(values: NDArray[np.floating]) -> Mosaic:
    """Counts that a camera can deliver, DN."""
    return np.asarray(np.clip(np.rint(values), 0, FULL_DN), np.uint16)


def scaled(pixels: Mosaic, factor: float | NDArray[np.floating]) -> Mosaic:
    """With ``factor`` times the light over black."""
    return counts_of(BLACK_DN + (pixels - BLACK_DN) * factor)


def by_colour(pixels: Mosaic, change: Callable[[NDArray[np.float32]], Any]) -> Mosaic:
    """With each of the four colours of the mosaic changed as a picture of its own."""
    changed = pixels.copy()
    for down in (0, 1):
        for across in (0, 1):
            part = np.ascontiguousarray(pixels[down::2, across::2], np.float32)
            changed[down::2, across::2] = counts_of(change(part))
    return changed


def _unsharp(pixels: Mosaic, count: int) -> Mosaic:
    return by_colour(pixels, lambda part: cv2.GaussianBlur(part, (0, 0), 0.01 + 0.8 * _share(count)))


def _creeps(pixels: Mosaic, count: int) -> Mosaic:
    # Of each colour's own picture: a pixel there is two of the mosaic.
    shift = np.array([[1, 0, _share(count)], [0, 1, 0]], np.float32)
    return by_colour(
        pixels,
        lambda part: cv2.warpAffine(part, shift, part.shape[::-1], borderMode=cv2.BORDER_REPLICATE),
    )


def _turns(pixels: Mosaic, count: int) -> Mosaic:
    def turned(part: NDArray[np.float32]) -> Any:
        rows, columns = part.shape
        turn = cv2.getRotationMatrix2D((columns / 2, rows / 2), 1.5 * _share(count), 1.0)
        return cv2.warpAffine(part, turn, (columns, rows), borderMode=cv2.BORDER_REPLICATE)

    return by_colour(pixels, turned)


def _mist(pixels: Mosaic, count: int) -> Mosaic:
    """Contrast that falls by 30 %, with a veil of what it takes."""
    lost = 0.3 * _share(count)
    light = pixels - BLACK_DN
    return counts_of(BLACK_DN + (1 - lost) * light + 0.5 * lost * light.mean())


def _shadow(pixels: Mosaic, count: int) -> Mosaic:
    """A person between lamp and scene, for ten pictures."""
    if count >= 10:
        return pixels
    at = (np.arange(pixels.shape[1]) / pixels.shape[1] - count / 10) / 0.15
    return scaled(pixels, 1 - 0.7 * np.exp(-(at**2)))


def _jpeg(pixels: Mosaic, count: int) -> Mosaic:
    def lossy(part: NDArray[np.float32]) -> Any:
        coded = cv2.imencode(".jpg", (part / 16).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 60])[1]
        return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), np.float32) * 16

    return by_colour(pixels, lossy)


def _rows_slip(pixels: Mosaic, count: int) -> Mosaic:
    """The rows below the middle by four pixels, as after a packet that was lost."""
    slipped, middle = pixels.copy(), len(pixels) // 2
    slipped[middle:] = np.roll(slipped[middle:], 4, 1)
    return slipped


def _dead_rows(pixels: Mosaic, count: int) -> Mosaic:
    dead = pixels.copy()
    dead[len(pixels) // 3 :: 8] = int(BLACK_DN)
    return dead


def _one_led_fails(pixels: Mosaic, count: int) -> Mosaic:
    dim = pixels.copy()
    dim[::2, ::2] = scaled(pixels[::2, ::2], 0.1)  # red places of RGGB
    return dim


def squared(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture that is up to 3 % narrower further down: automatic keystone correction."""
    rows, columns = image.shape[:2]
    narrow = 1 + 0.03 * (np.arange(rows) / rows)[:, None]
    across = np.rint((np.arange(columns) - columns / 2) * narrow + columns / 2).astype(int)
    return np.ascontiguousarray(image[np.arange(rows)[:, None], np.clip(across, 0, columns - 1)])


#: Faults by name: whether they happen to a single picture, and what they make of it.
SPOILED: dict[str, tuple[bool, Spoil]] = {
    "light 10 % up": (False, lambda p, n: scaled(p, 1.1)),
    "lamp warms up": (False, lambda p, n: scaled(p, 1 - 0.3 * np.exp(-n / 7))),
    "exposure dithers": (False, lambda p, n: scaled(p, 1 + 0.05 * (-1) ** n)),
    "black jumps": (False, lambda p, n: counts_of(p + 16.0)),
    "bit stuck": (False, lambda p, n: np.bitwise_or(p, np.uint16(32))),
    "low bits lost": (False, lambda p, n: np.bitwise_and(p, np.uint16(0xFFF0))),
    "JPEG": (False, _jpeg),
    "dead rows": (False, _dead_rows),
    "rows slip once": (True, _rows_slip),
    "rows slip": (False, _rows_slip),
    "slowly unsharp": (False, _unsharp),
    "creeps": (False, _creeps),
    "turns": (False, _turns),
    "mist": (False, _mist),
    "shadow passes": (False, _shadow),
    "one LED fails": (False, _one_led_fails),
}
