"""What cheap hardware and busy rooms do that nobody thinks of: small, slow, or for a few pictures.

Each takes what was right, the picture before it, and how many there were since it began, 0 for the first: raw
mosaics (rows, columns), DN, of the camera, and pictures (rows, columns, 3) sent to the projector.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.cases.lab_mishaps import CameraMishap, ProjectorMishap, as_image
from tests.cases.spoiled_pictures import BLACK_DN, FULL_DN, Mosaic, by_colour, counts_of, scaled

Image = NDArray[np.uint8]


def _rng(count: int) -> np.random.Generator:
    return np.random.default_rng((71, count))


def _over(count: int, pictures: int) -> float:
    """How far a change that takes so many pictures has gone."""
    return min((count + 1) / pictures, 1.0)


def _places(pixels: Mosaic) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows and columns of all pixels as shares of the picture."""
    down, across = np.mgrid[: pixels.shape[0], : pixels.shape[1]]
    return down / pixels.shape[0], across / pixels.shape[1]


def _steps_by(factor: float) -> CameraMishap:
    return lambda pixels, before, count: scaled(pixels, factor)


def _soft_shadow(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Somebody leans in for forty pictures: up to half of the light, with an edge of a fifth of the view."""
    if count >= 40:
        return pixels
    _, across = _places(pixels)
    edge = 0.6 * np.sin(np.pi * (count + 1) / 41)
    return scaled(pixels, 1 - 0.5 / (1 + np.exp((across - edge) / 0.05)))


def _haze(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A fog machine next door: a fifth of the contrast for thirty pictures, and half of it as a veil."""
    lost = 0.2 * np.sin(np.pi * count / 30) if count < 30 else 0.0
    light = pixels - BLACK_DN
    return counts_of(BLACK_DN + (1 - lost) * light + 0.5 * lost * light.mean())


def _column_pattern(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """The correction of a sensor's columns (4 DN and 2 %) is applied one column late."""
    rng = _rng(0)
    offset, gain = rng.normal(0, 4.0, pixels.shape[1]), rng.normal(1, 0.02, pixels.shape[1])
    late, late_gain = np.roll(offset, 1), np.roll(gain, 1)
    return counts_of(BLACK_DN + offset - late + (pixels - BLACK_DN) * gain / late_gain)


def _dust_on_grating(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A fibre lands on the grating: a soft spot that loses a tenth, and scatters it."""
    down, across = _places(pixels)
    lost = 0.1 * np.exp(-((down - 0.4) ** 2 + (across - 0.55) ** 2) / 0.02)
    light = pixels - BLACK_DN
    return counts_of(BLACK_DN + (1 - lost) * light + 0.05 * light.mean() * lost)


def _leds_warm(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Red loses 6 % and blue gains 3 % within a hundred pictures."""
    gain = np.ones(pixels.shape)
    gain[::2, ::2], gain[1::2, 1::2] = 1 - 0.06 * _over(count, 100), 1 + 0.03 * _over(count, 100)
    return scaled(pixels, gain)


def _gain_noise(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    return scaled(pixels, 1 + _rng(count).normal(0, 0.03))


def _rows_clamped(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Every row is brought to the same black by the darkest tenth of its pixels."""
    dark = np.quantile(pixels, 0.1, axis=1, keepdims=True)
    return counts_of(pixels - dark + BLACK_DN)


def _compressed(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Eight bits and a JPEG of each colour on the way."""

    def packed(part: NDArray[np.float32]) -> NDArray[np.float32]:
        small = np.clip(np.rint(part * 255 / FULL_DN), 0, 255).astype(np.uint8)
        _, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 90])
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.float32) * np.float32(FULL_DN / 255)

    return by_colour(pixels, packed)


def _rows_dropped(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """In every sixth picture, two rows are lost, and those below come earlier."""
    if count % 6:
        return pixels
    at = int(_rng(count).uniform(0.1, 0.8) * len(pixels)) // 2 * 2
    return np.concatenate([pixels[:at], pixels[at + 2 :], pixels[-2:]])


def _pulse_bands(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A rolling shutter under lamps that are switched on and off: bands of ±4 % that wander."""
    down, _ = _places(pixels)
    return scaled(pixels, 1 + 0.04 * np.sin(2 * np.pi * (3.3 * down + 0.37 * count)))


def _moved(pixels: Mosaic, across_px: float, zoom: float = 1.0) -> Mosaic:
    """By so many pixels of the mosaic, or larger."""

    def warped(part: NDArray[np.float32]) -> NDArray[np.float32]:
        turn = cv2.getRotationMatrix2D((part.shape[1] / 2, part.shape[0] / 2), 0, zoom)
        turn[0, 2] += across_px / 2
        return np.asarray(
            cv2.warpAffine(part, turn, part.shape[::-1], borderMode=cv2.BORDER_REPLICATE), np.float32
        )

    return by_colour(pixels, warped)


def _lens_breathes(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Focus that hunts changes the size of the picture by ±0.4 %."""
    return _moved(pixels, 0.0, 1 + 0.004 * np.sin(count / 6))


def _cable_swings(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    return _moved(pixels, 0.4 * np.sin(1.7 * count))


def _door(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """Light of the corridor from the left for twenty pictures, within two."""
    if count >= 20:
        return pixels
    _, across = _places(pixels)
    return counts_of(pixels + 40.0 * min(count + 1, 2) / 2 * (1 - across))


def _object(pixels: Mosaic) -> tuple[slice, slice]:
    rows, columns = (size // 4 * 2 for size in pixels.shape)
    return slice(rows // 2, rows * 3 // 2), slice(columns // 2, columns * 3 // 2)


def _sample_dries(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """What lies in the middle becomes brighter by 15 % within a hundred pictures."""
    gain = np.ones(pixels.shape)
    gain[_object(pixels)] = 1 + 0.15 * _over(count, 100)
    return scaled(pixels, gain)


def _sample_creeps(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """What lies in the middle creeps by a pixel within a hundred pictures."""
    changed = pixels.copy()
    changed[_object(pixels)] = _moved(pixels, _over(count, 100))[_object(pixels)]
    return changed


def _mains_sag(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """A kettle: 12 % less light for eight pictures of forty."""
    return scaled(pixels, 0.88) if count % 40 < 8 else pixels


def _pixels_joined(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """The driver falls back to half the resolution, and enlarges it again."""
    return by_colour(
        pixels,
        lambda part: cv2.resize(
            cv2.resize(part, (part.shape[1] // 2, part.shape[0] // 2), interpolation=cv2.INTER_AREA),
            part.shape[::-1],
            interpolation=cv2.INTER_LINEAR,
        ),
    )


def _knee(pixels: Mosaic, before: Mosaic, count: int) -> Mosaic:
    """High dynamic range: above an eighth of full scale, half of the light."""
    light, knee = pixels - BLACK_DN, FULL_DN / 8
    return counts_of(BLACK_DN + np.where(light > knee, knee + (light - knee) / 2, light))


#: Of the camera, the light and the room.
CAMERA_ODDITIES: dict[str, CameraMishap] = {
    "light rises in the code": _steps_by(1.1),
    "light falls in the code": _steps_by(0.9),
    "soft shadow": _soft_shadow,
    "haze": _haze,
    "column pattern": _column_pattern,
    "dust on grating": _dust_on_grating,
    "LEDs warm": _leds_warm,
    "gain noise": _gain_noise,
    "rows clamped": _rows_clamped,
    "compressed": _compressed,
    "rows dropped": _rows_dropped,
    "pulse bands": _pulse_bands,
    "lens breathes": _lens_breathes,
    "cable swings": _cable_swings,
    "door": _door,
    "sample dries": _sample_dries,
    "sample creeps": _sample_creeps,
    "mains sag": _mains_sag,
    "pixels joined": _pixels_joined,
    "knee": _knee,
}


def _mean_level(image: Image) -> float:
    return float(image.mean()) / max(float(image.max()), 1.0)


def _iris_both_ways(image: Image, before: Image, count: int) -> Image:
    """Dark and bright pictures lose an eighth, those in between nothing: lines and white agree."""
    return as_image(image * (1 - 0.125 * abs(2 * min(_mean_level(image), 1.0) - 1)))


def _iris_lags(image: Image, before: Image, count: int) -> Image:
    """An iris that follows the mean of this picture and of the one before, by up to a fifth."""
    return as_image(image * (0.8 + 0.2 * (_mean_level(image) + _mean_level(before)) / 2))


def _pointer_wanders(image: Image, before: Image, count: int) -> Image:
    shown = image.copy()
    rows, columns = image.shape[:2]
    down, across = int(rows * (0.5 + 0.4 * np.sin(count / 9))), int(columns * (0.5 + 0.4 * np.cos(count / 7)))
    shown[down : down + max(rows // 30, 2), across : across + max(columns // 50, 2)] = 255
    return shown


def _cover_slips(image: Image, before: Image, count: int) -> Image:
    """The lens cover comes before the first tenth of the columns."""
    shown = image.copy()
    shown[:, : image.shape[1] // 10] = 0
    return shown


def _black_inserted(image: Image, before: Image, count: int) -> Image:
    """Black pictures between the others, for motion: a quarter of the light, in some exposures."""
    return as_image(0.75 * image) if _rng(count).random() < 0.3 else image


def _edges_enhanced(image: Image, before: Image, count: int) -> Image:
    soft = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 1.5)
    return as_image(1.5 * image - 0.5 * soft)


#: Of the projector and of the computer that sends it pictures.
PROJECTOR_ODDITIES: dict[str, ProjectorMishap] = {
    "iris both ways": _iris_both_ways,
    "iris lags": _iris_lags,
    "pointer wanders": _pointer_wanders,
    "cover slips": _cover_slips,
    "black inserted": _black_inserted,
    "edges enhanced": _edges_enhanced,
}
