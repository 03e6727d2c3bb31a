"""Pixels of known materials with errors as a result's: smooth over bands, of the deviations it states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.result import Flag, build_result
from dsl_core.optics.charts import chart_reflectance

if TYPE_CHECKING:
    import xarray as xr

NM = np.arange(430.0, 661.0, 10.0)
#: Rows of each material, and columns of the picture.
ROWS, COLUMNS = 16, 60
#: Errors of bands hang together over about so many bands, as the smoothness of a result makes them.
SMOOTH = 1.2


@dataclass(frozen=True)
class ChartCube:
    """Cubes (bands, rows, columns), the material of each pixel, and the true spectra (materials, bands)."""

    reflectance: NDArray[np.float32]
    std: NDArray[np.float32]
    flags: NDArray[np.uint16]
    material: NDArray[np.intp]
    spectra: NDArray[np.float64]
    names: tuple[str, ...]


def chart_cube(
    count: int = 6, share: float = 0.02, level: float = 0.0, smooth: float = SMOOTH, seed: int = 5
) -> ChartCube:
    """The first patches of a chart, a stripe each, with noise of a ``share`` of reflectance.

    ``level`` is the deviation of a brightness that each pixel has of its own; ``smooth`` 0 makes the errors
    of bands independent.
    """
    rng = np.random.default_rng(seed)
    known = chart_reflectance(NM)
    names = tuple(known)[:count]
    spectra = np.stack([known[name] for name in names])
    material = np.repeat(np.arange(count), ROWS)[:, None].repeat(COLUMNS, axis=1)
    truth = np.moveaxis(spectra[material], -1, 0)
    lag = np.arange(len(NM))
    noise = rng.standard_normal(truth.shape)
    if smooth:
        kernel = np.exp(-0.5 * ((lag[:, None] - lag) / smooth) ** 2)
        noise = np.tensordot(kernel / np.linalg.norm(kernel, axis=1, keepdims=True), noise, axes=1)
    std = share * truth + 0.002
    values = truth * (1 + level * rng.standard_normal(material.shape)) + std * noise
    std = np.hypot(std, level * truth)
    flags = np.zeros(material.shape, np.uint16)
    flags[0, 0] = Flag.POOR_FIT
    return ChartCube(values.astype("f4"), std.astype("f4"), flags, material, spectra, names)


def chart_result(count: int = 6) -> xr.Dataset:
    """The same as a result: a plane at 700 mm, pixels 1 mm apart, the last row without light."""
    cube = chart_cube(count)
    rows, columns = cube.flags.shape
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32)
    points = np.stack([x - columns / 2, y - rows / 2, np.full_like(x, 700.0)])
    normals = np.broadcast_to(np.array([0, 0, -1], np.float32)[:, None, None], points.shape).copy()
    values, flags = cube.reflectance.copy(), cube.flags.copy()
    flags[-1] = Flag.NO_LIGHT
    for each in (values, points):
        each[:, -1] = np.nan
    arrays = {
        "depth_mm": points[2],
        "points_mm": points,
        "normals": normals,
        "reflectance": values,
        "reflectance_std": cube.std,
        "data_share": np.ones_like(values),
        "flags": flags,
    }
    return build_result(arrays, NM, {"rig": "twin", "plan": "made"})
