"""Depth as TIFF or NumPy array: float32 in mm, NaN where there is no answer; deviation and flags too.

TIFF revision 6.0, one plane per file and uncompressed, so that readers of measured images accept it. A NumPy
file has no room for where the data come from; ``NAME.zarr`` says it. Pictures that show depth in colours are
written by `export_png`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.export.common import ascii_text, plane, provenance, require, require_suffix
from dsl_core.io.staging import staged
from dsl_core.model.result import FLAG_NAMES, Flag
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

#: The tag of TIFF that describes an image in words.
DESCRIPTION = 270
#: Files with what they hold, in words and as arrays (rows, columns).
_Planes = dict[Path, tuple[str, NDArray[np.float32 | np.uint16]]]


def export_tiff(
    result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write ``NAME.tiff``, ``NAME_std.tiff`` and ``NAME_flags.tiff``, as far as the result has them.

    Each file says what it holds and where it comes from. Raises `StoreError`.
    """
    require_suffix(path, ".tiff", ".tif")
    from PIL import Image

    source = [f"{key}: {value}" for key, value in provenance(result).items()]

    def write(draft: Path, title: str, values: NDArray[Any]) -> None:
        description = ascii_text("\n".join([title, *source]))
        Image.fromarray(values).save(draft, format="TIFF", tiffinfo={DESCRIPTION: description})

    return _write_planes(_depth_planes(result, "A TIFF of depth", path), write, overwrite, check)


def export_npy(
    result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write ``NAME.npy``, ``NAME_std.npy`` and ``NAME_flags.npy``, as far as the result has them.

    Raises `StoreError`.
    """
    require_suffix(path, ".npy")

    def write(draft: Path, title: str, values: NDArray[Any]) -> None:
        np.save(draft, np.ascontiguousarray(values))  # in the order of rows: some readers know no other

    return _write_planes(_depth_planes(result, "An array of depth", path), write, overwrite, check)


def _write_planes(
    planes: _Planes, write: Callable[[Path, str, NDArray[Any]], None], overwrite: bool, check: Check
) -> list[Path]:
    """Write every plane to its file, whole or not at all; returns the files."""
    with staged(list(planes), overwrite=overwrite) as drafts:
        for draft, (title, values) in zip(drafts, planes.values(), strict=True):
            check()
            write(draft, title, values)
    return list(planes)


def depth_files(path: Path, has_std: bool, has_flags: bool) -> list[Path]:
    """Files that hold depth, its deviation and the flags: ``NAME``, ``NAME_std`` and ``NAME_flags``."""
    endings = [""] + ["_std"] * has_std + ["_flags"] * has_flags
    return [path.with_name(f"{path.stem}{ending}{path.suffix}") for ending in endings]


def _depth_planes(result: xr.Dataset, format_name: str, path: Path) -> _Planes:
    """What `depth_files` hold, each with a sentence that says so; columns where there is no depth."""
    if "depth_mm" not in result and "column_px" in result:
        return _column_planes(result, path)
    require(result, format_name, "depth_mm")
    planes: list[tuple[str, NDArray[np.float32 | np.uint16]]] = [
        ("Depth along the camera axis, mm; NaN where there is no answer", plane(result, "depth_mm"))
    ]
    has_std, has_flags = "depth_std_mm" in result, "flags" in result
    if has_std:
        planes.append(("Standard deviation of depth, mm", plane(result, "depth_std_mm")))
    if has_flags:
        bits = ", ".join(f"{int(flag)} {FLAG_NAMES[flag]}" for flag in Flag)
        planes.append((f"Flags, the sum of: {bits}", np.asarray(result["flags"].values, np.uint16)))
    return dict(zip(depth_files(path, has_std, has_flags), planes, strict=True))


def _column_planes(result: xr.Dataset, path: Path) -> _Planes:
    """Decoded columns and rows of a scan without calibration: ``NAME_column``, ``NAME_row`` and so on."""
    named = {
        "column": ("column_px", "Projector column, px; NaN where there is no answer"),
        "column_std": ("column_std_px", "Standard deviation of the column, px"),
        "row": ("row_px", "Projector row, px; NaN where there is no answer"),
    }
    return {
        path.with_name(f"{path.stem}_{ending}{path.suffix}"): (title, plane(result, name))
        for ending, (name, title) in named.items()
        if name in result
    }
