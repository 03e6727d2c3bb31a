"""Colours without light in white: a dead channel of the camera, an LED of the projector that is out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.conditions import COLOUR_NAMES
from dsl_core.model.rig import Rig

#: A colour that has less than this share of the light of another, wherever there is any, is missing: hardly
#: any surface reflects as little, and a scene has others.
NO_LIGHT = 0.01
#: An LED is out where its colour has no more than what others give it, and this share of its own light: of
#: surfaces that reflect as little of it there is hardly any, and most scenes have others.
HARDLY = 0.08
#: Where surfaces have many colours, this much: what others give it is of brighter surfaces in places. There
#: are many where its other two colours differ by this factor between a tenth of the blocks and another one.
HARDLY_OF_MANY, MANY = 0.22, 2.0
#: An LED gives a colour at least this share of its light, else nothing is said.
OWN = 0.4
#: Share of the blocks of a picture that have to agree; how bright they are, in deviations; and their number.
MOST, BRIGHT_SIGMAS, FEWEST = 0.8, 20.0, 8
#: Blocks count where no more than this share of a colour saturates: what is left of it would be the darkest.
SATURATED = 0.1


def missing_light(
    white: Counts, black: Counts, rig: Rig, channels: NDArray[np.int8], noise: Noise, raster: Raster
) -> str:
    """A sentence on colours without light in white, given the raster of white and black; empty if none are.

    ``channels`` are the colours of their pixels. Surfaces of one colour alone may look like it: the sentence
    says so.
    """
    if rig.sensor.bayer == "MONO":
        return ""
    light, is_bright, is_saturated = _blocks(white, black, channels, noise, raster)
    # Where most of the picture saturates, what is left is what one colour is dark in.
    if int(is_bright.sum()) < max(FEWEST, int(is_saturated.sum())):
        return ""
    light = light[:, is_bright]
    parts = _parts(rig)
    # What grey surfaces would give all colours alike.
    grey = np.maximum(light, 0) / parts.sum(1)[:, None]
    share = np.quantile(grey / np.maximum(grey.max(0), 1e-9), MOST, axis=1)
    dead = [COLOUR_NAMES[colour] for colour in range(3) if share[colour] < NO_LIGHT]
    if dead:
        return no_light(dead)
    out, least = [], HARDLY
    for led, name in enumerate(COLOUR_NAMES):
        colour = int(parts[:, led].argmax())
        own = float(parts[colour, led] / parts[colour].sum())
        hardly = HARDLY_OF_MANY if _has_many_colours(np.delete(grey, colour, 0)) else HARDLY
        if own > OWN and share[colour] < (1 - own) + hardly * own:
            out.append(name)
            least = max(least, hardly)
    if not out:
        return ""
    return (
        f"White has hardly any light of the {' and the '.join(out)} LED in most of the picture: less than"
        f" {least:.0%} of what grey surfaces would return. Unless no surface reflects it, the LED is out, or"
        " a filter or a setting of projector or computer takes its light away. Look whether the projector"
        " shows white, and scan again."
    )


def _has_many_colours(two: NDArray[np.float64]) -> bool:
    """Whether two colours, shape (2, blocks), have another ratio in some blocks than in others."""
    low, high = np.quantile(np.log(np.maximum(two[0], 1e-9) / np.maximum(two[1], 1e-9)), (0.1, 0.9))
    return bool(high - low > np.log(MANY))


def no_light(colours: Sequence[str]) -> str:
    """A sentence on colours that are missing from white, wherever it is looked at."""
    return (
        f"White has no {' and '.join(colours)} light anywhere: less than {NO_LIGHT:.0%} of another colour's."
        " Take filters off, and look whether the projector shows white, and whether camera and cables pass on"
        " all colours: where one is missing, reflectance cannot be measured."
    )


def _parts(rig: Rig) -> NDArray[np.float64]:
    """Light that each LED gives each colour of the camera (colours, LEDs), in any unit."""
    nm = np.arange(400.0, 701.0, 2.0)
    response, emission = (
        np.array([np.interp(nm, curve.wavelengths_nm, curve.values) for curve in curves])
        for curves in (rig.response, rig.emission)
    )
    return np.asarray(response @ emission.T)


def _blocks(
    white: Counts, black: Counts, channels: NDArray[np.int8], noise: Noise, raster: Raster
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Light of white by colour and block of the raster, DN; which blocks are bright enough, and saturate."""
    sound = white < noise.sensor.full_scale_dn
    gain = white.astype(np.float32) - black
    variance = noise.variance(white) + noise.variance(black)
    light, is_lit, is_whole = [], [], []
    for colour in range(3):
        mask = np.asarray(sound & (channels == colour), np.float32)
        count = raster.pool(mask) * raster.pooled
        total = raster.pool(gain * mask) * raster.pooled
        std = np.sqrt(raster.pool(variance * mask) * raster.pooled)
        own = raster.pool(np.asarray(channels == colour, np.float32)) * raster.pooled
        is_whole.append((count > 0) & (count >= (1 - SATURATED) * own))
        is_lit.append(total > BRIGHT_SIGMAS * std)
        light.append(total / np.maximum(count, 1))
    whole = np.all(is_whole, 0)
    return np.array(light, np.float64), whole & np.any(is_lit, 0), ~whole
