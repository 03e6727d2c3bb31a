"""A test shot of white: how bright each colour is, exposures that suit it, and what it says of the light.

Recipes look with it, and choose the exposures of their scans by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.orders.filter_check import colour_shift
from dsl_core.campaign.common.recipe import Bench
from dsl_core.devices.base import DeviceRig
from dsl_core.devices.plausible import require_transmission
from dsl_core.errors import CalibrationError
from dsl_core.model.base import Record
from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.figure import Figure
from dsl_core.model.plan import Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM, nominal_filter, passed
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import chain_response

#: Share of the range above black that white may reach; a line is dimmer by what the orders of others add.
FILL = 0.9
#: A picture for judging reaches a share of the range between these.
LEAST_FILL, MOST_FILL = 0.1, 0.9
#: The share of pixels that may be brighter than the brightness stated.
BRIGHTEST_SHARE = 0.005
#: Longest exposure that is chosen, ms; of a picture for judging, at most a third.
LONGEST_MS = 4000.0
#: The longer exposure of a scan without filter, which shows first orders and halo, over the shorter one.
LONG_RATIO = 6.0
#: Drive levels for a bracket, the brightest first, and the LED cycles that must not saturate.
LEVELS, CYCLES = (1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2), 6
#: White dimmer than this share of the range in the longest exposure is too dark to measure.
TOO_DARK = 0.02
#: Light that is not the projector's, % of white.
MOST_OTHER = 20.0
#: Colours that fit a filter this many nm away this much better (chi-square) are those of another filter.
COLOUR_NM, COLOUR_GAIN = 14.0, 12.0
#: What looks like a missing filter is at least this share of white without one, and nearer to it (by factors)
#: than to what the filter passes as far as the rig is known.
LEAST_OPEN = 0.5
#: Width at half of its peak of a filter whose transmission nobody measured, nm; the least and most of one.
FWHM_NM, LEAST_FWHM_NM, MOST_FWHM_NM = 10.0, 2.0, 50.0
_ATTEMPTS = 14


@dataclass(frozen=True)
class WhiteLevel:
    """White above black at full drive, DN per ms: brightest pixel, and means of R, G, B (0 without any).

    ``ambient`` is what black shows above the sensor's black level, as a share of the brightest white;
    ``saturated`` says that even the darkest picture was. ``picture`` (rows, columns) is the mosaic itself, DN
    per ms at full drive, and ``level`` the drive level of its picture.
    """

    brightest: float
    mean: NDArray[np.float64]
    ambient: float
    saturated: bool
    picture: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    level: float = 1.0


def shoot_white(bench: Bench) -> WhiteLevel:
    """Show white and black and expose for whole LED cycles until white is neither dark nor saturated."""
    devices, rig = bench.devices, bench.rig
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    level, cycles = 1.0, 1
    for attempt in range(_ATTEMPTS):
        exposure_ms = devices.camera.configure(cycles * rig.frame_period_ms)
        white, black = (_snap(devices, round(255 * level) * on, attempt) for on in (1, 0))
        above = white.astype(float) - black
        peak = float(np.quantile(above, 1 - BRIGHTEST_SHARE))
        if peak > MOST_FILL * range_dn and level > LEVELS[-1]:
            level = max(0.6 * level, LEVELS[-1])
        elif peak < LEAST_FILL * range_dn and exposure_ms < LONGEST_MS / 3:
            longer = min(max(0.3 * range_dn / max(peak, 1.0), 2.0), 8.0)
            cycles = math.ceil(min(cycles * longer, LONGEST_MS / 3 / rig.frame_period_ms + 1))
        else:
            break
    light = rig.projector_response.radiance(level) - rig.projector_response.radiance(0.0)
    rate = above / (exposure_ms * float(light))
    colours = bayer_channels(rig.sensor.bayer, *rate.shape)
    mean = np.zeros(3)
    for colour in mosaic_colours(rig.sensor.bayer):
        mean[colour] = rate[colours == colour].mean()
    dark = float(np.median(black)) - rig.sensor.black_level_dn
    if 100 * dark > MOST_OTHER * peak:
        dark = _light_of_room(devices, dark, float(np.median(black)), exposure_ms)
    return WhiteLevel(
        float(np.quantile(rate, 1 - BRIGHTEST_SHARE)),
        mean,
        max(dark, 0.0) / max(peak, 1.0),
        peak > MOST_FILL * range_dn,
        rate,
        level,
    )


def _light_of_room(devices: DeviceRig, dark: float, seen_dn: float, exposure_ms: float) -> float:
    """What the room adds to black in an exposure, DN, if not all of ``dark``.

    ``seen_dn`` is the median of black. A black level that is not that of the data sheet is there in the
    shortest exposure as well, where light of the room is not.
    """
    short_ms = devices.camera.configure(devices.camera.info.exposure_range_ms[0])
    if short_ms > exposure_ms / 2:
        return dark
    level_dn = float(np.median(_snap(devices, 0, _ATTEMPTS)))
    return min(dark, (seen_dn - level_dn) * exposure_ms / (exposure_ms - short_ms))


def _longest_share(rig: Rig, white: WhiteLevel) -> float:
    """White after the longest exposure, as a share of the camera's range."""
    return LONGEST_MS * white.brightest / (rig.sensor.full_scale_dn - rig.sensor.black_level_dn)


def require_bright(rig: Rig, white: WhiteLevel, what: str) -> None:
    """Raise `CalibrationError` where even the longest exposure sees next to nothing of white."""
    longest = _longest_share(rig, white)
    if longest < TOO_DARK:
        raise CalibrationError(
            f"{what} is too dark: in {LONGEST_MS / 1000:g} s white reaches {longest:.1%} of the camera's"
            " range. Check lens cap, aperture, projector and filter."
        )


def bright_setting(rig: Rig, white: WhiteLevel, what: str) -> Setting:
    """Full drive, and as many LED cycles as white allows; raises `CalibrationError` where it is too dark."""
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    require_bright(rig, white, what)
    cycles = int(min(FILL * range_dn / white.brightest, LONGEST_MS) / rig.frame_period_ms)
    if cycles > 0:
        return Setting(exposure_ms=cycles * rig.frame_period_ms, level=1.0)
    return bracket(rig, white, what, 1.0, cycles=1)[0]


def bracket(
    rig: Rig, white: WhiteLevel, what: str, ratio: float, cycles: int = CYCLES
) -> tuple[Setting, ...]:
    """Two settings of one drive level: whole LED cycles that white does not saturate, and ``ratio`` as long.

    One level, so that no error of the projector's gamma comes between them. One setting where the ratio is 1.
    Raises `CalibrationError` where it is too dark.
    """
    require_bright(rig, white, what)
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    response = rig.projector_response
    for level in LEVELS:
        light = float(response.radiance(level) - response.radiance(0.0))
        fit = int(FILL * range_dn / (white.brightest * light) / rig.frame_period_ms)
        if fit >= cycles or level == LEVELS[-1]:
            break
    fit = max(min(fit, int(LONGEST_MS / rig.frame_period_ms / max(ratio, 1.0))), 1)
    short = Setting(exposure_ms=fit * rig.frame_period_ms, level=level)
    if ratio <= 1:
        return (short,)
    long = min(max(round(fit * ratio), fit + 1), int(LONGEST_MS / rig.frame_period_ms))
    return short, Setting(exposure_ms=long * rig.frame_period_ms, level=level)


def _snap(devices: DeviceRig, drive: int, attempt: int) -> NDArray[np.uint16]:
    info = devices.projector.info
    devices.projector.show(np.full((info.height_px, info.width_px), drive, np.uint8))
    # Numbers of their own, so that the twin's noise here is not that of a scan.
    devices.camera.prepare(1_000_000 + drive, attempt)
    return devices.camera.snap().pixels


def brightness(white: WhiteLevel, rig: Rig, parts: str) -> Figure:
    """White after the longest exposure; ``parts`` are what to check when it is dark."""
    return Figure(
        name=f"brightness of white in up to {LONGEST_MS / 1000:g} s",
        value=100 * min(_longest_share(rig, white), 1.0),
        unit="% of the camera's range",
        low=100 * TOO_DARK,
        advice=f"The picture is dark. Check {parts}.",
    )


def other_light(white: WhiteLevel, shade: str = "") -> Figure:
    """Light that stays when the projector shows black; ``shade`` is what to darken as well as the room."""
    return Figure(
        name="ambient light",
        value=100 * white.ambient,
        unit="% of white",
        high=MOST_OTHER,
        advice=f"Darken the room or shade the {shade}." if shade else "Darken the room.",
    )


def film_light(white: WhiteLevel, rig: Rig) -> tuple[Figure, Figure]:
    """Both figures for a flat target behind the film."""
    return brightness(white, rig, "lens cap, aperture, projector and filter"), other_light(white, "target")


class FilterNote(Record):
    """The filter of a step: nominal centre, transmission, and whether that was measured."""

    filter_nm: float
    transmission: SpectralCurve
    measured: bool


def require_width(fwhm_nm: float, title: str) -> None:
    """Raise `CalibrationError` where no bandpass filter has such a width at half of its peak."""
    if not LEAST_FWHM_NM <= fwhm_nm <= MOST_FWHM_NM:
        raise CalibrationError(
            f"{title}: fwhm_nm={fwhm_nm:g} was given, the width of the filters at half of their peak;"
            f" {LEAST_FWHM_NM:g} to {MOST_FWHM_NM:g} nm are possible. State what their data sheet says."
        )


def note_of_filter(devices: DeviceRig, filter_nm: float, fwhm_nm: float = FWHM_NM) -> FilterNote:
    """What is known of a rig's filter: its measured transmission, or a nominal one of a width.

    Raises `DeviceError` where what was measured cannot be a transmission.
    """
    curve = devices.filters.get(filter_nm)
    if curve is not None:
        require_transmission(curve, filter_nm)
    return FilterNote(
        filter_nm=filter_nm,
        transmission=curve or nominal_filter(filter_nm, fwhm_nm),
        measured=curve is not None,
    )


def colour_figure(rig: Rig, white: WhiteLevel, note: FilterNote) -> Figure:
    """How far the colours of a test shot are from those of the filter."""
    shift, gain = colour_shift(rig, white.mean, note.transmission)
    return Figure(
        name="filter by its colours",
        value=shift if gain > COLOUR_GAIN else 0.0,
        unit="nm from the one requested",
        low=-COLOUR_NM,
        high=COLOUR_NM,
        advice=f"Put the filter of {note.filter_nm:g} nm in front of the camera.",
    )


def require_filter(
    rig: Rig, white: WhiteLevel, note: FilterNote, title: str, open_white: float | None
) -> None:
    """Raise `CalibrationError` when a test shot of the step ``title`` shows another filter, or none.

    ``open_white`` is the brightness without a filter (DN per ms at full drive), None where it is not known.
    """
    again = f"Put the filter of {note.filter_nm:g} nm in front of the camera and capture the step again."
    if open_white is not None:
        expected, share = _share_passed(rig, note), white.brightest / open_white
        if share > max(LEAST_OPEN, expected**0.5):
            raise CalibrationError(
                f"{title}: the picture is about as bright as without a filter: {share:.2f} times, where"
                f" {expected:.2f} is expected. {again} If it is there and broader than assumed, state how"
                " broad (fwhm_nm) or measure its transmission."
            )
    figure = colour_figure(rig, white, note)
    if not figure.passed:
        found = f"the colours are those of a filter of about {note.filter_nm + figure.value:.0f} nm"
        raise CalibrationError(f"{title}: {found}. {again}")


def _share_passed(rig: Rig, note: FilterNote) -> float:
    """What the filter passes of white in the brightest colour of each, as far as the rig is known."""
    colours = list(mosaic_colours(rig.sensor.bayer))
    white = chain_response(rig, 0, FINE_NM).sum((1, 2))[colours].max()
    return float(passed(rig, note.transmission).sum(1)[colours].max() / white)
