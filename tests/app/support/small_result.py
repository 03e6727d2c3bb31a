"""A small result with two materials and pixels of every kind, for tests of the Results page."""

from __future__ import annotations

import atexit
import functools
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from dsl_core.io.result.result_file import save_result
from dsl_core.model.result import Flag, build_result
from dsl_core.optics.colour import reflectance_to_srgb

NM = np.arange(430.0, 661.0, 5.0)
SHAPE = (24, 36)
#: The left half of the image is bluish, the right half reddish.
BLUE, RED = np.linspace(0.7, 0.1, NM.size), np.linspace(0.1, 0.7, NM.size)
#: Pixel (x, y) without any light, and one whose ends the prior decides.
DARK, UNREACHED = (2, 1), (5, 4)


def write_small_result(folder: Path, spectra: bool = True) -> Path:
    """Save it as ``small.zarr``."""
    return Path(shutil.copytree(_saved(spectra), folder / "small.zarr"))


@functools.cache
def _saved(spectra: bool) -> Path:
    """The result on disk, of which each test gets a copy."""
    folder = tempfile.TemporaryDirectory(prefix="small-result-")
    atexit.register(folder.cleanup)
    return save_result(_small(spectra), Path(folder.name) / "small.zarr")


def _small(spectra: bool) -> xr.Dataset:
    rows, columns = SHAPE
    y, x = np.mgrid[:rows, :columns].astype(np.float32)
    depth = 700 + 0.5 * x
    flags = np.zeros(SHAPE, np.uint16)
    flags[DARK[1], DARK[0]] = int(Flag.NO_LIGHT)
    flags[UNREACHED[1], UNREACHED[0]] = int(Flag.BANDS_UNREACHED)
    depth[DARK[1], DARK[0]] = np.nan
    arrays: dict[str, NDArray[Any]] = {
        "depth_mm": depth,
        "depth_std_mm": np.full(SHAPE, 0.25, np.float32),
        "points_mm": np.stack([(x - 18) * depth / 100, (y - 12) * depth / 100, depth]),
        "flags": flags,
    }
    if spectra:
        cube = np.where(x < columns / 2, BLUE[:, None, None], RED[:, None, None]).astype(np.float32)
        cube[:, DARK[1], DARK[0]] = np.nan
        share = np.ones_like(cube)
        share[:4, UNREACHED[1], UNREACHED[0]] = 0.1
        arrays.update(
            reflectance=cube,
            reflectance_std=np.full_like(cube, 0.01),
            data_share=share,
            reach=np.ones(cube.shape, np.uint8),
            rgb=reflectance_to_srgb(cube, NM),
        )
    return build_result(arrays, NM, {"rig": "twin"})


def write_reference(path: Path, values: NDArray[np.float64]) -> Path:
    """A text file with a spectrum, as a spectroradiometer's program writes it."""
    rows = "\n".join(f"{nm:g},{value:.6f}" for nm, value in zip(NM, values, strict=True))
    path.write_text(f"nm,reflectance\n{rows}\n")
    return path
