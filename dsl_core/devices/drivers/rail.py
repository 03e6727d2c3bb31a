"""How the scale of a stage lies along the camera's axis."""

from __future__ import annotations

from pydantic import Field

from dsl_core.model.base import Record


class RailSettings(Record):
    """The positions of targets are their distances from the camera, mm; a stage counts from its own end."""

    target_at_zero_mm: float = Field(
        default=0.0, description="distance of the target from the camera where the stage reads zero, mm"
    )
    towards_camera: bool = Field(
        default=False, description="whether the target comes nearer as the stage's own figure rises"
    )

    def to_target(self, stage_mm: float) -> float:
        """Where the target is (mm) when the stage reads ``stage_mm``."""
        return self.target_at_zero_mm + (-stage_mm if self.towards_camera else stage_mm)

    def to_stage(self, target_mm: float) -> float:
        """What the stage reads (mm) when the target is at ``target_mm``."""
        way = target_mm - self.target_at_zero_mm
        return -way if self.towards_camera else way
