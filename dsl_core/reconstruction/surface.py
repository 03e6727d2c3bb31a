"""Normals and shading from a depth map.

A plane's inverse depth is affine in the normalised image coordinates, ``1/z = (n . ray) / d``, so a
weighted plane fit in a window is a 3 x 3 system of box-filtered sums. Each pixel takes the window, of several
sizes and places, that promises the smallest error: a large one on a plane, where noise counts, a small one
where the surface curves, and one on the pixel's own side of a jump or a crease.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import rays_in
from dsl_core.optics.sensor import relative_gain

Map = NDArray[np.float64]
Block = tuple[slice, slice]

#: Pixels that are worked on at once, with those around them: they take 300 bytes each.
BLOCK_PX = 1_500_000
#: Smallest window, and the ratio of one size to the next.
LEAST_PX, RATIO = 3, 1.7
#: Error of a slope that a misfit causes, relative to that of as much noise in a single sample: a curved
#: surface tilts the plane of a window next to the pixel far more than one around it.
CENTRED, BESIDE = 1.0, 4.0
#: Rows or columns of a window that must have a depth if they are to tell a slope.
FEWEST_LINES = 3
#: Share of a window's pixels that must have a depth if it is to tell how depth scatters.
BULK = 0.9
#: A further window must promise this share of the variance: noise alone should not choose it.
CLEARLY_BETTER = 0.7
#: A misfit this many deviations of its own noise counts by itself; others are averaged with those around.
CLEAR_MISFIT = 10.0
#: Deviations also hold what neighbours have in common, which does not scatter about a plane and must not hide
#: curvature. How much does scatter is measured in this many patches across and down, each of at most this
#: many pixels a side; a share of the variance that is no smaller than this counts as stated.
PATCHES, PATCH_PX, AS_STATED = 4, 96, 0.8
#: A jump is this many deviations of the step to a neighbour, and this share of the inverse depth.
JUMP_SIGMAS, JUMP_SHARE = 5.0, 0.004
#: A surface that is nearer than this share to an end of the calibrated depths may go on beyond it.
GOES_ON = 0.04
#: Relative error of the light of a pixel next to a jump. One of the two pixels there sees both sides, by a
#: share that nobody knows: at least half of it its own, evenly distributed.
MIXED_REL_STD = (0.5 / 12) ** 0.5


@dataclass(frozen=True)
class Surface:
    """Normals (3, rows, columns), shading with relative deviation, and depth edges."""

    normals: Map
    shading: Map
    shading_rel_std: Map
    edge: NDArray[np.bool_]

    @classmethod
    def empty(cls, shape: tuple[int, ...]) -> Surface:
        """Room for maps of a shape, in single precision."""
        normals, shading, std = (np.empty((*lead, *shape), np.float32) for lead in ((3,), (), ()))
        return cls(normals, shading, std, np.zeros(shape, bool))


def default_window_px(rig: Rig) -> int:
    """Largest window of the plane fits: about 1/45 of the image width, odd, at least 5."""
    return max(5, rig.camera.width_px // 45 | 1)


def windows_px(largest: int) -> list[int]:
    """Sizes of windows, odd, from the largest to the smallest.

    >>> windows_px(19)
    [19, 11, 7, 5, 3]
    """
    sizes = [largest]
    while (smaller := int(sizes[-1] / RATIO) | 1) >= LEAST_PX and smaller < sizes[-1]:
        sizes.append(smaller)
    return sizes


def reconstruct_surface(
    rig: Rig,
    depth_mm: Map,
    depth_std_mm: Map,
    window_px: int | None = None,
    beyond: NDArray[np.bool_] | None = None,
    mixed: NDArray[np.bool_] | None = None,
) -> Surface:
    """Fit planes around every pixel with a depth (NaN elsewhere) and derive normal and shading.

    ``beyond`` (rows, columns) are pixels that see something out of the calibrated depths: next to them is an
    edge, too. So are ``mixed`` pixels, which see two surfaces.
    ``window_px`` is the size of the largest window. The deviation of a normal holds the noise of depth and
    what the misfit of the plane says about curvature; next to a jump that of shading holds mixed pixels.
    Large pictures are worked on block by block, with all pixels around that take part.
    """
    window = window_px or default_window_px(rig)
    # A window next to a pixel, the neighbourhood of its misfit, and a neighbour beyond a jump.
    beside = 2 * window + 2
    blocks = list(_blocks(depth_mm.shape, beside))
    jump = _beside_what_is_beyond(rig, depth_mm, beyond)
    if mixed is not None:
        jump |= mixed
    share = _scatter_share(rig, depth_mm, depth_std_mm, window)
    if len(blocks) == 1:
        return _surface_of(rig, depth_mm, depth_std_mm, window, blocks[0][1], jump, share)
    found = Surface.empty(depth_mm.shape)
    for own, near in blocks:
        part = _surface_of(rig, depth_mm[near], depth_std_mm[near], window, near, jump[near], share)
        inside = tuple(slice(o.start - n.start, o.stop - n.start) for o, n in zip(own, near, strict=True))
        for field in fields(Surface):
            getattr(found, field.name)[..., *own] = getattr(part, field.name)[..., *inside]
    return found


def _blocks(shape: tuple[int, ...], beside: int) -> Iterator[tuple[Block, Block]]:
    """Blocks of a picture (rows, columns), each with the same and what is within ``beside`` of it."""
    side = max(int(BLOCK_PX**0.5) - 2 * beside, beside)
    counts = [1, 1] if shape[0] * shape[1] <= BLOCK_PX else [-(-size // side) for size in shape]
    edges = [np.linspace(0, size, n + 1).astype(int).tolist() for size, n in zip(shape, counts, strict=True)]
    for (top, bottom), (left, right) in product(*(pairwise(each) for each in edges)):
        own = slice(top, bottom), slice(left, right)
        near = (
            slice(max(part.start - beside, 0), min(part.stop + beside, size))
            for part, size in zip(own, shape, strict=True)
        )
        yield own, (next(near), next(near))


def _beside_what_is_beyond(rig: Rig, depth_mm: Map, beyond: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    """Pixels next to what is out of the calibrated depths, unless it is their own surface that goes on."""
    import cv2

    if beyond is None or not beyond.any():
        return np.zeros(depth_mm.shape, bool)
    low, high = rig.depth_range_mm
    near = cv2.dilate(beyond.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.asarray(near & (depth_mm > low * (1 + GOES_ON)) & (depth_mm < high * (1 - GOES_ON)))


def _scatter_share(rig: Rig, depth_mm: Map, depth_std_mm: Map, window: int) -> float:
    """Share of the stated variance of depth that scatters about planes: the median over patches.

    Measured in windows large enough to contain an error that repeats with the lines of a scan.
    """
    size = windows_px(window)[:2][-1]
    sides = [min(PATCH_PX, -(-whole // PATCHES)) for whole in depth_mm.shape]
    starts = (
        np.linspace(0, whole - side, PATCHES).astype(int).tolist()
        for whole, side in zip(depth_mm.shape, sides, strict=True)
    )
    seen = []
    for top, left in product(*starts):
        place = slice(top, top + sides[0]), slice(left, left + sides[1])
        inverse, std, valid = _inverse(depth_mm[place], depth_std_mm[place])
        fits = _plane_fits(rays_in(rig.camera, *place), inverse, std, valid, size)
        seen.append(fits.scatter[fits.count > BULK * size**2])
    scatter = np.concatenate(seen)
    share = float(np.median(scatter)) if scatter.size else 1.0
    return share if share < AS_STATED else 1.0


def _inverse(depth_mm: Map, depth_std_mm: Map) -> tuple[Map, Map, NDArray[np.bool_]]:
    """Inverse depth, zero where there is none, its deviation, and where there is one."""
    valid = np.isfinite(depth_mm)
    inverse = np.where(valid, 1 / np.where(valid, depth_mm, 1), 0.0)
    return inverse, np.where(valid, depth_std_mm, 1.0) * np.where(valid, inverse, 1.0) ** 2, valid


def _surface_of(
    rig: Rig,
    depth_mm: Map,
    depth_std_mm: Map,
    window: int,
    place: Block,
    jump: NDArray[np.bool_],
    share: float,
) -> Surface:
    """The surface of a block at a place of the picture; at a ``jump`` is an edge whatever is seen.

    ``share`` of the variance of depth scatters about planes.
    """
    rays = rays_in(rig.camera, *place)
    inverse, std, valid = _inverse(depth_mm, depth_std_mm)
    best = _Best(rays, inverse, std)
    for size in windows_px(window):
        best.offer(_plane_fits(rays, inverse, std, valid, size, share), size)
    bad = ~valid | ~np.isfinite(best.variance)
    length = np.maximum(np.linalg.norm(best.fit, axis=0), 1e-12)
    normal = -best.fit / length
    normal[:, bad] = np.nan
    spread = np.where(bad, np.nan, np.sqrt(best.variance) / length)
    edge = (_beside_jump(rays, inverse, best.fit[:2], std, valid) | bad | jump) & valid
    gain = np.broadcast_to(relative_gain(rig), (rig.camera.height_px, rig.camera.width_px))[place]
    shading, incidence_tan = _shading(rig, rays * np.where(valid, depth_mm, np.nan), normal, gain)
    relative = np.hypot(incidence_tan * spread, 2 * np.where(valid, depth_std_mm * inverse, np.nan))
    relative = np.where(edge, np.hypot(relative, MIXED_REL_STD), relative)
    return Surface(normal, shading, relative, edge)


def _box(values: Map, window: int) -> Map:
    import cv2

    return np.asarray(
        cv2.boxFilter(values, cv2.CV_64F, (window, window), normalize=True, borderType=cv2.BORDER_CONSTANT)
    )


def _lines(valid: NDArray[np.bool_], window: int, axis: int) -> Map:
    """In how many rows (``axis`` 0) or columns (1) of the window around every pixel there is a depth."""
    import cv2

    along, across = ((window, 1), (1, window)) if axis == 0 else ((1, window), (window, 1))
    found = cv2.dilate(valid.astype(np.float32), np.ones(along[::-1], np.uint8))
    return np.asarray(
        cv2.boxFilter(found, cv2.CV_32F, across, normalize=False, borderType=cv2.BORDER_CONSTANT)
    )


@dataclass(frozen=True)
class _Fits:
    """Planes of the windows around every pixel, maps of (rows, columns).

    ``fit`` (3, rows, columns) are the coefficients of the rays, ``variance`` that of a slope by the noise
    of depth, ``misfit`` the square of its error by what the plane leaves or cannot tell, relative to
    `CENTRED`; ``unit`` the variance of a slope for noise of one; ``count`` the pixels, zero where too few;
    ``scatter`` the mean square about the plane over the stated variance.
    """

    fit: Map
    variance: Map
    misfit: Map
    unit: Map
    count: Map
    scatter: Map


def _plane_fits(
    rays: Map, inverse: Map, std: Map, valid: NDArray[np.bool_], window: int, share: float = 1.0
) -> _Fits:
    """Weighted least squares in every window; the noise is ``std`` of the inverse depth.

    What exceeds a ``share`` of its variance is misfit.
    """
    x, y = rays[0], rays[1]
    weight = np.where(valid, 1 / np.maximum(std, 1e-15) ** 2, 0.0)
    weight = weight / (weight.max(initial=0) or 1.0)
    total = np.maximum(_box(weight, window), 1e-30)

    def mean(values: Map) -> Map:
        return _box(weight * values, window) / total

    # Moments about the window's mean, so that the sums do not cancel.
    mx, my, level = mean(x), mean(y), mean(inverse)
    a, b, c = mean(x * x) - mx * mx, mean(x * y) - mx * my, mean(y * y) - my * my
    rx, ry = mean(x * inverse) - mx * level, mean(y * inverse) - my * level
    determinant = np.maximum(a * c - b * b, 1e-24)
    alpha, beta = (c * rx - b * ry) / determinant, (a * ry - b * rx) / determinant
    residual = mean(inverse**2) - level**2 - alpha * rx - beta * ry
    count = _box((weight > 0).astype(float), window) * window**2
    count = np.where(count >= max(6, 0.15 * window**2), count, 0.0)
    unit = np.maximum(a, c) / (determinant * np.maximum(count, 1))
    noise = np.maximum(mean(std**2), 0)
    misfit = _beyond_noise(residual, share * noise, count, window)
    fit = np.stack([alpha, beta, level - alpha * mx - beta * my])
    scatter = _for_each_degree(residual, count) / np.maximum(noise, 1e-30)
    # Nothing tells a slope through two rows or columns from a jump between them.
    few_columns, few_rows = (_lines(valid, window, axis) < FEWEST_LINES for axis in (1, 0))
    unsure = misfit * unit * count + few_columns * alpha**2 + few_rows * beta**2
    return _Fits(fit, noise * unit, unsure, unit, count, scatter)


def _for_each_degree(residual: Map, count: Map) -> Map:
    """The mean square about planes for each degree of freedom that they leave."""
    many = np.maximum(count, 4)
    return np.asarray(residual * many / (many - 3))


def _beyond_noise(residual: Map, noise: Map, count: Map, window: int) -> Map:
    """Mean square that planes leave beyond the noise's.

    A window alone would not see a curvature that tilts its plane by several deviations; surfaces curve alike
    in the neighbourhood, so that its mean does.
    """
    excess = _for_each_degree(residual, count) - noise
    many = np.maximum(count, 4)
    clear = excess > CLEAR_MISFIT * noise * np.sqrt(2 / many)
    counted = ((count > 0) & ~clear).astype(float)
    wide = 2 * window + 1
    smooth = _box(excess * counted, wide) / np.maximum(_box(counted, wide), 1e-9)
    return np.maximum(np.where(clear, excess, smooth), 0)


class _Best:
    """For each pixel the plane of the smallest expected error among all that were offered.

    A window around a pixel mixes both sides of a depth jump; one next to it that is on the pixel's own side
    does not (Kuwahara's idea).
    """

    def __init__(self, rays: Map, inverse: Map, std: Map) -> None:
        self.rays, self.inverse, self.std = rays, inverse, std
        self.fit = np.zeros((3, *inverse.shape))
        #: Expected square of the error of a slope of inverse depth, infinite without a plane.
        self.variance = np.full(inverse.shape, np.inf)

    def offer(self, fits: _Fits, window: int) -> None:
        """Take the planes of windows of one size where they promise more, around pixels and next to them."""
        everywhere = np.arange(self.inverse.size)
        self._take(fits, everywhere, everywhere, CENTRED, 0.0)
        # Next to a pixel only where the window around it does not fit.
        doubtful = np.flatnonzero(self.variance > 4 * fits.variance)
        row, column = np.divmod(doubtful, self.inverse.shape[1])
        shift, enough = window // 2, 0.5 * window**2
        for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            y, x = row - down * shift, column - right * shift
            inside = (y >= 0) & (y < self.inverse.shape[0]) & (x >= 0) & (x < self.inverse.shape[1])
            source = y[inside] * self.inverse.shape[1] + x[inside]
            self._take(fits, doubtful[inside], source, BESIDE, enough)

    def _take(
        self, fits: _Fits, pixels: NDArray[np.intp], source: NDArray[np.intp], tilt: float, enough: float
    ) -> None:
        """Offer pixels (flat) the planes of the windows around other pixels."""
        fit = fits.fit.reshape(3, -1)[:, source]
        unit, count = fits.unit.ravel()[source], fits.count.ravel()[source]
        off = (fit * self.rays.reshape(3, -1)[:, pixels]).sum(0) - self.inverse.ravel()[pixels]
        # The pixel itself has to be on the plane.
        off = np.maximum(off**2 - 9 * self.std.ravel()[pixels] ** 2, 0) * unit * count
        variance = fits.variance.ravel()[source] + tilt**2 * fits.misfit.ravel()[source] + BESIDE**2 * off
        known = self.variance.ravel()[pixels]
        better = (count > enough) & (variance < CLEARLY_BETTER * known)
        self.variance.reshape(-1)[pixels[better]] = variance[better]
        self.fit.reshape(3, -1)[:, pixels[better]] = fit[:, better]


def _beside_jump(
    rays: Map, inverse: Map, slope: Map, std: Map, valid: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Pixels one of whose eight neighbours is off their plane by more than noise and curvature explain."""
    rows, columns = inverse.shape
    around = [np.pad(each, 1) for each in (rays[0], rays[1], inverse, std, valid.astype(float))]
    found = np.zeros_like(valid)
    for place in range(9):
        down, right = divmod(place, 3)
        x, y, there, spread, known = (each[down : down + rows, right : right + columns] for each in around)
        step = there - inverse - slope[0] * (x - rays[0]) - slope[1] * (y - rays[1])
        found |= (np.abs(step) > JUMP_SIGMAS * np.hypot(std, spread) + JUMP_SHARE * inverse) & (known > 0)
    return found & valid


def _shading(rig: Rig, points: Map, normals: Map, gain: Map) -> tuple[Map, Map]:
    """``cos(incidence) (reference / distance)^2`` times the camera's gain; tangent of the incidence."""
    to_light = rig.pose.projector_centre_mm[:, None, None] - points
    distance = np.linalg.norm(to_light, axis=0)
    cosine = (normals * to_light).sum(0) / distance
    safe = np.clip(cosine, 0.05, 1)
    shading = safe * (rig.reference_distance_mm / distance) ** 2 * gain
    return shading, np.sqrt(1 - safe**2) / safe
