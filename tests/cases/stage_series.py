"""Results of a flat target at positions of a stage, and of one scene by plans of several lengths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from dsl_core.io.result.result_file import save_result
from dsl_core.model.result import Flag, build_result

SHAPE = (36, 48)
NM = np.arange(430.0, 661.0, 10.0)
#: How far a column or row looks to the side, and how far the target leans, both per mm of depth.
FOCAL_PX, LEAN = 80.0, 0.02


def flat_arrays(
    position_mm: float, noise_mm: float = 0.1, seed: int = 0, bend_mm: float = 0.0
) -> dict[str, NDArray[Any]]:
    """A leaning target whose middle stands at a depth; a corner without depth, a background in a strip."""
    rng = np.random.default_rng(seed)
    rows, columns = SHAPE
    x, y = np.meshgrid(np.arange(columns) - columns / 2, np.arange(rows) - rows / 2)
    depth = position_mm / (1 - LEAN * x / FOCAL_PX) + bend_mm
    depth += rng.normal(0, noise_mm, SHAPE) if noise_mm else 0.0
    depth[:, -4:] = position_mm + 60.0
    depth[0, :3] = np.nan
    flags = np.zeros(SHAPE, np.uint16)
    flags[0, :3] = int(Flag.NO_LIGHT)
    flags[1, :3] = int(Flag.NOT_REFINED)
    return {
        "depth_mm": depth.astype(np.float32),
        "points_mm": np.stack([x * depth / FOCAL_PX, y * depth / FOCAL_PX, depth]).astype(np.float32),
        "flags": flags,
    }


def write_stage(folder: Path, position_mm: float, **details: Any) -> Path:
    """Save a target under a name that says where it stood."""
    arrays = flat_arrays(position_mm, **details)
    return save_result(build_result(arrays, NM, {}), folder / f"stage {position_mm:g} mm.zarr")


def sweep_result(seconds: float, error_mm: float, error: float, seed: int = 0) -> xr.Dataset:
    """A scene that a scan of so many seconds measured with such errors."""
    rng = np.random.default_rng(seed)
    arrays = flat_arrays(700.0, 0.0)
    noise = rng.normal(0, error_mm, SHAPE) if error_mm else 0.0
    arrays["depth_mm"] = (arrays["depth_mm"] + noise).astype(np.float32)
    cube = np.broadcast_to(np.linspace(0.2, 0.8, NM.size)[:, None, None], (NM.size, *SHAPE))
    arrays["reflectance"] = (cube + rng.normal(0, error or 1e-9, cube.shape)).astype(np.float32)
    return build_result(arrays, NM, {"capture_seconds": seconds})


def write_sweep(folder: Path) -> list[Path]:
    """A reference of 400 s, and three scans of which the one of 60 s is worse than that of 30 s."""
    known = {"reference": (400.0, 0, 0), "quick": (10.0, 1, 0.05), "good": (30.0, 0.3, 0.01)}
    known["slow"] = (60.0, 0.5, 0.02)
    return [
        save_result(sweep_result(*figures, seed=i), folder / f"{name}.zarr")
        for i, (name, figures) in enumerate(known.items())
    ]
