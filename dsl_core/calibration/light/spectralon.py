"""White signals and evenness from uniform pictures of a Spectralon whose plane is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.plane import PlaneFit
from dsl_core.calibration.light.evenness import Evenness, fit_evenness
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import (
    MeasuredEmission,
    PlaneQuality,
    Row3,
    SpectralonCalibration,
    Square3,
    WhiteSignals,
)
from dsl_core.model.rig import Sensor
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.flat_field import gain_at_pixels
from dsl_core.optics.sensor import bayer_channels

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Blocks along each side whose scatter gives the deviation of a mean.
BLOCKS = 6
#: A pixel this far (relative) from the median of its colour is dirt, a mark, or beside the target.
OFF_MEDIAN = 0.2
MIN_PIXELS = 400


@dataclass(frozen=True)
class UniformPictures:
    """Linear radiance (DN per ms at full drive) of red, green, blue and white pictures.

    ``radiance`` (4, rows, columns) are mosaics, black subtracted; ``saturated`` (rows, columns) in any.
    ``shading`` (rows, columns) is that of the target's plane, ``usable`` where it lies and is lit.
    """

    radiance: Floats
    saturated: Mask
    shading: Floats
    usable: Mask
    sensor: Sensor


@dataclass(frozen=True)
class WhiteMeasurement:
    """White signals, the smooth gain of the camera, and the pixels that both rest on."""

    white: WhiteSignals
    evenness: Evenness
    used: Mask


def measure_white(pictures: UniformPictures) -> WhiteMeasurement:
    """Signals at unit shading per channel and LED, and evenness; raises `CalibrationError` without light."""
    channel = bayer_channels(pictures.sensor.bayer, *pictures.shading.shape)
    flat = pictures.radiance / np.where(pictures.shading > 0, pictures.shading, np.nan)
    good = pictures.usable & ~pictures.saturated & np.isfinite(flat).all(0)
    used = good & _near_median(flat[3], channel, good)
    if used.sum() < MIN_PIXELS:
        raise CalibrationError(
            f"Only {int(used.sum())} pixels of the Spectralon are lit, even and unsaturated. Place it in the"
            " middle of the picture at the distance of the scans and shorten the exposure."
        )
    relative = np.full(channel.shape, np.nan)
    for c in range(3):
        of_colour = used & (channel == c)
        relative[of_colour] = flat[3][of_colour] / flat[3][of_colour].mean()
    evenness = fit_evenness(relative, used)
    flat = flat / gain_at_pixels(evenness.flat_field, *used.shape)
    return WhiteMeasurement(_signals(flat, channel, used), evenness, used)


def spectralon_calibration(
    reflectance: SpectralCurve,
    emission: MeasuredEmission,
    pictures: UniformPictures,
    measured: WhiteMeasurement,
    found: PlaneFit,
    region: Mask,
) -> SpectralonCalibration:
    """The record of all that was found; shares are of ``region`` (rows, columns)."""
    evenness = measured.evenness
    return SpectralonCalibration(
        reflectance=reflectance,
        emission=emission,
        white=measured.white,
        plane=PlaneQuality(
            distance_mm=found.plane.distance_mm, tilt_deg=found.plane.tilt_deg, rms_mm=found.rms_mm
        ),
        saturated_share=float(pictures.saturated[region].mean()),
        filled_share=float(measured.used[region].mean()),
        unevenness=evenness.residual,
        flat_field=evenness.flat_field,
        flat_field_std=evenness.std,
        flat_field_chi_square=evenness.chi_square,
    )


def _near_median(white: Floats, channel: NDArray[np.int64], good: Mask) -> Mask:
    near = np.zeros(good.shape, bool)
    for c in range(3):
        of_colour = good & (channel == c)
        if of_colour.any():
            middle = float(np.median(white[of_colour]))
            near |= of_colour & (np.abs(white - middle) < OFF_MEDIAN * abs(middle))
    return near


def _signals(flat: Floats, channel: NDArray[np.int64], used: Mask) -> WhiteSignals:
    """Means over pixels and, from the scatter of blocks, their deviations."""
    block = _block_of(used.shape)
    signal, std = np.empty((3, 4)), np.empty((3, 4))
    for c in range(3):
        of_colour = used & (channel == c)
        for picture in range(4):
            signal[c, picture], std[c, picture] = _mean(flat[picture][of_colour], block[of_colour])
    if not (signal[:, 3] > 0).all():
        raise CalibrationError("The Spectralon is not brighter under white than under black.")
    over_sum = signal[:, 3] / signal[:, :3].sum(1)
    relative = std[:, :3] / np.maximum(np.abs(signal[:, :3]), 1e-12)
    return WhiteSignals(
        signal=_square(np.maximum(signal[:, :3], 0)), rel_std=_square(relative), white_over_sum=_row(over_sum)
    )


def _block_of(shape: tuple[int, ...]) -> NDArray[np.int64]:
    rows, columns = (np.arange(n) * BLOCKS // n for n in shape)
    return np.asarray(rows[:, None] * BLOCKS + columns)


def _mean(values: Floats, block: NDArray[np.int64]) -> tuple[float, float]:
    """Mean, and its deviation from the scatter of the means of blocks."""
    count = np.bincount(block, minlength=BLOCKS**2).astype(float)
    held = count > 0.2 * count.max()
    means = np.bincount(block, values, BLOCKS**2)[held] / count[held]
    mean = float(values.mean())
    scatter = float(np.average((means - mean) ** 2, weights=count[held]))
    return mean, float(np.sqrt(scatter / max(held.sum() - 1, 1)))


def _row(values: Floats) -> Row3:
    return float(values[0]), float(values[1]), float(values[2])


def _square(values: Floats) -> Square3:
    return _row(values[0]), _row(values[1]), _row(values[2])
