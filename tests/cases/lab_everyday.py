"""What an ordinary day brings to a rig: a monitor beside it, tubes overhead, a flash, a draught, one knock.

Each takes what was right, the picture before it, and how many there were since it began, 0 for the first: raw
mosaics (rows, columns), DN, of the camera, and pictures (rows, columns, 3) sent to the projector.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.cases.lab_mishaps import CameraMishap, ProjectorMishap, as_image
from tests.cases.spoiled_pictures import BLACK_DN, FULL_DN, Mosaic, by_colour, counts_of

Image = NDArray[np.uint8]


def _rng(count: int) -> np.random.Generator:
    return np.random.default_rng((101, count))


def _places(pixels: Mosaic) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows and columns of all pixels as shares of the picture."""
    down, across = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    return down / pixels.shape[0], across / pixels.shape[1]


def _coloured(pixels: Mosaic, red: float, green: float, blue: float) -> NDArray[np.float64]:
    """Factors by the colours of an RGGB mosaic."""
    factor = np.full(pixels.shape, green)
    factor[::2, ::2], factor[1::2, 1::2] = red, blue
    return factor


def _shifted(pixels: Mosaic, across_px: float) -> Mosaic:
    """By so many pixels of the mosaic, sideways."""
    shift = np.array([[1, 0, across_px / 2], [0, 1, 0]], np.float32)
    return by_colour(
        pixels,
        lambda part: cv2.warpAffine(part, shift, part.shape[::-1], borderMode=cv2.BORDER_REPLICATE),
    )


def _monitor(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A monitor at the right: other windows, and another colour, every seven pictures."""
    _, across = _places(pixels)
    red, green, blue = _rng(count // 7).uniform(0.2, 1.0, 3)
    return counts_of(pixels + 30.0 * across**2 * _coloured(pixels, red, green, 1.4 * blue))


def _tubes(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Fluorescent tubes above, and exposures that hold more or less of their flicker each time."""
    down, _ = _places(pixels)
    light = 25.0 * (1 - 0.5 * down) * (1 + 0.3 * np.sin(2.4 * count))
    return counts_of(pixels + light * _coloured(pixels, 0.8, 1.0, 0.6))


def _flash(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Somebody photographs the rig: once, and again 25 pictures later."""
    down, across = _places(pixels)
    return counts_of(pixels + FULL_DN * (0.2 + 0.1 * down + 0.1 * across)) if count % 25 == 0 else pixels


def _knocked_once(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A chair against the table: it swings, and camera and scene come to rest .6 px apart."""
    return _shifted(pixels, 0.6 + 2.5 * (-0.5) ** count)


def _sways(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A leaf in the draught of an air conditioner: the middle of the picture, by up to 1.5 px."""
    down, across = _places(pixels)
    near = np.exp(-((down - 0.5) ** 2 + (across - 0.5) ** 2) / 0.03)
    moved = _shifted(pixels, 1.5 * float(np.sin(0.9 * count)))
    return counts_of(pixels + near * (moved.astype(np.float64) - pixels))


def _wheel_between(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A filter wheel that lost its place: the rim of a yellow filter comes in at the left, and stays."""
    _, across = _places(pixels)
    covered = 1 / (1 + np.exp((across - 0.4 * min((count + 1) / 5, 1.0)) / 0.03))
    lost = covered * (1 - _coloured(pixels, 0.9, 0.8, 0.3))
    return counts_of(BLACK_DN + (1 - lost) * (pixels - BLACK_DN))


def _condensation(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Breath or a cold sample: the upper half of the lens loses its sharpness within forty pictures."""
    down, _ = _places(pixels)
    width = 0.01 + 1.5 * min((count + 1) / 40, 1.0)
    soft = by_colour(pixels, lambda part: cv2.GaussianBlur(part, (0, 0), width))
    upper = 1 / (1 + np.exp((down - 0.4) / 0.05))
    return counts_of(pixels + upper * (soft.astype(np.float64) - pixels))


def _defects_corrected(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A driver that takes pixels brighter than all four of their own colour beside them for defects."""

    def corrected(part: NDArray[np.float32]) -> NDArray[np.float32]:
        beside = np.stack([np.roll(part, at, axis) for at in (-1, 1) for axis in (0, 1)])
        return np.where(part > 1.1 * beside.max(0) + 4, beside.mean(0), part)

    return by_colour(pixels, corrected)


def _red_for_blue(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A region that begins a column and a row later: green stays green."""
    return np.asarray(np.roll(pixels, (-1, -1), (0, 1)))


def _dark_taken_in_light(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A driver subtracts its dark picture, which was taken while the room was lit."""
    down, across = _places(pixels)
    return counts_of(pixels - 20.0 * np.exp(-((down - 0.4) ** 2 + (across - 0.6) ** 2) / 0.1))


def _counter_in_picture(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A camera that writes time, gain and a counter into the first forty pixels of its picture."""
    marked = pixels.copy()
    marked[0, :40] = _rng(count).integers(0, int(FULL_DN) + 1, marked[0, :40].shape)
    return marked


#: Of the camera, the light and the room.
CAMERA_EVERYDAY: dict[str, CameraMishap] = {
    "monitor beside": _monitor,
    "tubes": _tubes,
    "flash": _flash,
    "knocked once": _knocked_once,
    "leaf sways": _sways,
    "wheel between": _wheel_between,
    "condensation": _condensation,
    "defects corrected": _defects_corrected,
    "red for blue": _red_for_blue,
    "dark in light": _dark_taken_in_light,
    "counter in picture": _counter_in_picture,
}


def _blended(image: Image, before: Image, count: int) -> Image:
    """Sixty pictures a second from fifty: every sixth is half the one before."""
    return as_image((image + before.astype(np.float64)) / 2) if count % 6 == 2 else image


def _beats(image: Image, before: Image, count: int) -> Image:
    """A colour wheel a little out of step with the exposure: its colours swell and fade in turn by 6 %."""
    phase = 2 * np.pi * (count / 23 + np.arange(3) / 3)
    return as_image(image * (0.94 + 0.06 * np.sin(phase)))


def _contrast_by_content(image: Image, before: Image, count: int) -> Image:
    """Dynamic gamma: dark pictures are stretched, bright ones are left alone."""
    full = max(float(image.max()), 1.0)
    power = 0.85 + 0.15 * min(2 * float(image.mean()) / full, 1.0)
    return as_image(255 * (image / 255.0) ** power)


#: Of the projector and of the computer that sends it pictures.
PROJECTOR_EVERYDAY: dict[str, ProjectorMishap] = {
    "blended at times": _blended,
    "wheel beats": _beats,
    "contrast by content": _contrast_by_content,
}
