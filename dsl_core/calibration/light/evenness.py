"""Smooth relative gain over the camera image from pixels of an even target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.flat_field import FlatField

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Nodes over rows and columns, and blocks per node that the residual is judged by.
NODES = (9, 13)
BLOCKS = 3
#: Weight of third differences between nodes against a block: noise should not bend the grid; vignetting,
#: which is quadratic, costs nothing.
STIFFNESS = 3.0


@dataclass(frozen=True)
class Evenness:
    """A flat field, deviations of its nodes, reduced chi-square of an even camera, rms of blocks about it."""

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
    design = _hats(row, rows_px)[:, :, None] * _hats(column, columns_px)[:, None, :]
    design = design.reshape(len(value), -1)
    rough = _roughness() * np.sqrt(STIFFNESS)
    left = np.concatenate([design * weight[:, None], rough])
    right = np.concatenate([value * weight, np.zeros(len(rough))])
    gain, *_ = np.linalg.lstsq(left, right, rcond=None)
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
    return Evenness(flat_field, _rows(std / mean), chi_square, float(np.sqrt(variance)))


def _blocks(relative: Floats, usable: Mask) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean position (px), mean value and number of pixels of blocks that hold enough."""
    rows, columns = np.nonzero(usable)
    down, across = (BLOCKS * k for k in NODES)
    block = (rows * down // relative.shape[0]) * across + columns * across // relative.shape[1]
    count = np.bincount(block, minlength=down * across).astype(float)
    keep = count > 0.2 * count.max()
    sums = [
        np.bincount(block, v, down * across)[keep] / count[keep] for v in (rows, columns, relative[usable])
    ]
    return sums[0], sums[1], sums[2], count[keep]


def _hats(position: Floats, nodes: Floats) -> Floats:
    """Share of each node at each position, (positions, nodes)."""
    return np.stack([np.interp(position, nodes, unit) for unit in np.eye(len(nodes))], 1)


def _roughness() -> Floats:
    """Third differences of the grid along rows and columns, one a row."""
    down, across = NODES
    d, a = np.diff(np.eye(down), 3, axis=0), np.diff(np.eye(across), 3, axis=0)
    return np.concatenate([np.kron(d, np.eye(across)), np.kron(np.eye(down), a)])


def _rows(values: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in values.reshape(NODES).tolist())
