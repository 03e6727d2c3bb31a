"""Under which settings of camera and projector something was captured, and how two such settings differ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from dsl_core.model.base import Record

#: Order of the colours of a mosaic; ``MONO`` is a sensor without one, whose pixels all measure brightness.
BayerPattern = Literal["RGGB", "BGGR", "GRBG", "GBRG", "MONO"]
#: Names of the colours of a mosaic, by their number.
COLOUR_NAMES = ("red", "green", "blue")
Region = tuple[int, int, int, int]
#: How a camera turns its picture before it sends it.
Mirrored = Literal["off", "left to right", "top to bottom", "both ways"]


def colour_sites(bayer: str) -> tuple[int, int, int, int]:
    """Colour, 0 to 2 for red, green and blue, of the four pixels of a cell in reading order.

    The one response curve of a monochrome camera stands in the place of green.

    >>> colour_sites("GRBG"), colour_sites("MONO")
    ((1, 0, 2, 1), (1, 1, 1, 1))
    """
    first, second, third, fourth = ("RGB".index(each) for each in ("GGGG" if bayer == "MONO" else bayer))
    return first, second, third, fourth


def mosaic_colours(bayer: str) -> tuple[int, ...]:
    """The colours that pixels of a mosaic have, in ascending order: of a monochrome camera one.

    >>> mosaic_colours("GRBG"), mosaic_colours("MONO")
    ((0, 1, 2), (1,))
    """
    return tuple(sorted(set(colour_sites(bayer))))


def colours_named(bayer: str) -> dict[int, str]:
    """The colours that pixels of a mosaic have, by number, and their names: none of a monochrome camera's.

    >>> colours_named("GRBG"), colours_named("MONO")
    ({0: 'red', 1: 'green', 2: 'blue'}, {1: ''})
    """
    colours = mosaic_colours(bayer)
    return {colour: COLOUR_NAMES[colour] if len(colours) > 1 else "" for colour in colours}


#: Frame periods of one mode are measured; a mode of another rate differs by far more than this share.
_SAME_PERIOD = 0.01


class CameraConditions(Record):
    """A camera and how it is read out; ``region_px`` is x, y, width, height on the sensor, None for all.

    ``mirrored`` says how it turns its picture itself, None where it does not say.
    """

    model: str
    serial: str
    size_px: tuple[int, int]
    region_px: Region | None = None
    binning: int = 1
    gain_db: float = 0.0
    bayer: BayerPattern
    bit_depth: int
    mirrored: Mirrored | None = None


class ProjectorConditions(Record):
    """A projector and how it is driven; ``mode`` is its maker's name of the setting, such as ``6500 K``."""

    model: str
    serial: str
    size_px: tuple[int, int]
    mode: str = ""
    frame_period_ms: float


class CaptureConditions(Record):
    """All on which a calibration depends and which must be the same in the scans that use it."""

    camera: CameraConditions
    projector: ProjectorConditions


_WORDS = {
    "model": "model",
    "serial": "serial number",
    "size_px": "image size",
    "region_px": "sensor region",
    "binning": "binning",
    "gain_db": "gain (dB)",
    "bayer": "mosaic",
    "bit_depth": "bit depth",
    "mirrored": "mirroring",
    "mode": "mode",
    "frame_period_ms": "frame period (ms)",
}


def differences(known: CaptureConditions, now: CaptureConditions) -> tuple[str, ...]:
    """Each setting that differs, as a clause such as ``the camera's binning was 1 and is 2``."""
    return (
        *_differences("camera", known.camera, now.camera),
        *_differences("projector", known.projector, now.projector),
    )


def _differences(device: str, known: Record, now: Record) -> Iterator[str]:
    for name in type(known).model_fields:
        old, new = getattr(known, name), getattr(now, name)
        if name == "frame_period_ms" and abs(new - old) <= _SAME_PERIOD * old:
            continue
        if name == "mirrored" and None in (old, new):
            continue  # a driver of before did not say
        if old != new:
            yield f"the {device}'s {_WORDS[name]} was {_text(old)} and is {_text(new)}"


def _text(value: object) -> str:
    if value is None:
        return "the whole sensor"
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, tuple):
        return " x ".join(map(str, value)) if len(value) == 2 else ", ".join(map(str, value))
    return str(value) or "not named"
