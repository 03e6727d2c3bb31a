"""The bandpass filter of a step: what is known of it, and whether a test shot shows it or another one."""

from __future__ import annotations

from dsl_core.calibration.orders.filter_check import colour_shift
from dsl_core.campaign.common.exposures import WhiteLevel
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import nominal_filter

#: A filter whose colours fit another one so many nm away so much better (chi-square) is another one.
COLOUR_NM, COLOUR_GAIN = 14.0, 12.0
#: White without a filter is so many times brighter than through one, at least.
OPEN_FACTOR = 3.0


class FilterNote(Record):
    """The filter of a step: nominal centre, transmission, and whether that was measured."""

    filter_nm: float
    transmission: SpectralCurve
    measured: bool


def note_of_filter(devices: DeviceRig, filter_nm: float) -> FilterNote:
    """What is known of a rig's filter: its measured transmission, or a nominal one."""
    curve = devices.filters.get(filter_nm)
    return FilterNote(
        filter_nm=filter_nm, transmission=curve or nominal_filter(filter_nm), measured=curve is not None
    )


def colour_figure(rig: Rig, white: WhiteLevel, note: FilterNote) -> Figure:
    """How far the colours of a test shot are from those of the filter."""
    shift, gain = colour_shift(rig, white.mean, note.transmission)
    return Figure(
        name="filter by its colours",
        value=shift if gain > COLOUR_GAIN else 0.0,
        unit="nm from the one asked for",
        low=-COLOUR_NM,
        high=COLOUR_NM,
        advice=f"Put the filter of {note.filter_nm:g} nm before the camera.",
    )


def require_filter(
    rig: Rig, white: WhiteLevel, note: FilterNote, title: str, open_white: float | None
) -> None:
    """Raise `CalibrationError` when a test shot of the step ``title`` shows another filter, or none.

    ``open_white`` is the brightness without a filter (DN per ms at full drive), None where it is not known.
    """
    again = f"Put the filter of {note.filter_nm:g} nm before the camera and capture the step again."
    if open_white is not None and white.brightest * OPEN_FACTOR > open_white:
        raise CalibrationError(f"{title}: the picture is about as bright as without a filter. {again}")
    figure = colour_figure(rig, white, note)
    if not figure.passed:
        found = f"the colours are those of a filter of about {note.filter_nm + figure.value:.0f} nm"
        raise CalibrationError(f"{title}: {found}. {again}")
