"""What a drift check found of the level of a rig's light, some time after it was calibrated."""

from __future__ import annotations

from pydantic import Field

from dsl_core.model.base import Record


class LightCheck(Record):
    """Light of a known white over that of the calibration, by red, green and blue; one is no change.

    ``checked`` is when it was measured and ``calibrated`` when the light that it was compared with was, both
    ISO 8601, the latter empty where nobody noted it; ``std`` is the largest deviation of the three levels.
    """

    checked: str
    calibrated: str
    levels: tuple[float, float, float]
    std: float = Field(default=0.0, ge=0)

    @property
    def largest_change(self) -> float:
        """The change of the colour that has changed most, as a share of the calibrated light."""
        return max((level - 1 for level in self.levels), key=abs)
