"""Settings of a camera of the GenICam standard, in a profile."""

from __future__ import annotations

from pydantic import Field

from dsl_core.model.base import Record


class GenicamSettings(Record):
    """How a camera is found and set up; whatever is not given is as the camera offers it."""

    id: str = Field(
        default="", description="its id, serial number or address; not needed where there is one camera"
    )
    pixel_format: str = Field(
        default="", description="such as BayerRG12p; the deepest raw one if not given", max_length=40
    )
    region_px: tuple[int, int, int, int] | None = Field(
        default=None,
        description="x, y, width, height on the sensor in unbinned pixels; all of it if not given",
    )
    binning: int = Field(default=1, ge=1, le=16, description="pixels added up in both directions")
    gain_db: float = Field(default=0.0, description="analogue gain, dB")
    adc_bits: int | None = Field(
        default=None,
        ge=8,
        le=16,
        description="for pixels of 16 bits: how many the sensor fills, moved up; such as 12 for a"
        " Grasshopper3",
    )
    features: dict[str, float | str] = Field(
        default_factory=dict,
        description="further GenICam features by name, set before all others, such as GevSCPSPacketSize",
    )
    frame_wait_s: float = Field(
        default=1.0, gt=0, description="how long after its exposure a frame counts as lost"
    )
    reconnect_s: float = Field(
        default=10.0, ge=0, le=20, description="how long a lost camera is searched for before a shot fails"
    )
