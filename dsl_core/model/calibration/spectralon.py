"""Light, white signals and evenness of a rig, measured on a white standard."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from dsl_core.model.base import Record
from dsl_core.model.geometry import Row3
from dsl_core.model.rig import FlatField, Rgb
from dsl_core.model.spectral import SpectralCurve

Square3 = tuple[Row3, Row3, Row3]
LightColour = Literal["red", "green", "blue", "white", "black"]
COLOURS: tuple[LightColour, ...] = ("red", "green", "blue", "white", "black")


class EmissionReadings(Record):
    """Spectral radiances of the Spectralon under each uniform picture, as read, repeats in their order."""

    schema_version: Literal[1] = 1
    source: str
    readings: dict[LightColour, tuple[SpectralCurve, ...]] = Field(default_factory=dict)


class MeasuredEmission(Record):
    """Emission of the LEDs, black subtracted, divided by the Spectralon's reflectance.

    The instrument's scale is not used: ``curves`` are scaled so that the three integrals over wavelength sum
    to `EMISSION_SUM_NM`, which any rig can be compared by and no single noisy peak decides. ``additivity`` is
    white over the sum of red, green and blue, integrated. ``end_share`` is the emission that is left at the
    ends of the range over its peak. ``white_parts`` is how many times red, green and blue white consists of,
    and ``white_apart`` (value, deviation) how far it is from them at any wavelength, as a share of its peak;
    None in records of earlier versions.
    """

    curves: Rgb
    smoothing_nm: Row3
    additivity: float
    additivity_std: float
    readings: int
    end_share: float
    white_parts: Row3 | None = None
    white_apart: tuple[float, float] | None = None


#: Integral of the three LEDs' emission together, nm (peak near one, as in the published curves).
EMISSION_SUM_NM = 100.0


class WhiteSignals(Record):
    """Signals of the Spectralon at unit shading: DN per ms at full drive, ``[camera channel][LED]``.

    ``rel_std`` are their relative deviations. ``white_over_sum`` is each channel's signal under white over
    the sum of its signals under red, green and blue.
    """

    signal: Square3
    rel_std: Square3
    white_over_sum: Row3

    @property
    def array(self) -> NDArray[np.float64]:
        """Signals, shape (channels 3, LEDs 3)."""
        return np.array(self.signal)


class PlaneQuality(Record):
    """How a flat target stood: distance along the camera axis, tilt, and rms of depths about the plane."""

    distance_mm: float
    tilt_deg: float
    rms_mm: float


class SpectralonCalibration(Record):
    """Emission, white signals and evenness of one rig, film off.

    Shares are of the pixels in the middle half of the image that the projector reaches. ``unevenness`` is the
    rms of the white signal, in blocks, about its smooth part, the ``flat_field`` (mean one, deviations
    ``flat_field_std`` at its nodes, of which ``flat_field_unsure`` is the largest where the projector lights
    the picture, target or not); ``flat_field_chi_square`` is that of an even camera, reduced.
    ``reflectance_rel_std`` is the relative deviation of the stated reflectance (0 in older records).
    ``light_change`` is by how much the light of the room changed during the pictures, over white, and
    ``bulge_mm`` by how much the target bulges towards the camera over 300 mm, each with its deviation. All of
    these are None in older records.
    """

    schema_version: Literal[1] = 1
    reflectance: SpectralCurve
    reflectance_rel_std: float = Field(default=0.0, ge=0)
    emission: MeasuredEmission
    white: WhiteSignals
    plane: PlaneQuality
    saturated_share: float
    filled_share: float
    unevenness: float
    flat_field: FlatField
    flat_field_std: tuple[tuple[float, ...], ...]
    flat_field_chi_square: float
    flat_field_unsure: float | None = None
    light_change: tuple[float, float] | None = None
    bulge_mm: tuple[float, float] | None = None
