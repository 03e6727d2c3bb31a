"""Corners of a board to a thousandth of a pixel: two edges of known bend, fitted to the pixels around them.

Where four squares meet, the picture is ``a(x) + b(x) p(d1) p(d2)``: two levels that vary linearly, and the
profiles p of two edges at signed distances d1 and d2. A profile is that of a sharp edge averaged over the
square of a pixel and blurred by a Gaussian, whose width is fitted too. Every pixel counts as it was
measured: a mosaic is brought to one colour by its local averages, without interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels

Floats = NDArray[np.float64]

#: Pixels within this share of the distance between corners are used for a corner, at most so far away.
REACH, MIN_REACH_PX, MAX_REACH_PX = 0.6, 3.0, 16.0
ROUNDS = 12
#: Blur: at the start, and at least; below, the square of a pixel hides it.
START_BLUR_PX, MIN_BLUR_PX = 0.5, 0.12
#: A corner that moved farther than this share of its reach was not the one that was found.
MAX_SHIFT = 0.5
#: Half widths of a pixel across an edge below this are as good as none.
MIN_HALF_PX = 0.02


@dataclass(frozen=True)
class EdgeCorners:
    """Fitted positions (corners, 2) (column, row) and the blur of edges (standard deviation), px."""

    points_px: Floats
    blur_px: Floats


def even_mosaic(mosaic: NDArray[Any], bayer: BayerPattern, reach_px: float) -> NDArray[np.float32]:
    """A mosaic in which a grey target has one value at all colours: each scaled by its local mean."""
    import cv2

    values = np.asarray(mosaic, np.float32)
    if len(mosaic_colours(bayer)) == 1:
        return values
    colours = bayer_channels(bayer, *values.shape)
    means = []
    for colour in range(3):
        mask = (colours == colour).astype(np.float32)
        total = cv2.GaussianBlur(values * mask, (0, 0), reach_px)
        means.append(np.asarray(total) / np.asarray(cv2.GaussianBlur(mask, (0, 0), reach_px)))
    mean = np.choose(colours, means)
    scale = np.divide(means[1], mean, out=np.ones_like(values), where=mean > 1e-6 * mean.max())
    return np.asarray(values * scale, np.float32)


def fit_corners(
    grey: NDArray[np.floating],
    start_px: Floats,
    along_px: Floats,
    gap: float = 1.0,
    bend_per_px: Floats | None = None,
) -> EdgeCorners:
    """Fit corners in a linear picture (rows, columns), not finite where a pixel must not count.

    ``start_px`` (corners, 2); ``along_px`` (corners, 2, 2): one square's step along board x and y. Only
    pixels within ``gap`` squares of an edge count (markers are beyond). ``bend_per_px`` (corners, 2) is the
    curvature of both edges in the picture, as lenses bend them, towards the left of board x and y; none if
    not given. Corners without a fit are NaN.
    """
    bend = np.zeros((len(start_px), 2)) if bend_per_px is None else bend_per_px
    pitch = np.linalg.norm(along_px, axis=2).min(1)
    reach = np.clip(REACH * pitch, MIN_REACH_PX, MAX_REACH_PX)
    state = _start(start_px, along_px)
    places, values, usable = _windows(np.asarray(grey, np.float64), start_px, reach)
    near = np.abs(_edge_distances(state, places, bend)).min(0)
    usable &= near < np.maximum(gap * pitch - 1.0, 1.5)[:, None]
    levels = np.zeros((len(state), 6))
    for _ in range(ROUNDS):
        model, slope = _model(state, places, start_px, bend)
        levels = _levels(model, values, usable)
        moved = _step(state, slope, model, levels, values, usable)
        change, state = np.abs(moved - state)[:, :2].max(), moved
        if change < 1e-4:
            break
    shift = np.linalg.norm(state[:, :2] - start_px, axis=1)
    contrast = np.abs(levels[:, 3]) > 0.05 * np.abs(levels[:, 0])
    good = (shift < MAX_SHIFT * reach) & contrast & np.isfinite(state).all(1)
    return EdgeCorners(np.where(good[:, None], state[:, :2], np.nan), state[:, 4])


def _start(start_px: Floats, along_px: Floats) -> Floats:
    """Column, row, direction of both edges (rad), blur; shape (corners, 5)."""
    angles = np.arctan2(along_px[..., 1], along_px[..., 0])
    blur = np.full((len(start_px), 1), START_BLUR_PX)
    return np.concatenate([start_px, angles, blur], 1)


def _windows(grey: Floats, start_px: Floats, reach: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Pixels around each corner (corners, pixels, 2) (column, row), their values, and which ones count."""
    size = int(np.ceil(reach.max()))
    y, x = np.mgrid[-size : size + 1, -size : size + 1]
    places = np.rint(start_px).astype(int)[:, None] + np.stack([x.ravel(), y.ravel()], 1)
    rows, columns = grey.shape
    inside = (places >= 0).all(2) & (places[..., 0] < columns) & (places[..., 1] < rows)
    values = grey[places[..., 1].clip(0, rows - 1), places[..., 0].clip(0, columns - 1)]
    away = places - start_px[:, None]
    usable = inside & np.isfinite(values) & ((away**2).sum(2) <= reach[:, None] ** 2)
    return places.astype(float), np.where(usable, values, 0.0), usable


def _edge_distances(state: Floats, places: Floats, bend_per_px: Floats) -> Floats:
    """Signed distance (px) of pixels to both edges, shape (2, corners, pixels)."""
    away = places - state[:, None, :2]
    distances = []
    for angle, bend in zip(state[:, 2:4].T[..., None], bend_per_px.T[..., None], strict=True):
        along = away[..., 0] * np.cos(angle) + away[..., 1] * np.sin(angle)
        distances.append(away[..., 1] * np.cos(angle) - away[..., 0] * np.sin(angle) - 0.5 * bend * along**2)
    return np.stack(distances)


def _model(state: Floats, places: Floats, start_px: Floats, bend_per_px: Floats) -> tuple[Floats, Floats]:
    """Level functions (corners, pixels, 6) and slopes of the edges' product by the state (..., 5)."""
    distances = _edge_distances(state, places, bend_per_px)
    angles, blur = state[:, 2:4].T, state[:, 4][:, None]
    (p, dp, sp), (q, dq, sq) = (
        _profile(d, angle[:, None], blur) for d, angle in zip(distances, angles, strict=True)
    )
    sines, cosines = np.sin(angles)[..., None], np.cos(angles)[..., None]
    away = places - state[:, None, :2]
    # Along each edge: the derivative of its distance by its direction, with the sign turned.
    along = [away[..., 0] * c + away[..., 1] * s for s, c in zip(sines, cosines, strict=True)]
    slope = np.stack(
        [
            dp * q * sines[0] + p * dq * sines[1],
            -(dp * q * cosines[0] + p * dq * cosines[1]),
            -dp * q * along[0],
            -p * dq * along[1],
            sp * q + p * sq,
        ],
        -1,
    )
    off = places - start_px[:, None]
    plane = np.concatenate([np.ones_like(off[..., :1]), off], -1)
    return np.concatenate([plane, plane * (p * q)[..., None]], -1), slope


def _profile(distance: Floats, angle: Floats, blur: Floats) -> tuple[Floats, Floats, Floats]:
    """An edge from -1 to 1 averaged over a pixel and blurred, its slope, and its derivative by the blur.

    The square of a pixel seen across the edge is the convolution of two boxes; K'' being the blurred edge,
    its average is a second difference of K (by the blur: equation of diffusion).
    """
    from scipy.special import erf

    a = np.maximum(0.5 * np.abs(np.sin(angle)), MIN_HALF_PX)
    b = np.maximum(0.5 * np.abs(np.cos(angle)), MIN_HALF_PX)
    value, slope, curve = (np.zeros_like(distance) for _ in range(3))
    for sign, shift in ((1, a + b), (-1, a - b), (-1, b - a), (1, -a - b)):
        t = distance + shift
        edge = erf(t / (np.sqrt(2) * blur))
        bell = blur / np.sqrt(2 * np.pi) * np.exp(-0.5 * (t / blur) ** 2)
        value += sign * (0.5 * (t**2 + blur**2) * edge + t * bell)
        slope += sign * (t * edge + 2 * bell)
        curve += sign * edge
    scale = 4 * a * b
    return value / scale, slope / scale, curve / scale * blur


def _levels(model: Floats, values: Floats, usable: NDArray[np.bool_]) -> Floats:
    """Levels that fit best, (corners, 6)."""
    weighted = model * usable[..., None]
    square = np.einsum("npi,npj->nij", weighted, model)
    square += 1e-9 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(6)
    return np.linalg.solve(square, np.einsum("npi,np->ni", weighted, values)[..., None])[..., 0]


def _step(
    state: Floats, slope: Floats, model: Floats, levels: Floats, values: Floats, usable: NDArray[np.bool_]
) -> Floats:
    """The state after a step of Gauss and Newton for edges and levels together."""
    strength = np.einsum("npi,ni->np", model[..., :3], levels[:, 3:])
    jacobian = np.concatenate([slope * strength[..., None], model], -1) * usable[..., None]
    residual = (values - np.einsum("npi,ni->np", model, levels)) * usable
    square = np.einsum("npi,npj->nij", jacobian, jacobian)
    size = np.sqrt(np.einsum("nii->ni", square)).clip(1e-12)
    scaled = square / size[:, :, None] / size[:, None, :] + 1e-7 * np.eye(11)
    right = np.einsum("npi,np->ni", jacobian, residual) / size
    move = np.linalg.solve(scaled, right[..., None])[..., 0] / size
    limits = np.array([1.0, 1.0, 0.2, 0.2, 0.3])
    moved = state + np.clip(move[:, :5], -limits, limits)
    moved[:, 4] = moved[:, 4].clip(MIN_BLUR_PX, 4.0)
    return np.asarray(moved)
