"""Figures by which a Spectralon and its calibration are judged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.plane import bulge_figure
from dsl_core.calibration.common.room_light import light_change_figure
from dsl_core.model.calibration.spectralon import MeasuredEmission, SpectralonCalibration
from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.figure import Figure
from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import bayer_channels

#: Limits: scatter of blocks in the middle (%), tilt (degrees).
UNEVEN_PERCENT, MAX_TILT_DEG = 1.0, 15.0
#: By how much white may contain more or less of an LED than the LED alone, %; and how far it may be from its
#: parts at any wavelength, % of its peak (an LED that is half a nanometre away) or in deviations.
PART_PERCENT, APART_PERCENT, APART_SIGMAS = 5.0, 4.0, 6.0
LOOK_UNEVEN_PERCENT = 25.0
#: A bulge over 300 mm: this one tilts the target's sides by half a degree, and corners of the flat field are
#: off by .9 %.
BULGE_MM = 1.0
#: Deviation of the camera's gain (%) anywhere that the projector lights: beyond the target it only follows
#: from its course on it, and reflectances there are off by as much.
GAIN_PERCENT = 2.0


def unevenness_of_middle(picture: NDArray[np.float64], rig: Rig) -> Figure:
    """How far the middle half of a white mosaic (DN per ms) is from even, the worst colour."""
    rows, columns = (slice(n // 4, 3 * n // 4) for n in picture.shape)
    colour = bayer_channels(rig.sensor.bayer, *picture.shape)[rows, columns]
    inner = picture[rows, columns]
    spread = 0.0
    for c in mosaic_colours(rig.sensor.bayer):
        low, middle, high = np.quantile(inner[colour == c], (0.05, 0.5, 0.95))
        spread = max(spread, float((high - low) / max(middle, 1e-9)))
    return Figure(
        name="unevenness of the middle",
        value=100 * spread,
        unit="%",
        high=LOOK_UNEVEN_PERCENT,
        advice="Fill the middle half of the picture with the Spectralon alone; avoid shadows.",
    )


def spectralon_figures(record: SpectralonCalibration) -> tuple[Figure, ...]:
    """Figures of emission, pictures and white, each with its limits and what to do."""
    return (*_emission_figures(record), *_picture_figures(record))


def _emission_figures(record: SpectralonCalibration) -> list[Figure]:
    emission = record.emission
    noise = [
        100 * float(np.array(curve.std or (0.0,)).max()) / max(curve.values) for curve in emission.curves
    ]
    return [
        Figure(
            name="white over red + green + blue",
            value=emission.additivity,
            std=emission.additivity_std,
            unit="1",
            low=0.97,
            high=1.03,
            advice="Switch off the projector's colour enhancement; give all spectra in one unit.",
        ),
        *_parts_of_white(emission),
        Figure(
            name="deviation of the emission, of its peak",
            value=max(noise),
            unit="%",
            high=1.0,
            advice="Read each spectrum more often or with a longer integration.",
        ),
        Figure(
            name="emission at the ends of the range, of its peak",
            value=100 * emission.end_share,
            unit="%",
            high=2.0,
            advice="The instrument's range cuts off the LEDs; emission beyond it is assumed constant.",
        ),
    ]


def _parts_of_white(emission: MeasuredEmission) -> list[Figure]:
    """How white consists of red, green and blue; none in records of earlier versions."""
    if emission.white_parts is None or emission.white_apart is None:
        return []
    value, std = (100 * each for each in emission.white_apart)
    return [
        Figure(
            name="an LED in white and alone, largest difference",
            value=100 * max(abs(part - 1) for part in emission.white_parts),
            unit="%",
            high=PART_PERCENT,
            advice="Switch off the projector's colour enhancement, let it warm up, and see that each spectrum"
            " is read while its own picture shows; then read them again.",
        ),
        Figure(
            name="white over its parts, largest difference at a wavelength",
            value=value,
            unit="% of the peak",
            std=std,
            high=max(APART_PERCENT, APART_SIGMAS * std),
            advice="The instrument's wavelengths changed between two spectra, or a spectrum is of another"
            " picture. Restart the instrument, and read all spectra again.",
        ),
    ]


def _picture_figures(record: SpectralonCalibration) -> list[Figure]:
    white = record.white
    worst = max(abs(share - 1) for share in white.white_over_sum)
    total = white.array.sum(1)
    # A monochrome camera has no signals of red and blue pixels.
    spread = np.linalg.norm(white.array * np.array(white.rel_std), axis=1)[total > 0] / total[total > 0]
    gain = np.array(record.flat_field.gain)
    return [
        Figure(
            name="saturated pixels",
            value=100 * record.saturated_share,
            unit="%",
            high=0.1,
            advice="Close the aperture or move the target away; the shortest exposure is too bright.",
        ),
        Figure(
            name="middle filled by the Spectralon",
            value=100 * record.filled_share,
            unit="%",
            low=90.0,
            advice="Move the Spectralon so that it fills the middle half of the picture.",
        ),
        Figure(
            name="tilt of the Spectralon",
            value=record.plane.tilt_deg,
            unit="degrees",
            high=MAX_TILT_DEG,
            advice="Turn the Spectralon to face the camera.",
        ),
        Figure(
            name="unevenness after the flat field",
            value=100 * record.unevenness,
            unit="%",
            high=UNEVEN_PERCENT,
            advice="Take the film off, clean the Spectralon and the lens, and avoid shadows and reflections.",
        ),
        Figure(
            name="white over red + green + blue in the pictures, largest difference",
            value=100 * worst,
            unit="%",
            high=2.0,
            advice="Switch off the projector's colour enhancement.",
        ),
        Figure(
            name="deviation of white",
            value=100 * float(spread.max()),
            unit="%",
            high=0.5,
            advice="Fill more of the picture with the Spectralon and expose longer.",
        ),
        Figure(name="range of the flat field", value=100 * float(np.ptp(gain)), unit="%"),
        *_beyond_target(record),
        *light_change_figure(record.light_change),
        *bulge_figure("bulge of the Spectralon over 300 mm", record.bulge_mm, BULGE_MM),
        Figure(
            name="stated reflectance of the Spectralon, which no picture shows",
            value=100 * float(np.mean(record.reflectance.values)),
            unit="%",
            std=100 * record.reflectance_rel_std * float(np.mean(record.reflectance.values)),
        ),
    ]


def _beyond_target(record: SpectralonCalibration) -> tuple[Figure, ...]:
    """How well the flat field is known where the target did not reach; none in older records."""
    if record.flat_field_unsure is None:
        return ()
    return (
        Figure(
            name="deviation of the flat field, where it is known least",
            value=100 * record.flat_field_unsure,
            unit="%",
            high=GAIN_PERCENT,
            advice="The Spectralon fills too little of the picture, and the camera's gain beyond it is a"
            " guess. Place it nearer to the camera (depth_mm), use a larger one, or trust no reflectance"
            " beyond the part of the picture that it filled.",
        ),
    )
