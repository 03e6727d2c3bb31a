"""A colour of a picture that is of the pattern before, though it sees a little of other LEDs as well."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.late_colour import late_colour
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster

SIZE = (48, 40)
CHANNELS = Raster(SIZE).channels("RGGB")
#: Light of the red, green and blue LED (rows) in red, green and blue pixels, as shares of white.
LEDS = np.array([[0.77, 0.11, 0.02], [0.19, 0.8, 0.26], [0.04, 0.09, 0.72]])


def line(at: int, leds: tuple[float, float, float] = (1, 1, 1)) -> Counts:
    """A line of so much light of each LED, from a column of the picture on, as a raster with noise."""
    column = np.arange(SIZE[0] * SIZE[1]) % SIZE[0]
    light = 1000 * (np.array(leds) @ LEDS)[CHANNELS] * ((column >= at) & (column < at + 6))
    return np.asarray(np.random.default_rng(at).poisson(light + 4) + 60, np.uint16)


def mixed(led: int) -> Counts:
    """A line of which one LED still shows the one before."""
    own = [1.0, 1.0, 1.0]
    own[led] = 0.0
    late = [0.0, 0.0, 0.0]
    late[led] = 1.0
    now, before = line(20, (own[0], own[1], own[2])), line(10, (late[0], late[1], late[2]))
    return (now.astype(int) + before - 64).clip(0).astype(np.uint16)


def told(seen: Counts) -> str:
    noise = Noise.of(None, 12)
    return late_colour(seen, line(20), line(10), line(SIZE[0]), CHANNELS, noise)


@pytest.mark.parametrize(("led", "name"), [(0, "red"), (1, "green"), (2, "blue")])
def test_a_colour_that_is_late_is_named(led: int, name: str) -> None:
    assert told(mixed(led)) == name


def test_neither_a_right_picture_nor_a_dim_colour_is_late() -> None:
    assert told(line(20)) == ""
    assert told(line(20, (1, 1, 0.5))) == ""


def test_a_camera_without_colours_is_asked_for_none() -> None:
    grey = Raster(SIZE).channels("MONO")
    assert late_colour(line(20), line(20), line(10), line(SIZE[0]), grey, Noise.of(None, 12)) == ""
