"""Results for other programs: one file a format, found by name among `formats`.

Every exporter writes whole files or nothing, replaces files only with ``overwrite=True``, names the scan
and the program's version where the format has room for it, and keeps pixels without an answer
recognisable: NaN, or what the format has in its place. ``check`` is called every second or so, and may
raise to stop; then nothing is left behind.

Packages add formats by the entry-point group ``dsl_scan.exporters``, whose values are `Format`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_core.errors import StoreError
from dsl_core.io.export.csv import Pixel, export_csv, whole_pixels
from dsl_core.io.export.depth_maps import export_npy, export_tiff
from dsl_core.io.export.envi import export_envi
from dsl_core.io.export.exr import export_exr
from dsl_core.io.export.format import Exporter, Format
from dsl_core.io.export.mesh.export import export_mesh
from dsl_core.io.export.ply import export_ply
from dsl_core.io.export.png import export_png
from dsl_core.io.export.spectra import export_spectra, named_spectrum
from dsl_core.io.plugins import load_plugins, told_as
from dsl_core.model.result_order import canonical
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "GROUP",
    "Exporter",
    "Format",
    "export",
    "export_by_ending",
    "export_csv",
    "export_mesh",
    "export_png",
    "formats",
]

GROUP = "dsl_scan.exporters"
#: Formats of this package, as the window lists them.
BUILT_IN = (
    Format("ply", ".ply", "PLY – points with normals, colours, spectra and deviations", export_ply),
    Format(
        "glb", ".glb", "glTF – surface with its colours, in metres", partial(export_mesh, endings=(".glb",))
    ),
    Format(
        "obj",
        ".obj",
        "OBJ – surface with its colours, in mm, in three files",
        partial(export_mesh, endings=(".obj",)),
    ),
    Format("stl", ".stl", "STL – surface without colours, in mm", partial(export_mesh, endings=(".stl",))),
    Format("mesh", ".ply", "A surface, in the format that the ending says", export_mesh, listed=False),
    Format("envi", ".hdr", "ENVI – spectral cube and its deviation", export_envi, needs_spectra=True),
    Format("exr", ".exr", "OpenEXR – spectral image", export_exr, needs_spectra=True),
    Format(
        "csv",
        ".csv",
        "CSV – spectra of the pins, with deviations",
        export_csv,
        needs_spectra=True,
        needs_pins=True,
    ),
    Format(
        "tiff",
        ".tiff",
        "TIFF – depth in mm, with its deviation and flags in separate files",
        export_tiff,
        endings=(".tif",),
    ),
    Format("npy", ".npy", "NumPy – depth in mm, deviation and flags as arrays", export_npy),
    Format("png", ".png", "PNG – pictures of colour, depth, the band shown, and flags", export_png),
)


@cache
def formats() -> dict[str, Format]:
    """All formats by their keys: those of this package, then those of others, which replace none."""
    found = {each.key: each for each in BUILT_IN}
    for each in load_plugins(GROUP, Format):
        found.setdefault(each.key.lower(), _guarded(each))
    return found


def _guarded(added: Format) -> Format:
    """A format of another package whose mistakes are told as its own; names are compared without case."""

    def write(result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never) -> list[Path]:
        with told_as(f"The export format {added.key!r}", StoreError):
            return [Path(file) for file in added.write(result, path, overwrite=overwrite, check=check)]

    return replace(added, key=added.key.lower(), write=write)


def export(
    result: xr.Dataset, path: Path, name: str, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write a result in the named format; raises `StoreError` for a name that is not one of `formats`."""
    if name not in formats():
        raise StoreError(f"There is no export format {name!r}. Choose one of {_names()}.")
    return formats()[name].write(canonical(result), path, overwrite=overwrite, check=check)


def export_by_ending(
    result: xr.Dataset,
    path: Path,
    name: str | None = None,
    *,
    pixels: Sequence[Pixel] = (),
    overwrite: bool = False,
) -> list[Path]:
    """As `export`, in the format that the ending of the path says unless one is named.

    A table (csv) is of ``pixels``, (x, y) each, or of the spectrum that the result is. Raises `StoreError`
    for what a format does not hold, and where the disk fails.
    """
    result, ending, pixels = canonical(result), path.suffix.lower(), whole_pixels(pixels)
    listed = [each for each in formats().values() if each.listed]
    meant = next((each.key for each in listed if ending in (each.suffix, *each.endings)), ending[1:])
    chosen = (name or meant).lower()
    if not chosen:
        raise StoreError(
            f"{path} has no ending that says its format. Add one, or give the format: {_names()}."
        )
    is_spectrum = "reflectance" in result and result["reflectance"].ndim == 1
    if is_spectrum and chosen == "csv":
        return [export_spectra([named_spectrum(result)], path, result.attrs, overwrite=overwrite)]
    if is_spectrum:
        raise StoreError(f"A spectrum is exported as csv, not as {chosen}. Choose a name that ends in .csv.")
    if pixels and chosen != "csv":
        raise StoreError(f"Pixels are for csv, not for {chosen}. Leave them out, or choose csv.")
    if pixels:
        return export_csv(result, path, pixels=pixels, overwrite=overwrite)
    return export(result, path, chosen, overwrite=overwrite)


def _names() -> str:
    return ", ".join(sorted(formats()))
