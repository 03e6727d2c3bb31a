"""What goes wrong in a laboratory unasked: other programs on the screen, cameras that improve, heat, dust.

Each takes what was right, the picture before it, and how many there were since it began, 0 for the first: raw
mosaics (rows, columns), DN, of the camera, and pictures (rows, columns, 3) sent to the projector.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.cases.spoiled_pictures import BLACK_DN, FULL_DN, SLOW, Mosaic, by_colour, counts_of, scaled

Image = NDArray[np.uint8]
CameraMishap = Callable[[Mosaic, Mosaic, int], Mosaic]
ProjectorMishap = Callable[[Image, Image, int], Image]


def _rng(count: int) -> np.random.Generator:
    return np.random.default_rng((29, count))


def _slowly(count: int) -> float:
    return min((count + 1) / SLOW, 1.0)


def _denoised(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A camera that takes noise away by what was there before."""
    return counts_of(0.75 * pixels + 0.25 * before)


def _interlaced(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    mixed = pixels.copy()
    for down in (2, 3):  # whole rows of the mosaic's cells
        mixed[down::4] = before[down::4]
    return mixed


def _tears_at_times(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Every eighth picture or so; the slow shutter of the rest hides it."""
    rng = _rng(count)
    if rng.random() > 1 / 8:
        return pixels
    row = int(rng.uniform(0.05, 0.95) * len(pixels))
    return np.concatenate([before[:row], pixels[row:]])


def _mosaic_slips_a_row(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    return np.asarray(np.roll(pixels, -1, 0))


def _bytes_swapped(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    return pixels.byteswap()


def _two_bits_high(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    return np.asarray(pixels << 2, np.uint16)


def _channel_dead(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    dead = pixels.copy()
    dead[1::2, 1::2] = int(BLACK_DN)
    return dead


def _gets_hot(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Dark current and its noise, more in some pixels than in others."""
    shape, share = pixels.shape, _slowly(count)
    dark = share * 15.0 * _rng(0).gamma(1.0, 1.0, shape)
    return counts_of(pixels + _rng(count + 1).normal(dark, np.sqrt(dark)))


def _black_cut(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """An offset so low that dark pixels are zero, and noise with them."""
    return counts_of(pixels - (BLACK_DN + 8))


def _full_early(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Wells are full before the converter is."""
    return np.minimum(pixels, np.uint16(0.35 * FULL_DN))


def _ghost(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A filter or a window that was put before the lens: a mirrored picture of 6 %."""
    light = pixels - BLACK_DN
    return counts_of(BLACK_DN + 0.94 * light + 0.06 * light[::-1, ::-1])


def _dust(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Specks on the sensor's window, of which a fan blows one away and brings others."""
    shadow = np.ones(pixels.shape)
    for down, across in _rng(1).random((6, 2)):
        at = int(down * pixels.shape[0]), int(across * pixels.shape[1])
        shadow[at[0] : at[0] + 3, at[1] : at[1] + 3] = 0.6
    return scaled(pixels, shadow)


def _shading_corrected(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    down, across = np.mgrid[-1 : 1 : pixels.shape[0] * 1j, -1 : 1 : pixels.shape[1] * 1j]
    return scaled(pixels, 1 + 0.12 * (down**2 + across**2))


def _tones_mapped(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Dark parts are lifted, bright ones are not."""

    def mapped(part: NDArray[np.float32]) -> Any:
        around = cv2.GaussianBlur(part, (0, 0), 4.0) - BLACK_DN
        return BLACK_DN + (part - BLACK_DN) * (1 + 0.5 / (1 + np.maximum(around, 0) / 300))

    return by_colour(pixels, mapped)


def _focus_hunts(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    width = max(0.0, float(np.sin(count / 4))) + 0.01
    return by_colour(pixels, lambda part: cv2.GaussianBlur(part, (0, 0), width))


def _lamp_dims(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    return scaled(pixels, 1 - 0.1 * _slowly(count))


def _lamp_changes_colour(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    gain = np.ones(pixels.shape)
    gain[::2, ::2], gain[1::2, 1::2] = 1 + 0.08 * _slowly(count), 1 - 0.08 * _slowly(count)
    return scaled(pixels, gain)


def _lamp_flickers(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    return scaled(pixels, 1 + 0.1 * _rng(count).uniform(-1, 1))


def _gain_for_noise(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Shorter exposure and more gain: the same light, with three times the noise."""
    light = np.maximum(pixels - BLACK_DN, 0)
    return counts_of(pixels + _rng(count).normal(0, np.sqrt(light / 1.0 + 30)))


def _smoke(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A puff of steam before a part of the scene."""
    across = np.arange(pixels.shape[1]) / pixels.shape[1]
    lost = 0.35 * np.exp(-(((across - 0.5) / 0.2) ** 2)) * np.exp(-(((count - 12) / 8) ** 2))
    light = pixels - BLACK_DN
    return counts_of(BLACK_DN + (1 - lost) * light + 0.3 * lost * light.mean())


#: Of the camera, the light and the room.
CAMERA_MISHAPS: dict[str, CameraMishap] = {
    "denoised in time": _denoised,
    "interlaced": _interlaced,
    "tears at times": _tears_at_times,
    "mosaic slips a row": _mosaic_slips_a_row,
    "bytes swapped": _bytes_swapped,
    "two bits high": _two_bits_high,
    "channel dead": _channel_dead,
    "gets hot": _gets_hot,
    "black cut": _black_cut,
    "full early": _full_early,
    "ghost": _ghost,
    "dust": _dust,
    "shading corrected": _shading_corrected,
    "tones mapped": _tones_mapped,
    "focus hunts": _focus_hunts,
    "lamp dims": _lamp_dims,
    "lamp changes colour": _lamp_changes_colour,
    "lamp flickers": _lamp_flickers,
    "gain for noise": _gain_for_noise,
    "smoke": _smoke,
}


def as_image(values: NDArray[np.floating]) -> Image:
    """Drive levels of any value, as a projector takes them."""
    return np.asarray(np.clip(np.rint(values), 0, 255), np.uint8)


def _vivid(image: Image, before: Image, count: int) -> Image:
    """Colours apart from their mean, and an S for a curve."""
    values = image / 255.0
    grey = values.mean(2, keepdims=True)
    values = np.clip(grey + 1.4 * (values - grey), 0, 1)
    return as_image(255 * (values + 0.25 * values * (1 - values) * (2 * values - 1) * 2))


def _dusk(image: Image, before: Image, count: int) -> Image:
    """Desktops turn warmer in the evening, slowly."""
    return as_image(image * (1 - _slowly(count) * np.array([0.0, 0.15, 0.4])))


def _notification(image: Image, before: Image, count: int) -> Image:
    """In the lower right corner, for six pictures out of thirty."""
    shown = image.copy()
    rows, columns = image.shape[:2]
    if count % 30 < 6:
        shown[rows * 4 // 5 : rows * 19 // 20, columns * 3 // 4 : columns * 49 // 50] = (40, 90, 200)
    return shown


def _taskbar(image: Image, before: Image, count: int) -> Image:
    shown = image.copy()
    shown[-len(image) // 12 :] = 60
    return shown


def _screensaver(image: Image, before: Image, count: int) -> Image:
    shown = np.zeros_like(image)
    rows, columns = image.shape[:2]
    down, across = (count * 7) % max(rows * 3 // 4, 1), (count * 11) % max(columns * 3 // 4, 1)
    shown[down : down + rows // 5, across : across + columns // 5] = (200, 120, 40)
    return shown


def _no_sync(image: Image, before: Image, count: int) -> Image:
    """The upper part is the picture before, to another row each time, in some pictures."""
    if count % 3:
        return image
    row = int(_rng(count).uniform(0.1, 0.9) * len(image))
    return np.concatenate([before[:row], image[row:]])


def _smoothed(image: Image, before: Image, count: int) -> Image:
    """Pictures between pictures: some light of the one before."""
    return as_image(0.8 * image + 0.2 * before.astype(np.float64))


def _resized(image: Image, before: Image, count: int) -> Image:
    """Another resolution: everything is 10 % larger, and cut off."""
    rows, columns = image.shape[:2]
    large = cv2.resize(image, None, fx=1.1, fy=1.1, interpolation=cv2.INTER_LINEAR)
    down, across = (large.shape[0] - rows) // 2, (large.shape[1] - columns) // 2
    return np.ascontiguousarray(large[down : down + rows, across : across + columns])


def _one_led(image: Image, before: Image, count: int) -> Image:
    dark = image.copy()
    dark[..., 0] = 0
    return dark


def _dead_columns(image: Image, before: Image, count: int) -> Image:
    dead = image.copy()
    columns = image.shape[1]
    dead[:, columns * 2 // 5 : columns * 2 // 5 + max(columns // 60, 2)] = 0
    return dead


def _room_sensor(image: Image, before: Image, count: int) -> Image:
    """Brightness that follows a sensor of the room's light, in steps."""
    return as_image(image * (1 - 0.08 * ((count // 15) % 3)))


def _upside_down(image: Image, before: Image, count: int) -> Image:
    """Mounted for the ceiling: both ways round."""
    return np.ascontiguousarray(image[::-1, ::-1])


#: Of the projector and of the computer that sends it pictures.
PROJECTOR_MISHAPS: dict[str, ProjectorMishap] = {
    "vivid": _vivid,
    "dusk": _dusk,
    "notification": _notification,
    "taskbar": _taskbar,
    "screensaver": _screensaver,
    "no sync": _no_sync,
    "smoothed": _smoothed,
    "resized": _resized,
    "one LED": _one_led,
    "dead columns": _dead_columns,
    "room sensor": _room_sensor,
    "ceiling": _upside_down,
}
