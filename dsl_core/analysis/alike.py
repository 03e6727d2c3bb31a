"""Which pixels a result is likely to have measured alike: groups that show how their bands err together.

Errors hang together as spectra do, which differs from material to material. Pixels picked by the class that
they happen to be nearest to would show none of the errors that make one class look like another, and names
would be too sure: so classes that noise confuses share a group.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.classes import SpectralClass

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Cube = NDArray[np.float32] | NDArray[np.float64]
#: Noise does not swap pixels with a class that begins so many deviations away.
APART_SIGMAS = 3.0
#: Pixels at once, so that intermediates stay small, and pixels that tell the deviations of a class.
_AT_ONCE, _ENOUGH_PIXELS = 8192, 1000


def nearest_shapes(reflectance: Cube, at: Indices, classes: Sequence[SpectralClass]) -> Indices:
    """Which class each pixel (flat) is most like in shape; -1 but for pixels ``at``."""
    nearest = np.full(reflectance[0].size, -1, np.intp)
    flat, shapes = reflectance.reshape(len(reflectance), -1), _shapes(classes).astype(np.float32)
    for start in range(0, at.size, _AT_ONCE):
        pixels = at[start : start + _AT_ONCE]
        nearest[pixels] = np.argmax(shapes @ flat[:, pixels], axis=0)
    return nearest


def _shapes(classes: Sequence[SpectralClass]) -> Floats:
    """Spectra (classes, bands) of length 1."""
    return np.stack([each.mean / max(float(np.linalg.norm(each.mean)), 1e-9) for each in classes])


def groups_alike(
    reflectance: Cube,
    std: Cube,
    nearest: Indices,
    good: NDArray[np.bool_],
    classes: Sequence[SpectralClass],
    correlation: Floats,
) -> Indices:
    """The group of each pixel (flat), numbered from 0; -1 where ``nearest`` is.

    Cubes (bands, rows, columns); ``nearest`` is that of `nearest_shapes`; ``good`` pixels (flat) tell what
    is usual, and ``correlation`` (bands, bands) about how bands err together. A group is of classes that
    noise confuses in shape, and in level.
    """
    from scipy.sparse.csgraph import connected_components

    shapes, levels = _shapes(classes), np.array([np.linalg.norm(each.mean) for each in classes])
    swapped, level_std = np.eye(len(classes), dtype=bool), np.zeros(len(classes))
    for index, own in enumerate(shapes):
        usual = _usual(reflectance, std, np.flatnonzero(good & (nearest == index)))
        if usual is None:
            continue
        spectrum, spread = usual
        level_std[index] = np.abs(own) @ spread
        # A pixel goes to another class where its projection on the difference of shapes changes sign.
        towards = own - shapes
        noise = np.sqrt(np.einsum("ci,ij,cj->c", towards * spread, correlation, towards * spread))
        swapped[index] |= towards @ spectrum < APART_SIGMAS * noise
    _, of_shape = connected_components(swapped, directed=False)
    near_level = np.abs(levels - levels[:, None]) < 2 * APART_SIGMAS * np.maximum(
        level_std, level_std[:, None]
    )
    _, group = connected_components(near_level & (of_shape == of_shape[:, None]), directed=False)
    of_classes = of_shape.astype(np.intp), group.astype(np.intp)
    return _by_level(reflectance, nearest, *of_classes, levels, shapes)


def _by_level(
    reflectance: Cube, nearest: Indices, of_shape: Indices, group: Indices, levels: Floats, shapes: Floats
) -> Indices:
    """For each pixel the group, among those of its shape, whose level is nearest to its own."""
    found = np.where(nearest >= 0, group[nearest], -1)
    flat = reflectance.reshape(len(reflectance), -1)
    for shared in np.unique(of_shape):
        members = np.flatnonzero(of_shape == shared)
        if np.unique(group[members]).size == 1:
            continue
        at = np.flatnonzero(np.isin(nearest, members))
        for start in range(0, at.size, _AT_ONCE):
            pixels = at[start : start + _AT_ONCE]
            level = shapes[members].mean(0) @ flat[:, pixels]
            off = np.abs(np.log(np.maximum(level, 1e-6)) - np.log(np.maximum(levels[members], 1e-6))[:, None])
            found[pixels] = group[members[np.argmin(off, axis=0)]]
    return found


def _usual(reflectance: Cube, std: Cube, at: Indices) -> tuple[Floats, Floats] | None:
    """The usual reflectance and its deviation (bands,) of pixels (flat); None where there are none."""
    if not at.size:
        return None
    some = at[:: max(at.size // _ENOUGH_PIXELS, 1)]
    values, spread = (cube.reshape(len(cube), -1)[:, some].astype(np.float64) for cube in (reflectance, std))
    return np.median(values, axis=1), np.median(spread, axis=1)
