"""Point cloud or mesh as binary little-endian PLY, with spectra as ``scalar_`` properties.

Layout: G. Turk, The PLY Polygon File Format (1994); the prefix ``scalar_`` is how CloudCompare names and
recognises scalar fields. Only pixels with a point are written; a band without an answer is NaN, a
colour without an answer is black (``uchar`` has no NaN).
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.export.common import (
    ascii_text,
    colours,
    plane,
    provenance,
    require,
    require_suffix,
    wavelengths_nm,
)
from dsl_core.io.staging import staged
from dsl_core.solve.grid_mesh import GridMesh
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

#: Readers built on rply (CloudCompare, Open3D) refuse lines of 1,024 characters, VTK reads no points after
#: long ones; no reader is known to refuse this length.
_LONGEST_LINE = 240
_PLY_NAMES = {"<f4": "float", "|u1": "uchar"}


def export_ply(
    result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write the points in mm with normals, colours, spectra, depth's standard deviation and flags.

    What the result lacks is left out, points excepted. Raises `StoreError`.
    """
    require_suffix(path, ".ply")
    require(result, "A PLY file", "points_mm")
    lit: NDArray[np.bool_] = np.asarray(np.isfinite(plane(result, "points_mm")).all(axis=0))
    table = _table(result, lit, check)
    with staged([path], overwrite=overwrite) as (draft,), draft.open("wb") as file:
        file.write(_header(table, provenance(result)))
        table.tofile(file)
    return [path]


def write_mesh_ply(
    result: xr.Dataset, path: Path, mesh: GridMesh, *, overwrite: bool, check: Check = never
) -> None:
    """As `export_ply`, but the pixels of a mesh, and its triangles."""
    lit = np.zeros(result["points_mm"].shape[1:], bool)
    lit.ravel()[mesh.pixels] = True
    # Pixels of a mesh ascend, so vertices are in the order of the mask.
    table = _table(result, lit, check)
    faces = np.empty(len(mesh.triangles), [("corners", "u1"), ("vertices", "<i4", 3)])
    faces["corners"], faces["vertices"] = 3, mesh.triangles
    with staged([path], overwrite=overwrite) as (draft,), draft.open("wb") as file:
        file.write(_header(table, provenance(result), len(faces)))
        table.tofile(file)
        check()
        faces.tofile(file)


def _table(result: xr.Dataset, lit: NDArray[np.bool_], check: Check) -> NDArray[Any]:
    """The vertices with all their properties."""
    return _filled(_columns(result, lit, check), check)


def _filled(columns: dict[str, NDArray[Any]], check: Check) -> NDArray[Any]:
    """Properties, each with one value per vertex, as one table."""
    count = len(next(iter(columns.values())))
    table = np.empty(count, [(name, column.dtype.str) for name, column in columns.items()])
    for name, column in columns.items():
        check()
        table[name] = column
    return table


def write_points(draft: Path, columns: dict[str, NDArray[Any]], comments: dict[str, str]) -> None:
    """Write properties, each with one value (float32 or uint8) per point, to a file that is being staged."""
    with draft.open("wb") as file:
        file.write(_header(table := _filled(columns, never), comments))
        table.tofile(file)


def _columns(result: xr.Dataset, lit: NDArray[np.bool_], check: Check) -> dict[str, NDArray[Any]]:
    """Properties in the order they are written, each with one value per lit pixel."""
    columns: dict[str, NDArray[Any]] = {}
    for name, properties in (("points_mm", ("x", "y", "z")), ("normals", ("nx", "ny", "nz"))):
        if name in result:
            columns.update(zip(properties, plane(result, name)[:, lit].astype("<f4"), strict=True))
    rgb = colours(result)
    if rgb is not None:
        levels = np.nan_to_num(np.clip(rgb[:, lit], 0, 1)) * 255
        columns.update(zip(("red", "green", "blue"), np.rint(levels).astype("u1"), strict=True))
    if "reflectance" in result:
        for band, wavelength in enumerate(wavelengths_nm(result)):
            check()
            values = np.asarray(result["reflectance"][band].values, "<f4")
            columns[f"scalar_{wavelength:g}nm"] = values[lit]
    if "depth_std_mm" in result:
        columns["scalar_depth_std_mm"] = plane(result, "depth_std_mm")[lit].astype("<f4")
    if "flags" in result:
        # Readers differ on short integers; float32 holds every combination of flags exactly.
        columns["scalar_flags"] = result["flags"].values[lit].astype("<f4")
    return columns


def _header(table: NDArray[Any], comments: dict[str, str], triangles: int = 0) -> bytes:
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        "comment unit mm, camera frame: x right, y down, z forward",
    ]
    lines += [_comment(key, value) for key, value in comments.items()]
    lines.append(f"element vertex {len(table)}")
    assert table.dtype.names is not None
    lines += [f"property {_PLY_NAMES[table.dtype[name].str]} {name}" for name in table.dtype.names]
    if triangles:
        lines += [f"element face {triangles}", "property list uchar int vertex_indices"]
    return ("\n".join([*lines, "end_header"]) + "\n").encode("ascii")


def _comment(key: str, value: str) -> str:
    """A line of the header; of a long value its beginning, and how to find and recognise the whole."""
    line = ascii_text(" ".join(f"comment {key}: {value}".split()))
    if len(line) <= _LONGEST_LINE:
        return line
    digest = hashlib.sha256(value.encode()).hexdigest()[:16]
    rest = f" ... ({len(value)} characters, SHA-256 {digest}...; whole in the attributes of the result)"
    return line[: _LONGEST_LINE - len(rest)] + rest
