"""The spot of the scene that a pixel of the camera sees, measured and taken out of depth.

A pixel sees its own area through the blur of the lens. Where the surface is brighter on one side of that
spot, its light comes from there, and its column is that of a place next to the pixel. For a spot of variance
``s^2`` that place is ``s^2`` times the gradient of the logarithm of the picture away: exactly so for a
Gaussian (Robbins, An Empirical Bayes Approach to Statistics, 1956), whatever the surface looks like. So
columns across edges of brightness say how large the spot is, and then by how much each column is displaced.
Where the lens is sharper than the pixels, edges are too sharp for gradients, and the spot is an even pixel
(`light_pull`): what explains the columns better holds.

Spectra are not concerned: all orders of a pixel come from the same place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.figure import with_std
from dsl_core.model.fit import FitFinding
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.light_pull import EVEN_PX2, even_pulls, light_slopes
from dsl_core.solve.normal import MEDIAN_OVER_MEAN_STD, STD_OF_MEDIAN_SIZE
from dsl_core.solve.robust import weighted_median

Map = NDArray[np.float64]

#: Pixels on a side over which the steps of columns are averaged.
SLOPE_WINDOW_PX = 9
#: Light comes from within so many rms widths of the spot.
FARTHEST = 2.0
#: Pixels tell of a spot that one of so large a variance (px^2) would displace by more than their noise.
TELLING_PX2 = 0.3
#: No pixel is displaced farther from its neighbours than this; beyond is another surface, px.
LONGEST_PX = 4.0
#: With fewer pixels nobody can tell.
FEWEST = 200
#: Each column is in three of the differences, and the deviation of a median is larger than that of a mean.
SHARED = 3.0
#: Variance of a spot that matters for depth (px^2), and how many deviations it must have.
LEAST_PX2, SIGMAS = 0.02, 4.0
#: Variance of the spot of a pixel, rms over all between a point and a whole pixel, where it is not measured.
UNMEASURED_PX2 = 3**-0.5 * EVEN_PX2
#: A spot is small whose variance is below this share of a whole pixel's, by so many deviations.
SMALL, SURE_SIGMAS = 0.5, 2.0
#: Rms width of a spot beyond which a camera is out of focus, px: sharp edges of small spots are seen too
#: coarsely, so that an even pixel alone (0.29 px) seems to have half of that.
SHARP_PX = 0.35
#: Window over which the largest displacement says how unsure all are, px.
BESIDE_PX = 3
#: Same-colour neighbours in a row or column, px away.
NEXT_PX = 2


@dataclass(frozen=True)
class CameraSpot:
    """The variance of the spot along rows or columns of the picture, with its deviation (px^2).

    ``doubt`` is how far a displacement may be off, as a share of it; ``columns_px`` the rms width of the
    spot on the projector, in columns. An ``even`` spot is that of a pixel with a sharp lens.
    """

    variance_px2: float
    std_px2: float
    doubt: float
    columns_px: float
    even: bool = False

    @property
    def present(self) -> bool:
        """Whether it matters and is not chance."""
        return self.variance_px2 > max(LEAST_PX2, SIGMAS * self.std_px2)

    @property
    def small(self) -> bool:
        """Whether pixels surely see less than a whole one would."""
        return self.variance_px2 + SURE_SIGMAS * self.std_px2 < SMALL * EVEN_PX2

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
    light = geometry.amplitude, geometry.amplitude_std, rig.sensor.bayer == "MONO"
    steps = column_slopes(geometry.column_px)
    slopes, even = light_slopes(*light), (even_pulls(*light) * steps).sum(0)
    found = fit_spot(rig, geometry, (slopes * steps).sum(0), steps, even)
    if found is None or not found.present:
        small = found is not None and found.small
        return (geometry if small else _unsure(rig, geometry, even, window_px)), found
    farthest = FARTHEST / max(found.rms_px, 1e-6)
    pull = even if found.even else (slopes.clip(-farthest, farthest) * steps).sum(0)
    displaced = np.nan_to_num(found.variance_px2 * pull).astype(np.float32)
    # A slope that is zero at the middle of a thin line is no surer than those on either side.
    unsure = found.doubt * maximum_filter(np.abs(displaced), BESIDE_PX)
    return geometry.displaced(rig, displaced, unsure, window_px), found


def _unsure(rig: Rig, geometry: Geometry, even: Map, window_px: int | None) -> Geometry:
    """Geometry that doubts the columns of pixels which may see an edge, with a spot that nobody measured."""
    unsure = np.nan_to_num(UNMEASURED_PX2 * np.abs(even))
    if not (unsure > geometry.column_std_px).any():
        return geometry
    return geometry.by(rig, unsure, window_px)


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


def fit_spot(
    rig: Rig, geometry: Geometry, soft: Map, steps: Map, even: Map | None = None
) -> CameraSpot | None:
    """The spot by which columns are displaced; None where too few pixels tell.

    ``soft`` and ``even`` (rows, columns) are what a spot of one square pixel would displace each column by
    (px) if it is of that shape, ``steps`` (2, rows, columns) those of columns from pixel to pixel, across and
    down.
    """
    # Beside an edge of depth columns jump or bend by the surface, whatever the spot.
    doubtful = int(Flag.NOT_REFINED | Flag.UNUSUAL_PEAK | Flag.DEPTH_EDGE)
    usable = np.isfinite(geometry.depth_mm) & ((geometry.flags & doubtful) == 0)
    seen = _Bends.of(np.where(usable, geometry.column_px, np.nan), geometry.column_std_px)
    # In a picture of two rows nobody knows how columns change across them.
    known = usable & np.isfinite(steps).any(0)
    columns_px = float(np.median(np.sqrt(np.nansum(steps**2, 0))[known])) if known.any() else 0.0
    found = _fit(seen, soft, TELLING_PX2, columns_px)
    if even is None:
        return found
    other = _fit(seen, even, EVEN_PX2, columns_px)
    if other is None or (found is not None and seen.left(soft, found) <= seen.left(even, other)):
        return found
    return replace(other, even=True)


def _fit(seen: _Bends, pull: Map, telling_px2: float, columns_px: float) -> CameraSpot | None:
    pulled = _bends(pull)
    # Far from the neighbours is another surface.
    with np.errstate(invalid="ignore"):
        telling = seen.near & (np.abs(pulled) * telling_px2 > seen.noise_px)
    if np.count_nonzero(telling) < FEWEST:
        return None
    away, pulled = seen.away_px[telling], pulled[telling]
    ratio, weight = away / pulled, np.abs(pulled)
    variance = weighted_median(ratio, weight)
    scatter = weighted_median(np.abs(ratio - variance), weight)
    many = weight.sum() ** 2 / (weight**2).sum() / SHARED
    found = CameraSpot(
        variance,
        STD_OF_MEDIAN_SIZE * MEDIAN_OVER_MEAN_STD * scatter / float(np.sqrt(many)),
        0.0,
        max(variance, 0.0) ** 0.5 * columns_px,
    )
    return replace(found, doubt=min(STD_OF_MEDIAN_SIZE * scatter / variance, 1.0)) if found.present else found


@dataclass(frozen=True)
class _Bends:
    """How far columns are from the middle of their neighbours, px, with their noise, flat over both axes."""

    away_px: Map
    noise_px: Map
    near: NDArray[np.bool_]

    @classmethod
    def of(cls, column_px: NDArray[np.floating], noise_px: NDArray[np.floating]) -> _Bends:
        """Those of columns (rows, columns), NaN where they are not known."""
        away = _bends(column_px.astype(np.float64))
        with np.errstate(invalid="ignore"):
            near = np.abs(away) < LONGEST_PX
        return cls(away, np.concatenate([each.ravel() for each in _inside(noise_px)]), near)

    def left(self, pull: Map, spot: CameraSpot) -> float:
        """Sum of what a spot leaves unexplained, px."""
        pulled = np.nan_to_num(_bends(pull)[self.near])
        return float(np.abs(self.away_px[self.near] - spot.variance_px2 * pulled).sum())


def _inside(values: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Pixels of a map that have neighbours of their colour on both sides, in a row and in a column."""
    return values[:, NEXT_PX:-NEXT_PX], values[NEXT_PX:-NEXT_PX]


def _bends(values: Map) -> Map:
    """How far values (rows, columns) are from the middle of their neighbours of the same colour.

    Those in a row, and then those in a column, flat.
    """
    row, column = _inside(values)
    across = row - 0.5 * (values[:, : -2 * NEXT_PX] + values[:, 2 * NEXT_PX :])
    down = column - 0.5 * (values[: -2 * NEXT_PX] + values[2 * NEXT_PX :])
    return np.concatenate([across.ravel(), down.ravel()])


def spot_finding(found: CameraSpot) -> FitFinding:
    """What the scan says about the sharpness of its camera."""
    return FitFinding.judged(
        "focus",
        "spot that a camera pixel sees",
        (found.variance_px2, found.std_px2),
        "px2",
        SHARP_PX**2,
        f"The camera is out of focus: its pixels see a spot of {with_std(found.rms_px, found.rms_std_px, 2)}"
        " px (rms). Depths along edges of brightness are corrected for it; spectra there are of both sides.",
        "Focus the camera on the object, or narrow its aperture.",
    )
