"""Spectral cube as ENVI (band sequential, float32, little endian); the `spectral` package writes the header.

Pixels and bands without an answer hold the header's ``data ignore value``, because many readers of ENVI
files do not expect NaN.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.io.export.common import ascii_text, plane, provenance, require, require_suffix, wavelengths_nm
from dsl_core.io.staging import staged
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

IGNORE_VALUE = -9999.0


def export_envi(
    result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write ``NAME.hdr`` with its data ``NAME.img``, and ``NAME_std.*`` where the result has a deviation.

    ``path`` is the header's. Raises `StoreError`.
    """
    require_suffix(path, ".hdr")
    require(result, "An ENVI cube", "reflectance", "wavelength_nm")
    cubes = {"reflectance": path}
    if "reflectance_std" in result:
        cubes["reflectance_std"] = path.with_name(f"{path.stem}_std.hdr")
    targets = [target for header in cubes.values() for target in (header, header.with_suffix(".img"))]
    with staged(targets, overwrite=overwrite) as drafts:
        for name, draft in zip(cubes, drafts[::2], strict=True):
            _write_cube(result, name, draft, check)
    return targets


def _write_cube(result: xr.Dataset, name: str, header: Path, check: Check) -> None:
    from spectral.io import envi

    cube, centres = plane(result, name), wavelengths_nm(result)
    bands, lines, samples = cube.shape
    metadata = {
        "description": _description(result, name),
        "samples": samples,
        "lines": lines,
        "bands": bands,
        "header offset": 0,
        "file type": "ENVI Standard",
        "data type": 4,
        "interleave": "bsq",
        "byte order": 0,
        "wavelength": [f"{w:g}" for w in centres],
        "wavelength units": "Nanometers",
        "band names": [f"{name} {w:g} nm" for w in centres],
        "data ignore value": f"{IGNORE_VALUE:g}",
        "z plot titles": ["Wavelength (nm)", f"{name} (1)"],
    }
    envi.write_envi_header(str(header), metadata)
    # Band after band: a cube in one piece would keep every other thread waiting while it is copied.
    with header.with_suffix(".img").open("wb") as file:
        for band in cube:
            check()
            np.where(np.isnan(band), np.float32(IGNORE_VALUE), band).astype("<f4").tofile(file)


def _description(result: xr.Dataset, name: str) -> str:
    long_name = str(result[name].attrs.get("long_name", name))
    sources = [f"{key}: {value}" for key, value in provenance(result).items()]
    # Braces and commas structure an ENVI header.
    text = "; ".join([f"{long_name} (unit 1)", *sources])
    return ascii_text(text.translate(str.maketrans("{},", "();")))
