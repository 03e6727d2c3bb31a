"""A calibrated rig: everything needed to turn frames into depth and reflectance."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, PositiveFloat, model_validator

from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import CalibrationNote
from dsl_core.model.calibration.lateral_colour import LateralColour
from dsl_core.model.calibration.light_check import LightCheck
from dsl_core.model.conditions import BayerPattern as BayerPattern
from dsl_core.model.conditions import CaptureConditions
from dsl_core.model.conditions import colour_sites as colour_sites
from dsl_core.model.geometry import GeometryCovariance, Lens, Pose
from dsl_core.model.projector.line_spread import LineSpread, Spread
from dsl_core.model.projector.spread_field import SpreadField
from dsl_core.model.projector.tone_curve import ToneCurve
from dsl_core.model.spectral import LIGHT_NM, NOISE_SHARE, SpectralCurve

#: Camera and projector nearer to each other than this give no depth: their distance is in another unit.
LEAST_BASELINE_MM = 1.0


def _rising(given: tuple[float, float]) -> tuple[float, float]:
    low, high = given
    if not low < high:
        raise ValueError(f"a range must rise, given {low:g} to {high:g}")
    return given


def _in_light(curve: SpectralCurve) -> SpectralCurve:
    """The curve itself; raises ``ValueError`` if it covers no light."""
    first, last = curve.wavelengths_nm[0], curve.wavelengths_nm[-1]
    if first > LIGHT_NM[1] or last < LIGHT_NM[0]:
        raise ValueError(
            f"this curve must have wavelengths of light in nm, between {LIGHT_NM[0]:g} and {LIGHT_NM[1]:g},"
            f" given {first:g} to {last:g}"
        )
    return curve


def _of_light(curve: SpectralCurve) -> SpectralCurve:
    """The curve itself; raises ``ValueError`` if it is negative beyond noise."""
    if min(curve.values) < -NOISE_SHARE * max(0.0, *curve.values):
        raise ValueError(f"values of this curve must not be negative, given {min(curve.values):g}")
    return curve


def _some_light(curve: SpectralCurve) -> SpectralCurve:
    if max(curve.values) <= 0:
        raise ValueError(
            "this curve must have a value above zero: without one, this colour is never measured"
        )
    return curve


def _with_first_order(efficiency: dict[int, SpectralCurve]) -> dict[int, SpectralCurve]:
    """The same; raises ``ValueError`` without a first order, or if one is negative beyond their noise."""
    most = max((max(efficiency[order].values) for order in (1, -1) if order in efficiency), default=0.0)
    if most <= 0:
        raise ValueError(
            "order 1 or -1 must be there with an efficiency above zero: spectra are made of them"
        )
    for order, curve in efficiency.items():
        if min(curve.values) < -NOISE_SHARE * most:
            raise ValueError(f"order {order} must not be negative, given {min(curve.values):g}")
    return efficiency


def _apart(pose: Pose) -> Pose:
    distance = float(np.linalg.norm(pose.vector_mm))
    if distance <= LEAST_BASELINE_MM:
        raise ValueError(
            f"camera and projector must be more than {LEAST_BASELINE_MM:g} mm apart, given {distance:.3g} mm;"
            " translation_mm is in mm"
        )
    return pose


Range = Annotated[tuple[float, float], AfterValidator(_rising)]
Rgb = tuple[SpectralCurve, SpectralCurve, SpectralCurve]
_InLight = Annotated[SpectralCurve, AfterValidator(_in_light)]
_Curve = Annotated[_InLight, AfterValidator(_of_light)]
_Colour = Annotated[_Curve, AfterValidator(_some_light)]
_Colours = tuple[_Colour, _Colour, _Colour]
#: Share of the depth range at which a single flat target is, with room before and behind it.
USUAL_DEPTH = 0.4
#: Relative difference granted between the stated width of a measured line spread and its own.
WIDTH_MISMATCH = 1e-3


class FlatField(Record):
    """Relative gain of the camera (vignetting), ``gain[row][column]`` at rising rows and columns (px).

    Bilinear between these nodes and constant outside them. The white scale holds where the gain is one.
    """

    rows_px: tuple[float, ...]
    columns_px: tuple[float, ...]
    gain: tuple[tuple[float, ...], ...]

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not (self.rows_px and self.columns_px):
            raise ValueError("a flat field needs at least one row and one column")
        if np.any(np.diff(self.rows_px) <= 0) or np.any(np.diff(self.columns_px) <= 0):
            raise ValueError(
                "rows and columns of a flat field must rise strictly; sort them and drop repeats"
            )
        shape = (len(self.rows_px), len(self.columns_px))
        if len(self.gain) != shape[0] or any(len(row) != shape[1] for row in self.gain):
            raise ValueError(f"a flat field on these nodes needs {shape[0]} rows of {shape[1]} gains")
        if not all(0 < value < np.inf for row in self.gain for value in row):
            raise ValueError("every gain of a flat field must be a number above zero")
        return self


class ColumnResidual(Record):
    """Columns (px) to add to those of the grating equation: one polynomial for each order.

    Terms are products of Chebyshev polynomials whose degrees ``degrees`` names, in camera column, camera row,
    inverse depth and wavelength, each mapped from its range to -1..1 and held constant outside it. Without
    terms the correction is zero: the grating equation was found to be enough. Orders not named have none.
    """

    orders: tuple[int, ...]
    column_range_px: Range
    row_range_px: Range
    depth_range_mm: Range
    wavelength_range_nm: Range
    degrees: tuple[tuple[int, int, int, int], ...] = ()
    coefficients_px: tuple[tuple[float, ...], ...] = Field(default=())

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.coefficients_px) != len(self.orders) or any(
            len(row) != len(self.degrees) for row in self.coefficients_px
        ):
            raise ValueError(
                "a column residual needs one row of coefficients per order, one coefficient per term"
            )
        return self


#: Powers of the places across and along its lines that a film's shape is made of.
SHAPE_POWERS = ((1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))


class FilmShape(Record):
    """What a film's height has beyond that of its cylinder, such as a twist.

    The height (mm) is the sum of ``factors`` times `SHAPE_POWERS` of the places (mm) across and along the
    lines, from the projector's axis across them and from ``middle_mm`` along them.
    """

    middle_mm: float = 0.0
    factors: tuple[float, float, float, float, float, float] = (0.0,) * 6


class Film(Record):
    """The diffraction film in front of the projector, in projector coordinates.

    The film is a cylinder patch whose axis is vertical: ``bend_per_mm`` is its curvature. Tilts turn
    its normal away from the projector axis; roll turns its lines about that axis. A film that is bent in
    another way has a ``shape`` besides.
    """

    distance_mm: float = Field(default=29.0, gt=1, lt=500)
    lines_per_mm: float = Field(default=500.0, gt=0)
    tilt_x_deg: float = 0.0
    tilt_y_deg: float = 0.0
    roll_deg: float = 0.0
    bend_per_mm: float = 0.0
    shape: FilmShape | None = None

    @property
    def period_nm(self) -> float:
        """Distance between neighbouring lines, nm."""
        return 1e6 / self.lines_per_mm


class Sensor(Record):
    """How light becomes digital numbers (DN).

    ``saturation_dn`` is where values end, None if at the largest number of the bit depth; ``step_dn`` is the
    distance of neighbouring values.
    """

    bayer: BayerPattern = "RGGB"
    bit_depth: int = Field(default=12, ge=8, le=16)
    black_level_dn: float = Field(default=260.0, ge=0)
    electrons_per_dn: float = Field(default=10.0, gt=0)
    read_noise_dn: float = Field(default=0.5, ge=0)
    saturation_dn: int | None = Field(default=None, gt=0)
    step_dn: int = Field(default=1, ge=1)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.black_level_dn >= self.full_scale_dn:
            raise ValueError(
                f"black_level_dn, {self.black_level_dn:g} DN, must be below the full scale,"
                f" {self.full_scale_dn} DN"
            )
        return self

    @property
    def full_scale_dn(self) -> int:
        """Largest digital number; a pixel that reads it is saturated."""
        most = int(2**self.bit_depth - 1)
        return most if self.saturation_dn is None else min(self.saturation_dn, most)

    @property
    def rounds_light(self) -> bool:
        """Whether noise is too small to carry light across steps: means of many values are rounded too."""
        return self.step_dn > self.read_noise_dn * 12**0.5


class ProjectorResponse(Record):
    """From drive level to light: ``radiance = level ** gamma``, black level, blur and halo.

    Where the light leaves that power law, ``tone`` is the curve that was measured and counts instead, and
    ``gamma`` the mean exponent between the drive levels of a scan. The halo is light of the zero order
    scattered sideways in the film: a column at distance ``d`` px contributes
    ``halo_peak_per_px * exp(-|d| / halo_decay_px)`` of its radiance. Without a measured ``spread`` the blur
    is a Gaussian of rms width ``blur_px``; with one, that is the curve's rms width. Where a ``field`` was
    measured, all its distances are wider or narrower by place. ``colour_widths`` are those of lines as the
    camera's red, green and blue see them, relative to the common one, where a scan shows that they differ.
    """

    gamma: float = Field(default=2.2, gt=0)
    tone: ToneCurve | None = None
    black_fraction: float = Field(default=0.0, ge=0, lt=1)
    blur_px: float = Field(default=0.6, gt=0)
    halo_peak_per_px: float = Field(default=0.0, ge=0)
    halo_decay_px: float = Field(default=30.0, gt=0)
    spread: LineSpread | None = None
    field: SpreadField | None = None
    colour_widths: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.spread is not None and abs(self.spread.rms_px / self.blur_px - 1) > WIDTH_MISMATCH:
            raise ValueError(
                f"blur_px must be the rms width of the spread, {self.spread.rms_px:.4f} px, given"
                f" {self.blur_px:.4f} px"
            )
        return self

    @property
    def line_spread(self) -> Spread:
        """The measured curve, or the rms width of the Gaussian that stands for it (px)."""
        return self.blur_px if self.spread is None else self.spread

    def with_gaussian(self, blur_px: float) -> Self:
        """The same with a Gaussian blur of this rms width instead of any measured curve."""
        return self.model_copy(update={"blur_px": blur_px, "spread": None})

    def with_spread(self, spread: LineSpread) -> Self:
        """The same with a measured curve of the line spread."""
        return self.model_copy(update={"blur_px": spread.rms_px, "spread": spread})

    def of_width(self, blur_px: float) -> Self:
        """The same with its curve, or the Gaussian, stretched to this rms width."""
        if self.spread is None:
            return self.with_gaussian(blur_px)
        return self.with_spread(self.spread.stretched(blur_px / self.spread.rms_px))

    def blurred(self, blur_px: float) -> Self:
        """The same after a further Gaussian blur."""
        if self.spread is not None:
            return self.with_spread(self.spread.blurred(blur_px))
        return self.with_gaussian(float(np.hypot(self.blur_px, blur_px)))

    def light(self, level: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light above black of drive levels 0..1, relative to full drive."""
        return np.asarray(level**self.gamma if self.tone is None else self.tone.light(level))

    def radiance(self, level: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Radiance relative to full drive, black included, for a level in 0..1, after 8 bit rounding."""
        drive = np.round(np.clip(level, 0, 1) * 255) / 255
        return np.asarray(self.black_fraction + (1 - self.black_fraction) * self.light(drive))


class CorrespondenceGrid(Record):
    """The published data-driven model ``q = alpha * z**beta + gamma`` on a pixel grid.

    Eq. (2) of the supplement of "Dispersed Structured Light" (Shin et al., CVPR 2024).
    ``coefficients`` holds alpha, beta, gamma for every (order, wavelength, row, column) node, flattened in
    C order; ``z`` is depth in units of ``depth_unit_mm``.
    """

    orders: tuple[int, ...]
    wavelengths_nm: tuple[float, ...]
    rows_px: tuple[float, ...]
    columns_px: tuple[float, ...]
    depth_unit_mm: float = 1000.0
    depth_range_mm: Range
    coefficients: tuple[float, ...]

    @property
    def array(self) -> NDArray[np.float64]:
        """Coefficients, shape (orders, wavelengths, rows, columns, 3)."""
        shape = (len(self.orders), len(self.wavelengths_nm), len(self.rows_px), len(self.columns_px), 3)
        return np.array(self.coefficients, float).reshape(shape)


class Provenance(Record):
    """Where a calibration comes from."""

    created: str = ""
    source: str = ""
    camera_serial: str = ""
    projector_serial: str = ""
    notes: str = ""


class Rig(Record):
    """Geometry, spectral response and radiometry of one camera, projector and film.

    Signal of channel c, DN per ms above black, for reflectance H and pattern radiance P per LED::

        white_scale * s * sum_lambda response_c H sum_m efficiency_m sum_c' emission_c' P_c' d_lambda

    with the shading ``s = cos(incidence) * (reference_distance_mm / distance)**2``, times the camera's
    relative gain if it has a ``flat_field``, and the efficiency of order zero equal to one by definition.
    ``conditions`` are the settings under which all this holds, None where nobody noted them; ``calibrations``
    say when each part was found and how well, ``light_checks`` what drift checks found of the light since,
    oldest first.
    ``lateral_colour`` is that of both lenses, None where nothing is known of it.
    ``residual`` corrects the columns of the grating equation; ``correspondence`` is the data-driven model.
    ``geometry_covariance`` is that of the 24 parameters of lenses and pose (see `GeometryCalibration`).
    ``fitted_lean_px`` is the lean of the lines whose columns they are fitted to, None if these are of a code.
    ``white_scale_rel_std`` and, for each wavelength, ``chain_rel_std`` are relative standard deviations that
    the calibration leaves in every reflectance; ``reference_rel_std`` is that of the white which all of them
    refer to, and which no picture shows. ``white_reflectance`` is what was stated of that white, None where
    nobody noted it.
    ``filter_index`` is the effective index of the bandpass filters with its deviation, None where they shift
    nothing.
    """

    schema_version: Literal[1] = 1
    name: str
    camera: Lens
    projector: Lens
    pose: Annotated[Pose, AfterValidator(_apart)]
    film: Film
    response: _Colours
    emission: _Colours
    efficiency: Annotated[dict[int, _InLight], AfterValidator(_with_first_order)]
    sensor: Sensor = Sensor()
    projector_response: ProjectorResponse = ProjectorResponse()
    white_scale: float = Field(gt=0)
    white_scale_rel_std: float = Field(default=0.0, ge=0)
    reference_rel_std: float = Field(default=0.0, ge=0)
    white_reflectance: _Curve | None = None
    chain_rel_std: _Curve | None = None
    reference_distance_mm: float = Field(default=700.0, gt=0)
    frame_period_ms: float = Field(default=1000.0 / 60.0, gt=0)
    depth_range_mm: Range = (500.0, 1000.0)
    column_std_px: float = Field(default=0.02, ge=0)
    correspondence: CorrespondenceGrid | None = None
    residual: ColumnResidual | None = None
    flat_field: FlatField | None = None
    lateral_colour: LateralColour | None = None
    geometry_covariance: GeometryCovariance | None = None
    fitted_lean_px: float | None = None
    filter_index: tuple[float, float] | None = None
    provenance: Provenance = Provenance()
    conditions: CaptureConditions | None = None
    calibrations: tuple[CalibrationNote, ...] = ()
    light_checks: tuple[LightCheck, ...] = ()

    @property
    def usual_depth_mm(self) -> float:
        """Where a single flat target is, and the plane that predictions are for: whole mm."""
        low, high = self.depth_range_mm
        return float(round(low + USUAL_DEPTH * (high - low)))
