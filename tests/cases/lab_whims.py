"""What lamps, rooms, lenses and displays do of their own accord: slowly, in one colour, or now and then.

Each takes what was right, the picture before it, and how many there were since it began, 0 for the first: raw
mosaics (rows, columns), DN, of the camera, and pictures (rows, columns, 3) sent to the projector.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.cases.lab_mishaps import CameraMishap, ProjectorMishap, as_image
from tests.cases.spoiled_pictures import FULL_DN, Mosaic, by_colour, counts_of, scaled

Image = NDArray[np.uint8]


def _rng(count: int) -> np.random.Generator:
    return np.random.default_rng((89, count))


def _amplifier_glows(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A corner that is read near a warm amplifier: up to 60 DN within eighty pictures."""
    down, across = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    near = np.exp(-np.hypot(down / pixels.shape[0], 1 - across / pixels.shape[1]) / 0.25)
    return counts_of(pixels + 60.0 * min((count + 1) / 80, 1.0) * near)


def _green_flickers(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """The driver of the green LED: ±8 % from picture to picture."""
    gain = np.ones(pixels.shape)
    gain[::2, 1::2] = gain[1::2, ::2] = 1 + 0.08 * _rng(count).uniform(-1, 1)
    return scaled(pixels, gain)


def _hot_air(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Above a heater: places wander by half a pixel of a colour's own picture, smoothly, in the left half."""
    rng = _rng(count)

    def warped(part: NDArray[np.float32]) -> NDArray[np.float32]:
        rows, columns = part.shape
        coarse = rng.normal(0, 0.5, (2, 4, 4)).astype(np.float32)
        shift = [cv2.resize(each, (columns, rows), interpolation=cv2.INTER_CUBIC) for each in coarse]
        down, across = np.mgrid[:rows, :columns].astype(np.float32)
        rest = np.float32(across < columns / 2)
        return np.asarray(
            cv2.remap(
                part, across + rest * shift[0], down + rest * shift[1], cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            ), np.float32,
        )  # fmt: skip

    return by_colour(pixels, warped)


def _spot_wanders(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """The sun in a watch: a bright spot on the wall that moves on with every picture, for thirty of them."""
    if count >= 30:
        return pixels
    down, across = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    at = 0.3 + 0.4 * count / 30
    far = np.hypot(down / pixels.shape[0] - 0.5, across / pixels.shape[1] - at)
    return counts_of(pixels + 0.15 * FULL_DN * np.exp(-((far / 0.06) ** 2)))


def _room_lamp_by_motion(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A lamp with a sensor of motion: on for twelve pictures of forty, brighter above."""
    down = np.linspace(1, 0.4, pixels.shape[0])[:, None]
    return counts_of(pixels + 50.0 * down) if count % 40 < 12 else pixels


def _three_ago(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """In every seventh picture, a corner shows what was there a picture earlier: tiles by radio."""
    if count % 7:
        return pixels
    rows, columns = (size // 6 * 2 for size in pixels.shape)
    mixed = pixels.copy()
    mixed[:rows, :columns] = before[:rows, :columns]
    return mixed


def _iris_creeps(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Oil on the blades: the aperture closes by 12 % within eighty pictures, and lets fewer edges through."""
    down, across = np.mgrid[-1 : 1 : pixels.shape[0] * 1j, -1 : 1 : pixels.shape[1] * 1j]
    closed = min((count + 1) / 80, 1.0)
    return scaled(pixels, 1 - closed * (0.12 - 0.08 * np.minimum(np.hypot(down, across), 1)))


#: Of the camera, the light and the room.
CAMERA_WHIMS: dict[str, CameraMishap] = {
    "amplifier glows": _amplifier_glows,
    "green flickers": _green_flickers,
    "hot air": _hot_air,
    "spot wanders": _spot_wanders,
    "lamp by motion": _room_lamp_by_motion,
    "tile late": _three_ago,
    "iris creeps": _iris_creeps,
}


def _lens_sinks(image: Image, before: Image, count: int) -> Image:
    """A projector that warms up: its picture moves sideways by one and a half columns within ninety."""
    turn = np.array([[1, 0, 1.5 * min((count + 1) / 90, 1.0)], [0, 1, 0]], np.float32)
    moved = cv2.warpAffine(
        image.astype(np.float32), turn, image.shape[1::-1], borderMode=cv2.BORDER_REPLICATE
    )
    return as_image(np.asarray(moved, np.float32))


def _wireless(image: Image, before: Image, count: int) -> Image:
    """Pictures go through the air as JPEG."""
    return np.asarray(cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 60])[1], 1))


def _retention(image: Image, before: Image, count: int) -> Image:
    """Liquid crystals keep a twentieth of what they showed before."""
    return as_image(np.maximum(image, 0.05 * before.astype(np.float64)))


def _blinks(image: Image, before: Image, count: int) -> Image:
    """Every twentieth picture is a quarter darker: the lamp measures itself."""
    return as_image(0.75 * image) if count % 20 == 3 else image


def _night_comes_and_goes(image: Image, before: Image, count: int) -> Image:
    """A filter of blue light that follows the content: dark pictures get a tenth less blue."""
    warm = np.array([1.0, 0.97, 0.85])
    return as_image(image * warm) if image.mean() < 0.1 * max(image.max(), 1) else image


#: Of the projector and of the computer that sends it pictures.
PROJECTOR_WHIMS: dict[str, ProjectorMishap] = {
    "lens sinks": _lens_sinks,
    "wireless": _wireless,
    "retention": _retention,
    "blinks": _blinks,
    "night of the dark": _night_comes_and_goes,
}
