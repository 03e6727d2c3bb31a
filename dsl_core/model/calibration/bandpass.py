"""Measured through bandpass filters: efficiency of the orders, response of the camera, blur and halo."""

from __future__ import annotations

from pydantic import Field

from dsl_core.model.base import Record
from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.projector.spread_field import SpreadField
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve


class OrderSample(Record):
    """One order through one filter: light relative to the zero order and distance from it, deviations."""

    order: int
    ratio: float
    ratio_std: float = Field(ge=0)
    offset_px: float
    offset_std_px: float = Field(ge=0)


class FilterSample(Record):
    """One filter: nominal centre, effective wavelength of what it passes, zero order (DN per ms) and orders.

    ``found_nm`` is where the orders' places say the filter is, with its deviation, None where it was not
    found.
    """

    filter_nm: float
    effective_nm: float
    found_nm: float | None = None
    found_std_nm: float | None = Field(default=None, ge=0)
    curve_measured: bool
    zero_dn_per_ms: tuple[float, float, float]
    orders: tuple[OrderSample, ...]


class BandpassCalibration(Record):
    """Efficiency by order relative to the zero order, response, white scale, blur and halo, with deviations.

    The response keeps the scale that green had before; ``white_scale`` belongs to it. ``misfit`` is the
    factor by which the scatter of the efficiency exceeds its stated deviations, by order.
    ``second_order_share`` is the mean of what both second orders have of the light of their first ones, with
    the deviation of either from it; ``efficiency`` has each for itself. Where the lines
    call for another curve than a Gaussian, ``spread`` is that curve, of the rms width ``blur_px``, and where
    its width varies over the projector's frame, ``field`` says how. ``filters_off_nm`` is by how much longer
    wavelengths than stated all filters pass, judged by the LEDs' spectra, with its deviation, None where it
    was not judged; ``filter_index`` is the effective index of the filters' layers by their shift with the
    angle of view, with its deviation, None where none is seen. ``bulge_mm`` is by how much the target bulges
    towards the camera over 300 mm, with its deviation (None in older records). ``passed`` is the light of
    white in all orders through the film, over that of the Spectralon without it (None in older records).
    """

    filters: tuple[FilterSample, ...]
    efficiency: dict[int, SpectralCurve]
    second_order_share: float
    second_order_share_std: float = Field(ge=0)
    misfit: dict[int, float]
    response: Rgb
    white_scale: float = Field(gt=0)
    white_scale_rel_std: float = Field(ge=0)
    blur_px: float = Field(gt=0)
    blur_std_px: float = Field(ge=0)
    halo_peak_per_px: float = Field(ge=0)
    halo_peak_std_per_px: float = Field(ge=0)
    halo_decay_px: float = Field(gt=0)
    halo_decay_std_px: float = Field(ge=0)
    spread: LineSpread | None = None
    field: SpreadField | None = None
    filters_off_nm: float | None = None
    filters_off_std_nm: float = Field(default=0.0, ge=0)
    filter_index: tuple[float, float] | None = None
    bulge_mm: tuple[float, float] | None = None
    passed: float | None = Field(default=None, gt=0)
    warnings: tuple[str, ...] = ()


def apply_bandpass(record: BandpassCalibration, rig: Rig) -> Rig:
    """The rig with efficiencies, response, white scale, blur and halo as measured."""
    response = rig.projector_response.model_copy(
        update={
            "blur_px": record.blur_px,
            "spread": record.spread,
            "field": record.field,
            "halo_peak_per_px": record.halo_peak_per_px,
            "halo_decay_px": record.halo_decay_px,
        }
    )
    return rig.model_copy(
        update={
            "efficiency": {**rig.efficiency, **record.efficiency},
            "response": record.response,
            "white_scale": record.white_scale,
            "white_scale_rel_std": record.white_scale_rel_std,
            "projector_response": response,
            "filter_index": record.filter_index,
        }
    )
