"""Results for other programs: one file a format, found by name in `FORMATS`.

Every exporter writes whole files or nothing, replaces files only with ``overwrite=True``, names the scan
and the program's version where the format has room for it, and keeps pixels without an answer
recognisable: NaN, or what the format has in its place. ``check`` is called every second or so, and may
raise to stop; then nothing is left behind.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dsl_core.errors import StoreError
from dsl_core.io.export.csv import export_csv
from dsl_core.io.export.depth_maps import export_npy, export_tiff
from dsl_core.io.export.envi import export_envi
from dsl_core.io.export.exr import export_exr
from dsl_core.io.export.mesh.export import export_mesh
from dsl_core.io.export.ply import export_ply
from dsl_core.io.export.png import export_png
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["FORMATS", "Exporter", "export", "export_by_ending", "export_csv", "export_mesh", "export_png"]


class Exporter(Protocol):
    """What every format offers; some take more keywords, all of them optional here."""

    def __call__(
        self, result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
    ) -> list[Path]:
        """Write the result and return the files written; raises `StoreError`, and what ``check`` raises."""


#: Exporters by the name of their format.
FORMATS: dict[str, Exporter] = {
    "csv": export_csv,
    "envi": export_envi,
    "exr": export_exr,
    "glb": partial(export_mesh, endings=(".glb",)),
    "mesh": export_mesh,
    "npy": export_npy,
    "obj": partial(export_mesh, endings=(".obj",)),
    "ply": export_ply,
    "png": export_png,
    "stl": partial(export_mesh, endings=(".stl",)),
    "tiff": export_tiff,
}


def export(
    result: xr.Dataset, path: Path, name: str, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write a result in the named format; raises `StoreError` for a name that is not in `FORMATS`."""
    if name not in FORMATS:
        raise StoreError(f"There is no export format {name!r}. Choose one of {', '.join(FORMATS)}.")
    return FORMATS[name](result, path, overwrite=overwrite, check=check)


#: Formats by the ending of a file where it is not the format's own name.
_ENDINGS = {"hdr": "envi", "tif": "tiff"}


def export_by_ending(
    result: xr.Dataset, path: Path, name: str | None = None, *, overwrite: bool = False
) -> list[Path]:
    """As `export`, in the format that the ending of the path says unless one is named."""
    ending = path.suffix.removeprefix(".").lower()
    chosen = (name or _ENDINGS.get(ending, ending)).lower()
    if not chosen:
        raise StoreError(
            f"{path} has no ending that says its format. Add one, or give the format: {', '.join(FORMATS)}."
        )
    return export(result, path, chosen, overwrite=overwrite)
