"""The spot of the scene that a pixel of the camera sees, measured and taken out of depth.

A pixel sees its own area through the blur of the lens. Where the surface is brighter on one side of that
spot, its light comes from there, and its column is that of a place next to the pixel. For a spot of variance
``s^2`` that place is ``s^2`` times the gradient of the logarithm of the picture away: exactly so for a
Gaussian (Robbins, An Empirical Bayes Approach to Statistics, 1956), whatever the surface looks like. So
columns across edges of brightness say how large the spot is, and then by how much each column is displaced.

Spectra are not concerned: all orders of a pixel come from the same place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.solve.robust import NORMAL, weighted_median

Map = NDArray[np.float64]

#: Slope of a ramp from seven neighbours, of one colour each, in a mosaic: those of the own colour give the
#: level, those of the other how it bends between them.
MOSAIC_SLOPE = np.array([0.125, -0.25, -0.375, 0.0, 0.375, 0.25, -0.125])
PLAIN_SLOPE = np.array([-0.5, 0.0, 0.5])
#: Pixels on a side over which the steps of columns are averaged.
SLOPE_WINDOW_PX = 9
#: Light below so many of its deviations counts as that.
DARK_SIGMAS = 2.0
#: Light comes from within so many rms widths of the spot.
FARTHEST = 2.0
#: Pixels tell of a spot that one of so large a variance (px^2) would displace by more than their noise.
TELLING_PX2 = 0.3
#: No pixel is displaced farther from its neighbours than this; beyond is another surface, px.
LONGEST_PX = 4.0
#: With fewer pixels nobody can tell.
FEWEST = 200
#: Each column is in three of the differences, and the deviation of a median is larger than that of a mean.
SHARED, MEDIAN_STD = 3.0, (np.pi / 2) ** 0.5
#: Variance of a spot that matters for depth (px^2), and how many deviations it must have.
LEAST_PX2, SIGMAS = 0.02, 4.0
#: Rms width of a spot beyond which a camera is out of focus, px: sharp edges of small spots are seen too
#: coarsely, so that an even pixel alone (0.29 px) seems to have half of that.
SHARP_PX = 0.35
#: Window over which the largest displacement says how unsure all are, px.
BESIDE_PX = 3
#: Same-colour neighbours in a row, px away.
NEXT_PX = 2


@dataclass(frozen=True)
class CameraSpot:
    """The variance of the spot along rows or columns of the picture, with its deviation (px^2).

    ``doubt`` is how far a displacement may be off, as a share of it; ``columns_px`` the rms width of the
    spot on the projector, in columns.
    """

    variance_px2: float
    std_px2: float
    doubt: float
    columns_px: float

    @property
    def present(self) -> bool:
        """Whether it matters and is not chance."""
        return self.variance_px2 > max(LEAST_PX2, SIGMAS * self.std_px2)

    @property
    def rms_px(self) -> float:
        """Rms width, px of the camera."""
        return math.sqrt(max(self.variance_px2, 0.0))

    @property
    def rms_std_px(self) -> float:
        """Deviation of the rms width."""
        return self.std_px2 / (2 * max(self.rms_px, math.sqrt(self.std_px2), 1e-9))


def follow_spot(
    rig: Rig, lines: LineSet | None, geometry: Geometry, window_px: int | None = None
) -> tuple[Geometry, CameraSpot | None]:
    """Geometry without what the spot of a pixel displaces, where it matters, and the spot.

    None where columns do not come from single lines, and where too few pixels show anything. ``window_px`` is
    that of `dsl_core.reconstruction.geometry.reconstruct_geometry`.
    """
    from scipy.ndimage import maximum_filter

    if lines is None or not lines.single:
        return geometry, None
    slopes = light_slopes(geometry.amplitude, geometry.amplitude_std, rig.sensor.bayer == "MONO")
    steps = column_slopes(geometry.column_px)
    found = fit_spot(rig, geometry, (slopes * steps).sum(0), steps[0])
    if found is None or not found.present:
        return geometry, found
    farthest = FARTHEST / max(found.rms_px, 1e-6)
    displaced = found.variance_px2 * (slopes.clip(-farthest, farthest) * steps).sum(0)
    displaced = np.nan_to_num(displaced).astype(np.float32)
    # A slope that is zero at the middle of a thin line is no surer than those on either side.
    unsure = found.doubt * maximum_filter(np.abs(displaced), BESIDE_PX)
    return geometry.displaced(rig, displaced, unsure, window_px), found


def light_slopes(amplitude: NDArray[np.floating], std: NDArray[np.floating], plain: bool = False) -> Map:
    """Gradient of the logarithm of the light (rows, columns), across and down, (2, rows, columns), 1/px.

    ``std`` is the deviation of the light. Each pixel has one colour of a mosaic, unless it is ``plain``.
    """
    from scipy.ndimage import correlate1d

    floor = DARK_SIGMAS * np.where(np.isfinite(std), std, 0.0)
    known = np.isfinite(amplitude)
    least = np.maximum(floor, 1e-6 * np.max(amplitude, initial=0.0, where=known) + 1e-30)
    log = np.log(np.where(known, np.maximum(amplitude, least), np.nan))
    weights = PLAIN_SLOPE if plain else MOSAIC_SLOPE
    return np.stack([correlate1d(log, weights, axis, mode="mirror") for axis in (1, 0)])


def column_slopes(column_px: NDArray[np.floating]) -> Map:
    """By how much columns (rows, columns) change from pixel to pixel, across and down, around each.

    Shape (2, rows, columns), px of the projector a px; NaN where nothing is known.
    """
    import cv2

    found = []
    for axis in (1, 0):
        step = np.full(column_px.shape, np.nan)
        middle = [slice(None), slice(None)]
        middle[axis] = slice(1, -1)
        high, low = ([slice(None), slice(None)] for _ in range(2))
        high[axis], low[axis] = slice(2, None), slice(None, -2)
        step[tuple(middle)] = 0.5 * (column_px[tuple(high)] - column_px[tuple(low)])
        finite = step[np.isfinite(step)]
        usual = float(np.median(finite)) if finite.size else np.nan
        with np.errstate(invalid="ignore"):
            known = np.isfinite(step) & (np.abs(step - usual) < LONGEST_PX)
        size = (SLOPE_WINDOW_PX, SLOPE_WINDOW_PX)
        total, count = (
            cv2.boxFilter(values, cv2.CV_64F, size, normalize=False, borderType=cv2.BORDER_CONSTANT)
            for values in (np.where(known, step, 0.0), known.astype(np.float64))
        )
        found.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    return np.stack(found)


def fit_spot(rig: Rig, geometry: Geometry, pull: Map, across: Map) -> CameraSpot | None:
    """The spot by which columns are displaced; None where too few pixels tell.

    ``pull`` (rows, columns) is what a spot of one square pixel would displace each column by (px), ``across``
    the step of columns from pixel to pixel in a row.
    """
    doubtful = int(Flag.NOT_REFINED | Flag.UNUSUAL_PEAK)
    usable = np.isfinite(geometry.depth_mm) & ((geometry.flags & doubtful) == 0)
    column = np.where(usable, geometry.column_px, np.nan).astype(np.float64)
    away, pulled, noise = _bend(column), _bend(pull), geometry.column_std_px[:, NEXT_PX:-NEXT_PX]
    # Far from the neighbours is another surface.
    with np.errstate(invalid="ignore"):
        telling = (np.abs(away) < LONGEST_PX) & (np.abs(pulled) * TELLING_PX2 > noise)
    if np.count_nonzero(telling) < FEWEST:
        return None
    away, pulled = away[telling], pulled[telling]
    ratio, weight = away / pulled, np.abs(pulled)
    variance = weighted_median(ratio, weight)
    scatter = weighted_median(np.abs(ratio - variance), weight)
    many = weight.sum() ** 2 / (weight**2).sum() / SHARED
    found = CameraSpot(
        variance,
        NORMAL * MEDIAN_STD * scatter / float(np.sqrt(many)),
        0.0,
        max(variance, 0.0) ** 0.5 * float(np.nanmedian(np.abs(across[usable]))),
    )
    return replace(found, doubt=min(NORMAL * scatter / variance, 1.0)) if found.present else found


def _bend(values: Map) -> Map:
    """How far values (rows, columns) are from the middle of their neighbours of the same colour in a row."""
    return np.asarray(
        values[:, NEXT_PX:-NEXT_PX] - 0.5 * (values[:, : -2 * NEXT_PX] + values[:, 2 * NEXT_PX :])
    )


def spot_finding(found: CameraSpot) -> FitFinding:
    """What the scan says about the sharpness of its camera."""
    return FitFinding.judged(
        "focus",
        "spot that a camera pixel sees",
        (found.variance_px2, found.std_px2),
        "px2",
        SHARP_PX**2,
        f"The camera is out of focus: its pixels see a spot of {found.rms_px:.2f} ± {found.rms_std_px:.2f} px"
        " (rms). Depths along edges of brightness are corrected for it; spectra there are of both sides.",
        "Focus the camera on the object, or narrow its aperture.",
    )
