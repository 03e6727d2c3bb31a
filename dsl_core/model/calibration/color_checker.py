"""Camera response and LED emission of a rig, refined on a classic chart, and how well they fit."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from dsl_core.model.base import Record
from dsl_core.model.geometry import Row3
from dsl_core.model.rig import Rgb

Point = tuple[float, float]
#: How a chart is turned, by its quarter turns clockwise.
ORIENTATIONS = ("upright", "turned clockwise", "upside down", "turned anticlockwise")


class PatchResult(Record):
    """One patch: its signals at unit shading and how far the model is from them.

    ``signal`` and ``std`` are ``[camera channel][light]`` in DN per ms at full drive; lights are red, green,
    blue, white. ``residual`` is the rms over channels and lights of measured minus modelled signals, as a
    share of the patch's white; ``held_out`` is the same with curves that never saw the patch, ``start`` with
    those before the refinement.
    """

    name: str
    pixels: int
    saturated: float
    signal: tuple[tuple[float, ...], ...]
    std: tuple[tuple[float, ...], ...]
    residual: float
    held_out: float
    start: float


class ColorCheckerCalibration(Record):
    """Response and emission refined on a chart, film off.

    By Eq. 1 of the supplement of "Dispersed Structured Light" (Shin et al., CVPR 2024).
    ``corners_px`` are column and row of the outer corners of the patches: at dark skin, bluish green, black
    and white; ``quarter_turns`` says how far the chart was turned clockwise. ``weight`` of Eq. 1 and the
    relative ``reflectance_error`` of the patches are those the data chose; ``published_held_out`` is the
    held-out residual (rms over patches) with the published weight. ``chart_level`` is the light on the chart
    over that on the Spectralon, minus one; ``led_levels`` are those of single LEDs by the grey patches (None
    in older records). ``reference_rel_std`` is the relative deviation of the white that both disagree about.
    ``light_change`` is by how much the light of the room changed during the pictures, over white, with its
    deviation (None in older records).
    """

    schema_version: Literal[1] = 1
    chart: str
    corners_px: tuple[Point, Point, Point, Point]
    quarter_turns: int
    patches: tuple[PatchResult, ...]
    response: Rgb
    emission: Rgb
    white_scale: float = Field(gt=0)
    weight: float
    reflectance_error: float
    chart_level: float
    led_levels: Row3 | None = None
    reference_rel_std: float | None = Field(default=None, ge=0)
    light_change: tuple[float, float] | None = None
    published_held_out: float
    tilt_deg: float
    distance_mm: float

    @property
    def residual(self) -> float:
        """RMS of the patches' residuals."""
        return _rms([patch.residual for patch in self.patches])

    @property
    def held_out(self) -> float:
        """RMS of the patches' held-out residuals."""
        return _rms([patch.held_out for patch in self.patches])

    @property
    def start(self) -> float:
        """RMS of the patches' residuals before the refinement."""
        return _rms([patch.start for patch in self.patches])


def _rms(values: list[float]) -> float:
    return float((sum(value**2 for value in values) / len(values)) ** 0.5)
