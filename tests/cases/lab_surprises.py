"""What consumer projectors and cameras, cables and tables do in the middle of a scan, and mostly undo again.

Each takes what was right, the picture before it, and how many there were since it began, 0 for the first: raw
mosaics (rows, columns), DN, of the camera, and pictures (rows, columns, 3) sent to the projector.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.cases.lab_mishaps import CameraMishap, ProjectorMishap, as_image
from tests.cases.spoiled_pictures import BLACK_DN, Mosaic, by_colour, counts_of, scaled

Image = NDArray[np.uint8]
#: Pictures of which less than this share of their brightest level is lit are dark to a projector.
DARK = 0.1


def _rng(count: int) -> np.random.Generator:
    return np.random.default_rng((43, count))


def _stale_band(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """In every fifth picture, packets that were lost leave an eighth of the rows as they were before."""
    if count % 5:
        return pixels
    mixed, height = pixels.copy(), len(pixels) // 16 * 2
    at = int(_rng(count).uniform(0.2, 0.7) * len(pixels)) // 2 * 2
    mixed[at : at + height] = before[at : at + height]
    return mixed


def _packet_twice(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """In every fifth picture, four rows come twice, and those below them later."""
    if count % 5:
        return pixels
    at = int(_rng(count).uniform(0.2, 0.7) * len(pixels)) // 2 * 2
    return np.concatenate([pixels[: at + 4], pixels[at:-4]])


def _knocks(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Somebody hits the table every thirty pictures: it swings by up to 3 px, and back within six."""
    since = count % 30
    across = 1.5 * (-0.6) ** since if since < 6 else 0.0
    shift = np.array([[1, 0, across], [0, 1, 0]], np.float32)
    return by_colour(
        pixels,
        lambda part: cv2.warpAffine(part, shift, part.shape[::-1], borderMode=cv2.BORDER_REPLICATE),
    )


def _sinks(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A tripod that sinks: 2 px down within sixty pictures, along the lines."""
    shift = np.array([[1, 0, 0], [0, 1, min((count + 1) / 60, 1.0)]], np.float32)

    def lower(part: NDArray[np.float32]) -> Any:
        return cv2.warpAffine(part, shift, part.shape[::-1], borderMode=cv2.BORDER_REPLICATE)

    return by_colour(pixels, lower)


def _target_slips(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """An object in the middle of the view that slips by 2 px at once; its surroundings do not."""
    rows, columns = pixels.shape
    slipped, down, across = (
        pixels.copy(),
        slice(rows // 3, rows * 2 // 3),
        slice(columns // 3, columns * 2 // 3),
    )
    slipped[down, across] = np.roll(pixels, 2, 1)[down, across]
    return slipped


def _sun(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Between clouds: light on a part of the scene that comes and goes within a picture."""
    if count % 20 >= 8:
        return pixels
    down, across = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    lit = (down / pixels.shape[0] > 0.5) & (across / pixels.shape[1] > 0.4)
    return counts_of(pixels + 80.0 * lit)


def _balance_follows(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """White balance that is set by the picture before."""
    light = before.astype(np.float64) - BLACK_DN
    red, green, blue = (
        max(float(light[down::2, across::2].mean()), 1.0) for down, across in ((0, 0), (0, 1), (1, 1))
    )
    gain = np.ones(pixels.shape)
    gain[::2, ::2], gain[1::2, 1::2] = (np.clip((green / other) ** 0.3, 0.7, 1.5) for other in (red, blue))
    return scaled(pixels, gain)


#: Of the camera, its cable, the table and the room.
CAMERA_SURPRISES: dict[str, CameraMishap] = {
    "stale band": _stale_band,
    "packet twice": _packet_twice,
    "knocks": _knocks,
    "sinks": _sinks,
    "target slips": _target_slips,
    "sun": _sun,
    "balance follows": _balance_follows,
}


def _is_dark(image: Image) -> bool:
    return float(image.mean()) < DARK * max(float(image.max()), 1.0)


def _eco(image: Image, before: Image, count: int) -> Image:
    """A lamp that saves power on dark pictures, and gives all again with the first bright one."""
    return as_image(image * 0.9) if _is_dark(image) and _is_dark(before) else image


def _eco_wakes(image: Image, before: Image, count: int) -> Image:
    """The same, but bright pictures after dark ones come before the lamp is up."""
    return as_image(image * 0.9) if _is_dark(before) else image


def _range_toggles(image: Image, before: Image, count: int) -> Image:
    """A cable whose ends agree anew on full or limited levels now and then."""
    return as_image(16 + image * (219 / 255)) if count % 25 < 8 else image


def _power_limit(image: Image, before: Image, count: int) -> Image:
    """Bright pictures get less light, so that the supply keeps up."""
    return as_image(image * (1 - 0.12 * float(image.mean()) / max(float(image.max()), 1.0)))


def _overdrive(image: Image, before: Image, count: int) -> Image:
    """Levels that are overshot for speed, by what changed since the picture before."""
    return as_image(image + 0.2 * (image.astype(np.float64) - before))


def _no_signal(image: Image, before: Image, count: int) -> Image:
    """A blue picture for two frames whenever the cable is shaken."""
    if count % 40 >= 2:
        return image
    blue = np.zeros_like(image)
    blue[..., 2] = 120
    return blue


def _sleep_notice(image: Image, before: Image, count: int) -> Image:
    """Grey words in the middle, "no change for ten minutes", for three pictures."""
    shown = image.copy()
    rows, columns = image.shape[:2]
    if count < 3:
        shown[rows * 9 // 20 : rows * 11 // 20 : 2, columns * 2 // 5 : columns * 3 // 5] = 70
    return shown


def _keystone(image: Image, before: Image, count: int) -> Image:
    """Vertical correction that comes on: rows move, columns stay."""
    rows = len(image)
    at = np.clip(np.rint(np.arange(rows) * 1.04 - 0.02 * rows).astype(int), 0, rows - 1)
    return np.ascontiguousarray(image[at])


#: Of the projector and its cable.
PROJECTOR_SURPRISES: dict[str, ProjectorMishap] = {
    "eco": _eco,
    "eco wakes": _eco_wakes,
    "range toggles": _range_toggles,
    "power limit": _power_limit,
    "overdrive": _overdrive,
    "no signal": _no_signal,
    "sleep notice": _sleep_notice,
    "keystone": _keystone,
}
