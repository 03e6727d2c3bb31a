"""Columns of first orders of a known film: exact, noisy, or bent by an uneven film."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.calibration.common.tiles import tile_of_pixels
from dsl_core.calibration.film.order_columns import TileColumns
from dsl_core.calibration.film.order_samples import OrderSamples
from dsl_core.model.rig import Film, Rig
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.published_rig import published_rig

SIZE = (222, 145)
DEPTHS_MM, FILTERS_NM = (600.0, 750.0, 900.0), (450.0, 540.0, 640.0)
POSITIONS = [f"position {z:g} mm" for z in DEPTHS_MM]
NAMES = [f"filter {nm:g} nm" for nm in FILTERS_NM]
NOISE_PX = 0.01
Bend = Callable[[NDArray[np.float64], NDArray[np.float64], float, float], NDArray[np.float64]]


def small_rig() -> Rig:
    rig = published_rig()
    film = Film(
        distance_mm=28.2, lines_per_mm=487.0, tilt_x_deg=0.3, tilt_y_deg=-0.5, roll_deg=0.2, bend_per_mm=0.003
    )
    return rig.model_copy(update={"camera": rig.camera.resized(*SIZE), "film": film})


def unbent(x: NDArray[np.float64], y: NDArray[np.float64], depth_mm: float, nm: float) -> NDArray[np.float64]:
    return np.zeros_like(x)


def saddle(x: NDArray[np.float64], y: NDArray[np.float64], depth_mm: float, nm: float) -> NDArray[np.float64]:
    """A smooth error (px) of an uneven film; x and y in -1..1."""
    return 0.4 * x * y - 0.3 * y**2 + 0.1 * x * (nm - 545) / 115


def samples_of(rig: Rig, noise_px: float, bend: Bend = unbent, seed: int = 0) -> OrderSamples:
    """One sample a tile, order, position and filter, where light comes from inside the frame."""
    rng = np.random.default_rng(seed)
    width, height = SIZE
    grid = np.add.outer(np.arange(2, height, 5) * width, np.arange(2, width, 5)).ravel()
    tiles = tile_of_pixels(SIZE).ravel()
    parts = []
    for position, z in enumerate(DEPTHS_MM):
        for name, nm in enumerate(FILTERS_NM):
            for order in (1, -1):
                seen = GratingModel(rig).exact(
                    torch.as_tensor(grid), torch.full((len(grid),), z).double(), order, np.array([nm])
                )
                inside = seen.inside(640, 360)[0].numpy()
                pixels = grid[inside]
                v, u = np.divmod(pixels, width)
                error = bend(2 * u / width - 1, 2 * v / height - 1, z, nm)
                columns = seen.columns[0].numpy()[inside] + order * error
                columns += noise_px * rng.standard_normal(len(pixels))
                std = np.full(len(pixels), max(noise_px, 1e-4))
                depth = np.full(len(pixels), z)
                parts.append(
                    (position, name, TileColumns(order, nm, tiles[pixels], pixels, depth, columns, std))
                )
    return OrderSamples.of(parts)


def mounted(rig: Rig) -> Rig:
    """What the mounting says of the film."""
    return rig.model_copy(update={"film": Film()})


def one_a_tile(samples: OrderSamples) -> OrderSamples:
    """The first sample of each tile of each capture."""
    keys = np.stack([samples.position, samples.filter, samples.order, samples.tile], 1)
    first = np.zeros(len(samples), bool)
    first[np.unique(keys, axis=0, return_index=True)[1]] = True
    return samples.only(first)


def shift_of_filters(
    rig: Rig, pixels: NDArray[np.int64], index: float, tilt_deg: float
) -> NDArray[np.float64]:
    """Relative shift of wavelengths by filters of an index that are tilted to the side, (n,), exactly."""
    rays = pixel_rays(rig.camera).reshape(3, -1)[:, pixels]
    tilt = np.radians(tilt_deg)
    cosine = (np.array([np.sin(tilt), 0.0, np.cos(tilt)]) @ rays) / np.linalg.norm(rays, axis=0)
    return np.asarray(np.sqrt(1 - (1 - cosine**2) / index**2) - 1)
