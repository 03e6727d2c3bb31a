"""Save, open and export a result of full size: seconds and megabytes of each.

Run ``python tests/benchmarks/bench_result_io.py``. The cube is smooth reflectance with the noise of a
scan (0.004) and a tenth of the pixels unlit; times include syncing to disk.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.io.export import export_csv, formats
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.model.result import Reach, build_result

if TYPE_CHECKING:
    import xarray as xr


def main() -> None:
    """Print a line per step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, nargs=2, default=(580, 890), metavar=("ROWS", "COLUMNS"))
    parser.add_argument("--bands", type=int, default=47)
    parser.add_argument("--keep", type=Path, help="folder to write into (otherwise a temporary one)")
    options = parser.parse_args()
    result = synthetic_result(options.bands, *options.size)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        path = folder / "result.zarr"
        timed("save zarr", lambda: [save_result(result, path, overwrite=True)])
        timed("open zarr", lambda: opened(load_result(path)))
        loaded = load_result(path)
        timed("read one band", lambda: opened(loaded["reflectance"][options.bands // 2].load()))
        timed("read all", lambda: opened(load_result(path, lazy=False)))
        worst = float(np.nanmax(np.abs(loaded["reflectance"].values - result["reflectance"].values)))
        print(f"{'largest change of reflectance':30s} {worst:.1e}")
        for name, form in formats().items():
            target = folder / f"out{'.hdr' if name == 'envi' else '.' + name}"
            if name == "csv":
                pixels = [(x, 200) for x in range(100)]
                timed("csv, 100 pixels", lambda t=target, p=pixels: export_csv(result, t, pixels=p))  # type: ignore[misc]
            else:
                timed(name, lambda t=target, e=form.write: e(result, t, overwrite=True))  # type: ignore[misc]


def opened(_: object) -> list[Path]:
    """No files: reading writes nothing."""
    return []


def timed(name: str, step: Callable[[], list[Path]]) -> None:
    """Run a step, print its seconds and the megabytes of the files it returns."""
    start = time.perf_counter()
    files = step()
    seconds = time.perf_counter() - start
    every = [f for path in files for f in ([path] if path.is_file() else path.rglob("*")) if f.is_file()]
    print(f"{name:30s} {seconds:6.2f} s {sum(f.stat().st_size for f in every) / 1e6:8.1f} MB")


def synthetic_result(bands: int, rows: int, columns: int) -> xr.Dataset:
    """A complete result with realistic noise."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32)
    depth = 700 + 0.1 * x + rng.normal(0, 0.5, x.shape).astype(np.float32)
    cube = (bands, rows, columns)
    phase = np.linspace(0, 6, bands, dtype=np.float32)[:, None, None] + x / 200
    smooth = 0.5 + 0.3 * np.sin(phase) * np.cos(y / 60)
    arrays = {
        "depth_mm": depth,
        "depth_std_mm": np.full_like(depth, 0.5) + rng.normal(0, 0.01, x.shape).astype(np.float32),
        "column_px": (x * 0.7).astype(np.float32),
        "column_std_px": np.full_like(depth, 0.05),
        "points_mm": np.stack([(x - 445) * depth / 1760, (y - 290) * depth / 1760, depth]),
        "normals": np.broadcast_to(
            np.array([0, 0, -1], np.float32)[:, None, None], (3, rows, columns)
        ).copy(),
        "shading": np.full_like(depth, 0.9),
        "reflectance": (smooth + rng.normal(0, 0.004, cube)).astype(np.float32),
        "reflectance_std": (0.004 + 0.002 * rng.random(cube)).astype(np.float32),
        "data_share": (0.8 + 0.2 * rng.random(cube)).astype(np.float32),
        "rgb": np.clip(smooth[[-1, bands // 2, 0]], 0, 1),
    }
    flags = np.where(y < rows // 10, 1, np.where(x > columns * 0.9, 64, 0)).astype(np.uint16)
    for values in arrays.values():
        values[..., flags == 1] = np.nan
    reach = np.full(cube, Reach.PLUS_ONE, np.uint8)
    return build_result(
        {**arrays, "reach": reach, "flags": flags},
        np.linspace(430, 660, bands),
        {"scan_id": "benchmark", "software_version": "0"},
    )


if __name__ == "__main__":
    main()
