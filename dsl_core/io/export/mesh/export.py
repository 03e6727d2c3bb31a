"""Meshes in the formats of other programs, each in the unit that its readers expect."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.io.export.common import provenance, require_suffix
from dsl_core.io.export.mesh.gltf import glb_bytes
from dsl_core.io.export.mesh.obj import material_files, material_text, write_obj
from dsl_core.io.export.mesh.stl import stl_bytes
from dsl_core.io.export.mesh.surface import Surface, grid_of, png_bytes, surface_of
from dsl_core.io.export.ply import write_mesh_ply
from dsl_core.io.staging import staged
from dsl_core.solve.many import Check, never
from dsl_core.words import readable

if TYPE_CHECKING:
    import xarray as xr

#: Endings of mesh files.
ENDINGS = (".glb", ".obj", ".ply", ".stl")


def export_mesh(
    result: xr.Dataset,
    path: Path,
    *,
    overwrite: bool = False,
    every: int = 1,
    endings: tuple[str, ...] = ENDINGS,
    check: Check = never,
) -> list[Path]:
    """Write the surface between neighbouring points, cut at depth jumps, as the ending of ``path`` says.

    ``.glb`` is binary glTF in metres, y up, with its texture; ``.obj`` comes with ``.mtl`` and ``.png``,
    ``.ply`` the colours and fields of each vertex, ``.stl`` nothing but triangles, all three in mm in the
    camera's frame. Only each ``every``-th row and column is used; ``endings`` are those that are
    accepted. Raises `StoreError`.
    """
    require_suffix(path, *endings)
    ending, origin = path.suffix.lower(), provenance(result)
    if ending == ".ply":
        write_mesh_ply(result, path, grid_of(result, every), overwrite=overwrite, check=check)
        return [path]
    surface = surface_of(result, every, check)
    if ending == ".obj":
        return _write_obj(surface, path, origin, overwrite, check)
    content = (
        glb_bytes(surface, readable(path.stem), origin)
        if ending == ".glb"
        else stl_bytes(surface, origin.get("scan_id", ""))
    )
    check()
    with staged([path], overwrite=overwrite) as (draft,):
        draft.write_bytes(content)
    return [path]


def _write_obj(
    surface: Surface, path: Path, origin: dict[str, str], overwrite: bool, check: Check
) -> list[Path]:
    others = [] if surface.texture is None else material_files(path)
    targets = [path, *others]
    with staged(targets, overwrite=overwrite) as drafts:
        if surface.texture is not None:
            drafts[1].write_text(material_text(readable(others[1].name)), encoding="utf-8")
            drafts[2].write_bytes(png_bytes(surface.texture))
        with drafts[0].open("w", encoding="utf-8", newline="\n") as file:
            write_obj(file, surface, readable(others[0].name) if others else "", origin, check)
    return targets


def mesh_files(path: Path, has_colour: bool) -> list[Path]:
    """The files that `export_mesh` writes."""
    return [path, *(material_files(path) if has_colour and path.suffix.lower() == ".obj" else ())]
