"""White signals and evenness from uniform pictures of a Spectralon, and a rig that reproduces the whites."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.plane import TargetPlane
from dsl_core.calibration.common.spectral_nodes import NODES_NM
from dsl_core.calibration.light.spectral_refinement import FINE_NM
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import (
    MeasuredEmission,
    PlaneQuality,
    SpectralonCalibration,
    Square3,
    WhiteSignals,
)
from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.geometry import Row3
from dsl_core.model.rig import FlatField, Rgb, Rig, Sensor
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels, gain_at_pixels
from dsl_core.solve.robust import rms
from dsl_core.solve.smooth_functions import hat_functions

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Blocks along each side whose scatter gives the deviation of a mean.
BLOCKS = 6
#: A pixel this far (relative) from the smooth course of its colour is dirt, a mark, or outside the target.
OFF_COURSE, COURSE_ROUNDS = 0.2, 10
MIN_PIXELS = 400
#: Nodes over rows and columns, and blocks per node that the residual is judged by.
NODES = (9, 13)
BLOCKS_PER_NODE = 3
#: Weight of third differences between nodes against a block: noise should not bend the grid; vignetting,
#: which is quadratic, costs nothing.
STIFFNESS = 3.0
#: Error of straight pieces through a parabola, rms over the pieces, as a share of its second difference:
#: least squares leaves ``(t**2 - t + 1/6) / 2`` of it along a piece.
STRAIGHT_PIECES = 0.5 / np.sqrt(180.0)
#: Signals of a channel under an LED with a larger relative deviation say nothing of the response's shape.
TRUSTED = 0.02
#: Curvature against which a level counts: small, so that only the shape is kept smooth.
LEVEL_WEIGHT = 1e-4
ITERATIONS = 100
#: Share of what is missed that a step has to gain, and the least part of one that is tried.
NEARER, LEAST_PART = 0.1, 1e-3


@dataclass(frozen=True)
class UniformPictures:
    """Linear radiance (DN per ms at full drive) of red, green, blue and white pictures.

    ``radiance`` (4, rows, columns) are mosaics, black subtracted; ``saturated`` (rows, columns) in any.
    ``shading`` (rows, columns) is that of the target's plane, ``usable`` where it is and is lit.
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
    used = good & _near_course(flat[3], channel, good)
    if used.sum() < MIN_PIXELS:
        raise CalibrationError(
            f"Only {int(used.sum())} pixels of the Spectralon are lit, even and unsaturated. Place it in the"
            " middle of the picture at the distance of the scans and shorten the exposure."
        )
    relative = np.full(channel.shape, np.nan)
    for c in mosaic_colours(pictures.sensor.bayer):
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
    found: TargetPlane,
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


def _near_course(white: Floats, channel: NDArray[np.int64], good: Mask) -> Mask:
    """Pixels near a quadratic over the image, common to all colours: strong vignetting is no dirt."""
    relative = np.full(good.shape, np.nan)
    for c in range(3):
        of_colour = good & (channel == c)
        if of_colour.any():
            relative[of_colour] = white[of_colour] / max(float(np.median(white[of_colour])), 1e-12)
    rows, columns = np.nonzero(good)
    y, x = rows / good.shape[0] - 0.5, columns / good.shape[1] - 0.5
    terms, value = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], 1), relative[good]
    course = np.ones(len(value))
    for _ in range(COURSE_ROUNDS if len(value) >= MIN_PIXELS else 0):
        # Cauchy weights: what is far off pulls no more.
        weight = 1 / (1 + ((value - course) / OFF_COURSE) ** 2)
        fit = np.linalg.solve((terms.T * weight) @ terms + 1e-9 * np.eye(6), (terms.T * weight) @ value)
        course = np.maximum(terms @ fit, 0.05)
    near = np.zeros(good.shape, bool)
    near[good] = np.abs(value / course - 1) < OFF_COURSE
    return near


def _signals(flat: Floats, channel: NDArray[np.int64], used: Mask) -> WhiteSignals:
    """Means over pixels and, from the scatter of blocks, their deviations; zeros of missing colours."""
    block = _block_of(used.shape)
    signal, std = np.zeros((3, 4)), np.zeros((3, 4))
    seen = np.unique(channel)
    for c in seen:
        of_colour = used & (channel == c)
        for picture in range(4):
            signal[c, picture], std[c, picture] = _mean(flat[picture][of_colour], block[of_colour])
    if not (signal[seen, 3] > 0).all():
        raise CalibrationError("The Spectralon is not brighter under white than under black.")
    over_sum = np.ones(3)
    over_sum[seen] = signal[seen, 3] / signal[seen, :3].sum(1)
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


@dataclass(frozen=True)
class Evenness:
    """A flat field, its deviations, reduced chi-square of an even camera, rms of blocks about it.

    The deviations are those of the gain at pixels around each node: noise, and what a grid leaves of a gain
    that is curved between its nodes.
    """

    flat_field: FlatField
    std: tuple[tuple[float, ...], ...]
    chi_square: float
    residual: float


def fit_evenness(relative: Floats, usable: Mask) -> Evenness:
    """Bilinear grid through values (rows, columns) that would all be one, mean one over the usable pixels.

    Pixels are averaged in blocks first: their noise, and whatever repeats from pixel to pixel, averages out,
    and the scatter of blocks about the grid gives honest deviations.
    """
    rows_px, columns_px = (np.linspace(0, n - 1, k) for n, k in zip(relative.shape, NODES, strict=True))
    row, column, value, count = _blocks(relative, usable)
    weight = np.sqrt(count / count.mean())
    design = hat_functions(row, rows_px)[:, :, None] * hat_functions(column, columns_px)[:, None, :]
    design = design.reshape(len(value), -1)
    rough = _roughness() * np.sqrt(STIFFNESS)
    left = np.concatenate([design * weight[:, None], rough])
    right = np.concatenate([value * weight, np.zeros(len(rough))])
    gain, *_ = np.linalg.lstsq(left, right, rcond=None)
    # A node that few blocks hold may be extrapolated far below them all, even below zero.
    gain = np.maximum(gain, 0.5 * value.min())
    residual = (value - design @ gain) * weight
    freedom = max(len(value) - gain.size, 1)
    variance = float((residual**2).sum() / freedom)
    std = np.sqrt(variance * np.diag(np.linalg.inv(left.T @ left)))
    mean = float(np.average(design @ gain, weights=count))
    even = float((((value - np.average(value, weights=count)) * weight) ** 2).sum() / max(len(value) - 1, 1))
    flat_field = FlatField(
        rows_px=tuple(rows_px.tolist()), columns_px=tuple(columns_px.tolist()), gain=_rows(gain / mean)
    )
    chi_square = even / variance if variance > 0 else 1.0
    std = np.hypot(std, _between_nodes(gain))
    return Evenness(flat_field, _rows(std / mean), chi_square, float(np.sqrt(variance)))


def _blocks(relative: Floats, usable: Mask) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean position (px), mean value and number of pixels of blocks that hold enough."""
    rows, columns = np.nonzero(usable)
    down, across = (BLOCKS_PER_NODE * k for k in NODES)
    block = (rows * down // relative.shape[0]) * across + columns * across // relative.shape[1]
    count = np.bincount(block, minlength=down * across).astype(float)
    keep = count > 0.2 * count.max()
    sums = [
        np.bincount(block, v, down * across)[keep] / count[keep] for v in (rows, columns, relative[usable])
    ]
    return sums[0], sums[1], sums[2], count[keep]


def _roughness() -> Floats:
    """Third differences of the grid along rows and columns, one per row."""
    down, across = NODES
    d, a = np.diff(np.eye(down), 3, axis=0), np.diff(np.eye(across), 3, axis=0)
    return np.concatenate([np.kron(d, np.eye(across)), np.kron(np.eye(down), a)])


def _between_nodes(gain: Floats) -> Floats:
    """Interpolation error (nodes,) of a bilinear grid by its second differences, rms around each node."""
    grid = gain.reshape(NODES)
    inside = np.diff(grid, 2, axis=0), np.diff(grid, 2, axis=1)
    down, across = np.pad(inside[0], ((1, 1), (0, 0)), "edge"), np.pad(inside[1], ((0, 0), (1, 1)), "edge")
    return np.asarray(STRAIGHT_PIECES * np.hypot(down, across).ravel())


def _rows(values: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.reshape(NODES).tolist())


def match_whites(rig: Rig, white: WhiteSignals, reflectance: SpectralCurve) -> Rig:
    """The rig with responses and white scale that reproduce white signals, nothing else changed.

    Each response is multiplied by the smoothest factor (least squared gradient of its logarithm) that gives
    the channel's signal under every LED; the three responses keep the sum of their integrals, and the white
    scale takes the rest. A rig that gives the signals already is returned unchanged.
    """
    emission = np.stack([curve.at(FINE_NM) for curve in rig.emission]) * reflectance.at(FINE_NM)
    start = np.stack([curve.at(FINE_NM) for curve in rig.response])
    matched = np.stack(
        [
            _matched(start[c], rig.white_scale * emission, white.array[c], np.array(white.rel_std[c]))
            for c in range(3)
        ]
    )
    scale = float(matched.sum() / start.sum())
    red, green, blue = (SpectralCurve.of(FINE_NM, curve / scale) for curve in matched)
    response: Rgb = (red, green, blue)
    # Where white is not the sum of its LEDs, by noise or else, no signal is better known than that.
    std = float(np.hypot(_white_std(white).mean(), rms(np.array(white.white_over_sum) - 1)))
    return rig.model_copy(
        update={"response": response, "white_scale": rig.white_scale * scale, "white_scale_rel_std": std}
    )


def _white_std(white: WhiteSignals) -> Floats:
    """Relative deviation of each channel's signal under all LEDs, (3,), or (1,) of a monochrome camera."""
    seen = white.array.sum(1) > 0
    spread = white.array * np.array(white.rel_std)
    return np.asarray(np.linalg.norm(spread[seen], axis=1) / white.array[seen].sum(1))


def _matched(response: Floats, lights: Floats, wanted: Floats, rel_std: Floats) -> Floats:
    """A response (wavelengths,) times the smoothest factor that gives ``wanted`` under ``lights``."""
    hats = hat_functions(FINE_NM, NODES_NM).T
    used = (wanted > 0) & (rel_std < TRUSTED) & (lights @ response > 0)
    gradient = np.diff(np.eye(len(NODES_NM)), axis=0)
    stiff = np.linalg.inv(gradient.T @ gradient + LEVEL_WEIGHT * np.eye(len(NODES_NM)))

    def at(factor: Floats) -> tuple[Floats, Floats]:
        density = lights[used] * (response * np.exp(factor @ hats))
        signal = density.sum(1)
        return np.log(wanted[used] / signal), density @ hats.T / signal[:, None]

    factor = np.zeros(len(NODES_NM))
    miss, share = at(factor)
    for _ in range(ITERATIONS):
        if np.abs(miss).max(initial=0.0) < 1e-12:
            break
        # The smoothest factor that meets all signals to first order, seen from the start.
        met = stiff @ share.T @ np.linalg.solve(share @ stiff @ share.T, miss + share @ factor)
        factor, miss, share = _towards(factor, met, miss, at)
    return np.asarray(response * np.exp(factor @ hats))


def _towards(
    factor: Floats, met: Floats, miss: Floats, at: Callable[[Floats], tuple[Floats, Floats]]
) -> tuple[Floats, Floats, Floats]:
    """A step from one factor to another that brings signals nearer, with what is missed ``at`` it.

    All the way, unless signals are so far off, as leaks that a data sheet rounds off, that it misses more.
    """
    part, largest = 1.0, np.abs(miss).max()
    while True:
        there = factor + part * (met - factor)
        after, share = at(there)
        if np.abs(after).max() < (1 - NEARER * part) * largest or part < LEAST_PART:
            return there, after, share
        part /= 2
