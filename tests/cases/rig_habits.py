"""What real cameras, projectors and rooms do that no plan asks for, as changes of pictures.

A habit of the camera or the room takes a raw mosaic (rows, columns), DN, and how many pictures there were
since it began, 0 for the first. One of the projector takes the picture it was sent (rows, columns, 3).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.cases.spoiled_pictures import BLACK_DN, FULL_DN, Mosaic, Spoil, by_colour, counts_of, scaled

Image = NDArray[np.uint8]


def _rng(count: int) -> np.random.Generator:
    return np.random.default_rng((17, count))


def _by_place(pixels: Mosaic, red: float, green: float, blue: float) -> Mosaic:
    """With factors of the light at the places of an RGGB mosaic."""
    gain = np.full(pixels.shape, green)
    gain[::2, ::2], gain[1::2, 1::2] = red, blue
    return scaled(pixels, gain)


def _white_balance(pixels: Mosaic, count: int) -> Mosaic:
    """Automatic: a picture's means are drawn together, half way."""
    light = pixels.astype(np.float64) - BLACK_DN
    red, green, blue = (
        max(float(light[down::2, across::2].mean()), 1.0) for down, across in ((0, 0), (0, 1), (1, 1))
    )
    gains = [float(np.clip((green / other) ** 0.5, 0.6, 1.7)) for other in (red, blue)]
    return _by_place(pixels, gains[0], 1.0, gains[1])


def _auto_exposure(pixels: Mosaic, count: int) -> Mosaic:
    """Automatic: a picture's mean is drawn half way to a fifth of full scale."""
    mean = max(float(pixels.astype(np.float64).mean() - BLACK_DN), 1.0)
    return scaled(pixels, float(np.clip((0.2 * FULL_DN / mean) ** 0.5, 0.5, 2.0)))


def _exposure_ramps(pixels: Mosaic, count: int) -> Mosaic:
    return scaled(pixels, 1 + 0.4 * min(count / 40, 1.0))


def _gamma(pixels: Mosaic, count: int) -> Mosaic:
    return counts_of(FULL_DN * (pixels / FULL_DN) ** (1 / 1.8))


def _banding(pixels: Mosaic, count: int) -> Mosaic:
    """A rolling shutter under a lamp on the mains: rows by ±15 %."""
    rows = np.arange(len(pixels))[:, None] / len(pixels)
    return scaled(pixels, 1 + 0.15 * np.sin(2 * np.pi * (2.3 * rows + _rng(count).random())))


def _passer_by(pixels: Mosaic, count: int) -> Mosaic:
    """Somebody between camera and scene for ten pictures, lit by the room alone."""
    if count >= 10:
        return pixels
    hidden = pixels.copy()
    at = int(pixels.shape[1] * count / 10)
    hidden[:, at : at + pixels.shape[1] // 4] = int(BLACK_DN) + 12
    return hidden


def _spot(shape: tuple[int, ...], light_dn: float) -> NDArray[np.floating]:
    down, across = np.mgrid[: shape[0], : shape[1]]
    away = ((down / shape[0] - 0.2) ** 2 + (across / shape[1] - 0.7) ** 2) / 0.3
    return np.asarray(light_dn * np.exp(-away))


def _lamp_on(pixels: Mosaic, count: int) -> Mosaic:
    return counts_of(pixels + _spot(pixels.shape, 60.0))


def _clouds(pixels: Mosaic, count: int) -> Mosaic:
    share = np.sin(count / 17) + 0.5 * np.sin(count / 5)
    return counts_of(pixels + _spot(pixels.shape, 25.0) * (1.2 + share))


def _hot_pixels(pixels: Mosaic, count: int) -> Mosaic:
    hot = pixels.copy()
    at = _rng(0).random(pixels.shape) < 0.003
    hot[at] = int(FULL_DN)
    return hot


def _smear(pixels: Mosaic, count: int) -> Mosaic:
    """Bright columns leak into all of their rows."""
    return counts_of(pixels + 0.03 * (pixels - BLACK_DN).mean(0, keepdims=True))


def _taps(pixels: Mosaic, count: int) -> Mosaic:
    """The right half of the sensor is read out with other gain and black."""
    changed = pixels.astype(np.float64)
    half = pixels.shape[1] // 2
    changed[:, half:] = BLACK_DN + 6 + 1.08 * (changed[:, half:] - BLACK_DN)
    return counts_of(changed)


def _median(pixels: Mosaic, count: int) -> Mosaic:
    return by_colour(pixels, lambda part: cv2.medianBlur(part, 3))


def _sharpened(pixels: Mosaic, count: int) -> Mosaic:
    return by_colour(pixels, lambda part: 1.8 * part - 0.8 * cv2.GaussianBlur(part, (0, 0), 1.0))


def _black_follows(pixels: Mosaic, count: int) -> Mosaic:
    """A black level that falls with the light on the sensor."""
    return counts_of(pixels - 0.03 * (float(pixels.mean()) - BLACK_DN))


def _mosaic_slips(pixels: Mosaic, count: int) -> Mosaic:
    """A region that begins one column later: red is where green should be."""
    return np.asarray(np.roll(pixels, -1, 1))


def _region_slips(pixels: Mosaic, count: int) -> Mosaic:
    """A region that begins a few columns and rows later."""
    return np.asarray(np.roll(pixels, (-2, -6), (0, 1)))


def _wobbles(pixels: Mosaic, count: int) -> Mosaic:
    """Vibration: half a pixel of each colour's own picture in any direction."""
    down, across = _rng(count).normal(0, 0.25, 2)
    shift = np.array([[1, 0, across], [0, 1, down]], np.float32)
    return by_colour(
        pixels,
        lambda part: cv2.warpAffine(part, shift, part.shape[::-1], borderMode=cv2.BORDER_REPLICATE),
    )


def _zoomed(pixels: Mosaic, count: int) -> Mosaic:
    """A lens, or a digital zoom, that shows 3 % less."""
    return by_colour(
        pixels,
        lambda part: cv2.warpAffine(
            part,
            cv2.getRotationMatrix2D((part.shape[1] / 2, part.shape[0] / 2), 0, 1.03),
            part.shape[::-1],
            borderMode=cv2.BORDER_REPLICATE,
        ),
    )


#: Habits of the camera and of the room.
CAMERA_HABITS: dict[str, Spoil] = {
    "white balance": _white_balance,
    "auto exposure": _auto_exposure,
    "exposure ramps": _exposure_ramps,
    "camera gamma": _gamma,
    "banding": _banding,
    "passer-by": _passer_by,
    "lamp on": _lamp_on,
    "clouds": _clouds,
    "hot pixels": _hot_pixels,
    "smear": _smear,
    "taps": _taps,
    "median filter": _median,
    "sharpened": _sharpened,
    "black follows": _black_follows,
    "mosaic slips": _mosaic_slips,
    "region slips": _region_slips,
    "wobbles": _wobbles,
    "zoomed": _zoomed,
}


def _light(image: NDArray[Any], factor: NDArray[np.floating] | float) -> Image:
    return np.asarray(np.clip(np.rint(image * np.asarray(factor)), 0, 255), np.uint8)


def _colour_wheel(image: Image, count: int) -> Image:
    """Exposures that hold other parts of the wheel each time: colours by ±10 %."""
    return _light(image, 1 - 0.1 * _rng(count).random(3))


def _overscan(image: Image, count: int) -> Image:
    rows, columns = image.shape[:2]
    turn = cv2.getRotationMatrix2D((columns / 2, rows / 2), 0, 1.02)
    return np.asarray(cv2.warpAffine(image, turn, (columns, rows), flags=cv2.INTER_LINEAR), np.uint8)


def _iris(image: Image, count: int) -> Image:
    """Dynamic contrast: darker pictures get less light."""
    return _light(image, 0.6 + 0.4 * min(4 * float(image.mean()) / max(float(image.max()), 1.0), 1.0))


def _projector_gamma(image: Image, count: int) -> Image:
    return _light(255 * (image / 255.0) ** 0.8, 1.0)


def _limited_range(image: Image, count: int) -> Image:
    return _light(16 + image * (219 / 255), 1.0)


def _pixel_shift(image: Image, count: int) -> Image:
    """Every other picture is shown a column to the side."""
    return np.asarray(np.roll(image, count % 2, 1))


def _pointer(image: Image, count: int) -> Image:
    pointed = image.copy()
    rows, columns = image.shape[:2]
    pointed[rows // 2 : rows // 2 + rows // 20, columns // 2 : columns // 2 + columns // 40] = 255
    return pointed


def _menu(image: Image, count: int) -> Image:
    """A box with the name of the input for ten pictures."""
    shown = image.copy()
    if count < 10:
        rows, columns = image.shape[:2]
        shown[rows // 3 : rows // 2, columns // 3 : columns // 2] = 180
    return shown


def _night(image: Image, count: int) -> Image:
    return _light(image, np.array([1.0, 0.85, 0.6]))


def _soft(image: Image, count: int) -> Image:
    """A picture that was scaled down and up again."""
    rows, columns = image.shape[:2]
    small = cv2.resize(image, (columns * 3 // 4, rows * 3 // 4), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR), np.uint8)


#: Habits of the projector.
PROJECTOR_HABITS: dict[str, Callable[[Image, int], Image]] = {
    "colour wheel": _colour_wheel,
    "overscan": _overscan,
    "iris": _iris,
    "projector gamma": _projector_gamma,
    "limited range": _limited_range,
    "pixel shift": _pixel_shift,
    "pointer": _pointer,
    "menu": _menu,
    "night mode": _night,
    "soft": _soft,
}
#: What follows the name of a habit that begins with the scan, so that nothing was ever right.
ALWAYS = " always"
