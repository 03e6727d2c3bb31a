"""What a test shot says of the light, whatever stands before the camera."""

from __future__ import annotations

from dsl_core.campaign.common.exposures import WhiteLevel
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig

#: White after the shortest exposure (DN), and light that is not the projector's (% of white).
LEAST_DN, MOST_OTHER = 0.5, 20.0


def brightness(white: WhiteLevel, rig: Rig, parts: str) -> Figure:
    """White after the shortest safe exposure; ``parts`` are what to check when it is dark."""
    return Figure(
        name="white after one LED cycle",
        value=white.brightest * rig.frame_period_ms,
        unit="DN",
        low=LEAST_DN,
        advice=f"The picture is dark. Check {parts}.",
    )


def other_light(white: WhiteLevel, shade: str = "") -> Figure:
    """Light that stays when the projector shows black; ``shade`` is what else than the room to darken."""
    return Figure(
        name="other light",
        value=100 * white.ambient,
        unit="% of white",
        high=MOST_OTHER,
        advice=f"Darken the room or shade the {shade}." if shade else "Darken the room.",
    )


def film_light(white: WhiteLevel, rig: Rig) -> tuple[Figure, Figure]:
    """Both figures for a flat target behind the film."""
    return brightness(white, rig, "lens cap, aperture, projector and filter"), other_light(white, "target")
