"""Light of the room that changes while pictures of a target are captured, and how that is judged."""

from __future__ import annotations

from dsl_core.model.figure import Figure

#: What it may change by, % of white, or in its deviations: the larger.
LIGHT_PERCENT, SIGMAS = 0.2, 4.0


def light_change_figure(change: tuple[float, float] | None) -> tuple[Figure, ...]:
    """The change over white and its deviation, against its limits; none where it was not measured."""
    if change is None:
        return ()
    value, std = (100 * each for each in change)
    limit = max(LIGHT_PERCENT, SIGMAS * std)
    return (
        Figure(
            name="change of ambient light during the pictures",
            value=value,
            unit="% of white",
            std=std,
            low=-limit,
            high=limit,
            advice="A lamp or daylight came or went: keep the room dark, and capture the pictures again.",
        ),
    )
