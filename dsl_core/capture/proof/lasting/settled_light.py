"""Whether light depends on the picture before: white after a dark picture, and black after white.

A lamp that drifts, and light of the room, stay as they are when a picture is shown for longer.
"""

from __future__ import annotations

import numpy as np

from dsl_core.capture.proof.raster import Counts

#: What of white's light each may differ by from what it was, and from what it is when shown for longer.
LEAST_CHANGE = {"white": 0.03, "black": 0.004}
#: Share of the pixels of white that do not saturate, and their mean light, as a share of full scale, that say
#: something: cameras of 8 bits have no more than 255.
LEAST_SOUND, LEAST_LIGHT = 0.25, 100 / 4095
#: Spread of white's light, relative to its mean, that tells a share of it from what all pixels gain alike.
CONTRAST = 0.2
#: It is the same again if it differs by no more than this share of the change.
SAME = 0.33


def change_of_light(seen: Counts, ends: tuple[Counts, Counts], role: str, full_dn: float) -> float:
    """What white has gained, or black of the light of white, as a share; ``ends`` are both at first.

    Zero where white has little light, or saturates.
    """
    white, black = ends
    sound = np.maximum(seen, white) < full_dn
    light = white[sound].astype(np.float64) - black[sound]
    if light.size < LEAST_SOUND * white.size or light.mean() < LEAST_LIGHT * full_dn:
        return 0.0
    gained = seen[sound].astype(np.float64) - (white if role == "white" else black)[sound]
    if role == "white":
        return float(gained.sum() / light.sum())
    away = light - light.mean()
    if away.std() < CONTRAST * light.mean():
        return float(gained @ light / (light @ light))
    # What all pixels gain alike is the camera's black level or the light of the room.
    return float(gained @ away / (away @ away))


def unsettled_sentence(role: str, once: float, longer: float, again: float) -> str:
    """What changes of light say that are gone when a picture is shown for longer; empty if they are not.

    ``once`` and ``again`` are those of a picture after the other of white and black, ``longer`` that of one
    after itself.
    """
    gone = once - longer
    if abs(gone) < LEAST_CHANGE[role] or abs(again - once) > SAME * abs(gone):
        return ""
    if role == "black" and gone < 0:
        # Nothing takes light from black: its level was another one for a while.
        return ""
    if role == "white":
        return (
            f"White, shown after a dark picture, has {(1 + once) / (1 + longer):.2f} times the light that it"
            " has once it is shown for longer: projector, computer or camera mix pictures with those before"
            " them (noise reduction over time, blended frames, overdrive), or an iris follows them. Lines are"
            " off by about as much. Switch that off, and scan again."
        )
    return (
        f"Black, captured after white, holds {gone:.1%} of the light of white, and not when it is shown for"
        " longer: exposures begin before the picture has changed (the projector takes longer than its latency"
        " says), or camera or projector keep something of the picture before (afterglow, image lag, noise"
        " reduction over time). Lines are off by as much. State a longer latency of the projector, or switch"
        " that off, and scan again."
    )
