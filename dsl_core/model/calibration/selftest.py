"""What the self-test of a rig measured: camera, projector, timing, focus and ambient light."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dsl_core.model.base import Record
from dsl_core.model.projector.tone_curve import ToneCurve

Colour = Literal["white", "red", "green", "blue"]

#: Names of the figure that says how far the projector's light by drive level is off a power law, or off the
#: curve that was measured instead, %.
OFF_POWER_LAW, OFF_CURVE = (
    "ramps, rms distance from the power law",
    "ramps, rms distance from the measured curve",
)


class Measured(Record):
    """A measured value and one standard deviation, both in the unit of the field that holds them."""

    value: float
    std: float = Field(ge=0)


class CameraCheck(Record):
    """How light becomes digital numbers, from exposure series and pairs of frames.

    ``linearity_percent`` is the largest distance from a straight line for red, green and blue, in percent of
    full scale, within the useful range: from ``black_level_dn`` to ``useful_dn``, the largest signal that no
    pixel of the region clipped, and that lies on the line: where a sensor ``bends`` before it saturates,
    larger values count for nothing. ``intercept_dn`` is where the line meets an exposure of zero. ``step_dn``
    is the distance of neighbouring values: more than one where pictures were converted from fewer bits.
    ``ends_dn`` is the number that nearly all pixels of a picture that clips reach, None where nothing clipped
    and in tests of before. Where the camera ``is_monochrome``, a third of its rows each stand for red, green
    and blue, here and in all other parts.

    ``exposure_offset_ms`` is by how much exposures are longer than stated. ``black_change_dn`` is what the
    black level gained during the test. Noise of raw values is each pixel's and each frame's own:
    ``shared_by_pixels`` is the share of the noise of light that neighbouring pixels have in common,
    ``shared_by_frames`` that of all noise which dark frames have from the one before. Tests of before did not
    measure these.
    """

    bit_depth: int
    step_dn: int = 1
    ends_dn: int | None = None
    is_monochrome: bool = False
    black_level_dn: Measured
    intercept_dn: Measured
    linearity_percent: tuple[Measured, Measured, Measured]
    useful_dn: float
    bends: bool = False
    saturation_dn: Measured
    electrons_per_dn: Measured
    read_noise_dn: Measured
    hot_share: Measured
    exposure_offset_ms: Measured | None = None
    black_change_dn: Measured | None = None
    shared_by_pixels: Measured | None = None
    shared_by_frames: Measured | None = None


class RampCheck(Record):
    """One colour ramp: the best ``black + (1 - black) * level ** gamma``, and how well it fits.

    Where the projector follows no power law, ``coefficients`` are those of this colour's own curve (see
    `ToneCurve`), and ``gamma`` its mean exponent between the drive levels of a scan. ``residual_percent`` is
    the rms relative distance between measured and fitted light; ``falls`` counts the steps of the ramp at
    which more drive gave less light.
    """

    colour: Colour
    gamma: Measured
    coefficients: tuple[float, ...] | None = None
    residual_percent: Measured
    falls: int

    def light(self, level: NDArray[np.float64]) -> NDArray[np.float64]:
        """Fitted light above black of measured drive levels, relative to full drive."""
        powers = (0.0, *(self.coefficients or (self.gamma.value,)))
        return np.asarray(np.exp(np.polynomial.polynomial.polyval(np.log(level), powers)))


class ProjectorCheck(Record):
    """From drive level to light.

    ``gamma`` is the one value for all colours that a rig holds, and ``tone`` the one curve, None where a
    power law says the same. ``black_fraction`` is the light of a dark projector as a share of white; where no
    pixel sees past the projected picture, ambient light cannot be told from it, and ``black_has_ambient`` is
    set.
    """

    ramps: tuple[RampCheck, ...]
    gamma: Measured
    tone: ToneCurve | None = None
    black_fraction: Measured
    black_has_ambient: bool


class LatencyCheck(Record):
    """From ``show`` to light on the sensor.

    ``blocking_ms`` is how long ``show`` takes to return, ``wait_ms`` the shortest wait after it that gave the
    new picture every time; ``stale_frames`` counts frames that showed the picture before even after the
    longest wait while the next frame did not.
    """

    blocking_ms: Measured
    wait_ms: Measured
    claimed_ms: float
    stale_frames: int
    checked: int


class Beat(Record):
    """Spread over repeats at one exposure, percent of the mean: red, green, blue, and the colour ratios.

    ``ratio_percent`` is the larger spread of red to green and of blue to green; ``floor_percent`` is what the
    noise of the sensor alone gives. Monochrome cameras see no ratios, but a spread of their light.
    """

    exposure_ms: float
    channels_percent: tuple[Measured, Measured, Measured]
    ratio_percent: Measured
    floor_percent: float


class CycleCheck(Record):
    """The colour cycle of the projector's light.

    ``period_ms`` is None for steady light. ``modulation`` is the amplitude relative to the mean of the
    channel that varies most; for steady light the bound that it stays below. ``shortest_ms`` is the shortest
    exposure that holds whole cycles, ``advised_ms`` are those nearest to ``wanted_ms``.
    """

    period_ms: Measured | None
    modulation: Measured
    method: Literal["timestamps", "spread"]
    shortest_ms: float
    wanted_ms: tuple[float, ...]
    advised_ms: tuple[float, ...]
    beats: tuple[Beat, ...]

    def is_advised(self, exposure_ms: float) -> bool:
        """Whether an exposure is one of those advised, within 1 %."""
        return any(abs(exposure_ms - each) < 0.01 * each for each in self.advised_ms)


class FocusCheck(Record):
    """Blur (standard deviation) of a projected edge, camera and projector together.

    ``camera_px`` and ``projector_px`` are means over the picture in pixels of either device; ``worst_px`` is
    the largest of left, middle and right third, in projector pixels.
    """

    camera_px: Measured
    projector_px: Measured
    worst_px: Measured

    @property
    def pixel_px(self) -> float:
        """Projector pixels that a pixel of the camera is wide; 0 where no blur was seen."""
        return self.projector_px.value / self.camera_px.value if self.camera_px.value else 0.0


class AmbientCheck(Record):
    """Light while the projector shows black, red, green, blue: DN per ms and as a share of white."""

    rate_dn_per_ms: tuple[Measured, Measured, Measured]
    share_of_white: Measured


class SelfTest(Record):
    """All that the self-test found, and what it took: frames, and seconds of the rig's clock."""

    schema_version: Literal[1] = 1
    camera: CameraCheck
    projector: ProjectorCheck
    latency: LatencyCheck
    cycle: CycleCheck
    focus: FocusCheck
    ambient: AmbientCheck
    frames: int
    duration_s: float
