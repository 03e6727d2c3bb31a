"""The classic chart in a picture: found, turned upright, and its patches measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.charts import CHART_SHAPE
from dsl_core.optics.demosaic import demosaic
from dsl_core.optics.sensor import bayer_channels
from dsl_core.solve.robust import robust_std

Floats = NDArray[np.float64]

#: Inner part of a patch that is measured: half width as a share of the distance between patches.
INNER = 0.28
#: Mean logarithmic distance of measured from expected colours: above it, it is not this chart.
NOT_THIS_CHART = 0.35
#: The next best orientation must be this many times farther off.
CLEARLY = 1.5
MIN_PIXELS = 12
#: Half width of the part of a patch that must be even, as a share of the distance between patches; samples
#: along each side of it.
EVEN_PART, SAMPLES = 0.40, 9
#: Largest move of a corner, as a share of the distance between patches.
CORNER_REACH = 0.3


@dataclass(frozen=True)
class ChartPose:
    """Where the chart is in a picture.

    ``corners_px`` (4, 2) are column and row of the outer corners of the grid of patches: at the first
    patch (dark skin), the sixth (bluish green), the last (black) and the nineteenth (white).
    ``quarter_turns`` says how far the chart is turned clockwise, to the nearest right angle.
    """

    corners_px: Floats
    quarter_turns: int


@dataclass(frozen=True)
class PatchSamples:
    """Pixels of the inner part of each patch, as flat indices into the picture, in reading order."""

    pixels: tuple[NDArray[np.int64], ...]


def chart_picture(mosaic: NDArray[np.floating], bayer: BayerPattern) -> NDArray[np.uint8]:
    """A picture for chart detection, shape (rows, columns, 3), blue first, from a linear mosaic.

    Channels are balanced by their bright end and encoded by a gamma of 2.2, as detectors expect.
    """
    rgb = np.moveaxis(np.asarray(demosaic(mosaic, bayer), np.float64), 0, -1)
    bright = np.maximum(np.percentile(rgb, 99, axis=(0, 1)), 1e-12)
    encoded = 255 * np.clip(rgb / bright, 0, 1) ** (1 / 2.2)
    return np.ascontiguousarray(encoded.astype(np.uint8)[..., ::-1])


def find_chart(mosaic: NDArray[np.floating], bayer: BayerPattern, expected: Floats, name: str) -> ChartPose:
    """Find the chart in any orientation; ``expected`` (24, 3) are its colours up to one scale a channel.

    Raises `CalibrationError` that calls the picture ``name`` when there is no chart, or a different one.
    """
    picture = chart_picture(mosaic, bayer)
    centres = _detected_centres(picture)
    if centres is None:
        raise CalibrationError(
            f"No Color Checker was found in {name}. Place the chart so that all 24 patches are in view, lit"
            " evenly and not saturated; or give its four corners."
        )
    corners = apply_homography(homography(_grid_centres(), centres), grid_corners())
    corners = align_corners(picture, corners)
    return orient_chart(mosaic, bayer, corners, expected, name)


def orient_chart(
    mosaic: NDArray[np.floating], bayer: BayerPattern, corners_px: Floats, expected: Floats, name: str
) -> ChartPose:
    """The pose whose corners are the four given, in cyclic order from any start, decided by colours.

    For corners that a person has set. Raises `CalibrationError` when no order gives the chart's colours, or
    only a mirrored one does.
    """
    orders = [np.roll(order, turn, axis=0) for order in (corners_px, corners_px[::-1]) for turn in range(4)]
    distances = [_colour_distance(mosaic, bayer, order, expected) for order in orders]
    best, second = np.argsort(distances)[:2]
    corners, distance = orders[best], distances[best]
    if not np.isfinite(distance):
        raise CalibrationError(
            f"Patches of the Color Checker in {name} are outside the picture or too small. Place the chart so"
            " that all 24 patches are in view, or correct its corners."
        )
    if not (distance < NOT_THIS_CHART and distances[second] > CLEARLY * distance):
        raise CalibrationError(
            f"What was found in {name} does not have the colours of a classic Color Checker in any"
            f" orientation (mean difference {100 * np.expm1(distance):.0f} %). Check that it is the classic"
            " chart of 24 patches, that nothing covers some of them, that its corners are right, and that the"
            " picture is not mirrored and no colours are swapped."
        )
    if _signed_area(corners) < 0:
        raise CalibrationError(
            f"The Color Checker in {name} is mirrored. Switch off the mirroring of the camera's picture."
        )
    along = corners[1] - corners[0]
    turns = round(float(np.degrees(np.arctan2(along[1], along[0]))) / 90) % 4
    return ChartPose(corners, turns)


def patch_samples(corners_px: Floats, shape: tuple[int, int]) -> PatchSamples:
    """Inner pixels of the 24 patches in a picture of ``shape``; raises `CalibrationError` when cut off."""
    to_picture = homography(grid_corners(), corners_px)
    to_grid: Floats = np.linalg.inv(to_picture).astype(np.float64)
    picked = []
    for index, centre in enumerate(_grid_centres()):
        pixels = _inside(to_picture, to_grid, centre, shape)
        if len(pixels) < MIN_PIXELS:
            raise CalibrationError(
                f"Patch {index + 1} of the Color Checker is outside the picture or too small"
                f" ({len(pixels)} pixels). Move the chart into view, closer, or set its corners."
            )
        picked.append(pixels)
    return PatchSamples(tuple(picked))


@dataclass(frozen=True)
class PatchSignals:
    """Per patch and channel: robust mean, its deviation, number of pixels, and share of saturated ones.

    Arrays of shape (24, 3); mean and deviation in the unit of the picture.
    """

    mean: Floats
    std: Floats
    count: NDArray[np.int64]
    saturated: Floats


def patch_signals(
    mosaic: NDArray[np.floating], saturated: NDArray[np.bool_], bayer: BayerPattern, samples: PatchSamples
) -> PatchSignals:
    """Statistics of a linear mosaic (rows, columns) over the patches.

    The mean is that of the values within four robust deviations of the median, so that dust and hot pixels
    do not count; saturated pixels never do.
    """
    channel = bayer_channels(bayer, *mosaic.shape).ravel()
    flat, full = mosaic.ravel(), saturated.ravel()
    shape = (len(samples.pixels), 3)
    mean, std = np.full(shape, np.nan), np.full(shape, np.nan)
    count, share = np.zeros(shape, np.int64), np.zeros(shape)
    for p, pixels in enumerate(samples.pixels):
        for c in range(3):
            own = pixels[channel[pixels] == c]
            share[p, c] = full[own].mean() if len(own) else 0.0
            values = flat[own[~full[own]]].astype(float)
            if len(values) >= 3:
                mean[p, c], std[p, c], count[p, c] = _robust_mean(values)
    return PatchSignals(mean, std, count, share)


def _robust_mean(values: Floats) -> tuple[float, float, int]:
    middle = np.median(values)
    spread = float(robust_std(values - middle))
    kept = values[np.abs(values - middle) <= 4 * max(spread, 1e-12)]
    return float(kept.mean()), float(kept.std(ddof=1) / np.sqrt(len(kept))), len(kept)


def _detected_centres(picture: NDArray[np.uint8]) -> Floats | None:
    """Centres (24, 2) of the patches as OpenCV's detector orders them, None without a chart."""
    import cv2

    mcc: Any = cv2.mcc  # its functions differ between OpenCV 4 and 5
    make = getattr(mcc, "CCheckerDetector_create", None) or mcc.CCheckerDetector.create
    detector = make()
    if hasattr(detector, "setColorChartType"):
        detector.setColorChartType(mcc.MCC24)
        found = detector.process(picture, 1)
    else:
        found = detector.process(picture, mcc.MCC24, 1)
    if not found:
        return None
    quads = np.asarray(detector.getBestColorChecker().getColorCharts(), float).reshape(-1, 4, 2)
    return quads.mean(1) if len(quads) == CHART_SHAPE[0] * CHART_SHAPE[1] else None


def _colour_distance(
    mosaic: NDArray[np.floating], bayer: BayerPattern, corners: Floats, expected: Floats
) -> float:
    """Mean logarithmic distance of the patches from expected colours, a scale a channel left free."""
    try:
        samples = patch_samples(corners, (mosaic.shape[0], mosaic.shape[1]))
    except CalibrationError:
        return np.inf
    none = np.zeros(mosaic.shape, bool)
    measured = patch_signals(mosaic, none, bayer, samples).mean
    floor = 0.01 * np.nanmax(measured, axis=0)
    ratio = np.log(np.maximum(measured, floor)) - np.log(np.maximum(expected, 0.01 * expected.max(0)))
    if not np.isfinite(ratio).all():
        return np.inf
    return float(np.abs(ratio - np.median(ratio, axis=0)).mean())


def _inside(to_picture: Floats, to_grid: Floats, centre: Floats, shape: tuple[int, int]) -> NDArray[np.int64]:
    """Flat indices of the pixels in the inner part of a patch; none when part of it is out of view."""
    square = centre + INNER * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    outline = apply_homography(to_picture, square)
    low, high = np.floor(outline.min(0)).astype(int), np.ceil(outline.max(0)).astype(int)
    if (low < 0).any() or high[0] >= shape[1] or high[1] >= shape[0]:
        return np.empty(0, np.int64)
    x, y = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
    place = apply_homography(to_grid, np.stack([x.ravel(), y.ravel()], 1).astype(float))
    inside = (np.abs(place - centre) <= INNER).all(1)
    return np.asarray((y.ravel() * shape[1] + x.ravel())[inside], np.int64)


def _signed_area(corners: Floats) -> float:
    """Twice the area of a quadrilateral, positive when its corners run clockwise as seen (rows go down)."""
    x, y = corners.T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def _grid_centres() -> Floats:
    """Centres of the patches in reading order, in units of the distance between patches, (24, 2)."""
    rows, columns = CHART_SHAPE
    return np.array([[i % columns + 0.5, i // columns + 0.5] for i in range(rows * columns)])


def align_corners(picture: NDArray[np.uint8], corners_px: Floats) -> Floats:
    """Corners (4, 2) near those given for which the patches of a picture (rows, columns, 3) are most even.

    A detector's corners are some percent of a patch off; seen from a slightly wrong grid, dark lines between
    patches enter their squares, which this pushes out.
    """
    import cv2
    from scipy.optimize import minimize

    points = _sample_points()
    pitch = np.linalg.norm(corners_px[1] - corners_px[0]) / CHART_SHAPE[1]
    image = picture.astype(np.float32)

    def unevenness(shift: Floats) -> float:
        to_picture = homography(grid_corners(), corners_px + pitch * shift.reshape(4, 2))
        at = apply_homography(to_picture, points).astype(np.float32)
        values = cv2.remap(
            image, at[:, :1], at[:, 1:], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0
        )
        patches = np.asarray(values, np.float64).reshape(-1, SAMPLES**2, 3)
        return float(patches.std(1).mean())

    found = minimize(
        unevenness,
        np.zeros(8),
        method="Powell",
        bounds=[(-CORNER_REACH, CORNER_REACH)] * 8,
        options={"xtol": 1e-3},
    )
    return corners_px + pitch * np.asarray(found.x).reshape(4, 2)


def grid_corners() -> Floats:
    """Corners of the grid of patches in units of the distance between patches, (4, 2), clockwise."""
    rows, columns = CHART_SHAPE
    return np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], float)


def homography(source: Floats, target: Floats) -> Floats:
    """The homography (3, 3) that takes points (n, 2) to others, best in the sense of least squares."""
    import cv2

    found, _ = cv2.findHomography(source, target)
    return np.asarray(found, float)


def apply_homography(matrix: Floats, points: Floats) -> Floats:
    """Points (n, 2) moved by a homography."""
    lifted = np.concatenate([points, np.ones((len(points), 1))], 1) @ matrix.T
    return np.asarray(lifted[:, :2] / lifted[:, 2:])


def _sample_points() -> Floats:
    """Points of the grid inside all patches in reading order, (24 * SAMPLES**2, 2)."""
    offsets = np.linspace(-EVEN_PART, EVEN_PART, SAMPLES)
    square = np.stack(np.meshgrid(offsets, offsets), -1).reshape(-1, 2)
    return np.concatenate([square + centre for centre in _grid_centres()])
