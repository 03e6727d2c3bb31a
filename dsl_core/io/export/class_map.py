"""Class maps for other programs: an ENVI classification, and points with their class."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.export.common import ascii_text, plane, provenance, require, require_suffix
from dsl_core.io.export.ply import write_points
from dsl_core.io.staging import staged

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Classified:
    """A map (rows, columns) of values with a label and a colour ("#rrggbb") each; ``fit`` and ``margin`` too.

    ``method`` says in a sentence how the values came about.
    """

    values: NDArray[np.uint8]
    labels: tuple[str, ...]
    colours: tuple[str, ...]
    fit: NDArray[np.float32]
    margin: NDArray[np.float32]
    method: str


def export_class_envi(
    result: xr.Dataset, found: Classified, path: Path, *, overwrite: bool = False
) -> list[Path]:
    """Write ``NAME.hdr`` and ``NAME.img``, file type "ENVI Classification"; raises `StoreError`."""
    require_suffix(path, ".hdr")
    from spectral.io import envi

    levels = [level for colour in found.colours for level in bytes.fromhex(colour[1:])]
    source = [f"{key}: {value}" for key, value in provenance(result).items()]
    metadata = {
        "description": _plain("; ".join([found.method, *source])),
        "samples": found.values.shape[1],
        "lines": found.values.shape[0],
        "bands": 1,
        "header offset": 0,
        "file type": "ENVI Classification",
        "data type": 1,
        "interleave": "bsq",
        "byte order": 0,
        "classes": len(found.labels),
        "class lookup": [str(level) for level in levels],
        "class names": [_plain(label) for label in found.labels],
        "band names": ["class"],
    }
    targets = [path, path.with_suffix(".img")]
    with staged(targets, overwrite=overwrite) as (header, data):
        envi.write_envi_header(str(header), metadata)
        found.values.tofile(data)
    return targets


def _plain(text: str) -> str:
    """Text in which nothing structures an ENVI header."""
    return ascii_text(" ".join(text.translate(str.maketrans("{},", "();")).split()))


def export_class_ply(
    result: xr.Dataset, found: Classified, path: Path, *, overwrite: bool = False
) -> list[Path]:
    """Write the points in mm, coloured by class, with the fields class, fit and margin; raises `StoreError`.

    The names of the classes are comments of the header.
    """
    require_suffix(path, ".ply")
    require(result, "A PLY file", "points_mm")
    points = plane(result, "points_mm")
    lit = np.isfinite(points).all(axis=0)
    colours = np.array([list(bytes.fromhex(colour[1:])) for colour in found.colours], np.uint8)
    red, green, blue = colours[found.values[lit]].T
    columns = dict(zip(("x", "y", "z"), points[:, lit].astype("<f4"), strict=True))
    columns |= {"red": red, "green": green, "blue": blue}
    columns["scalar_class"] = found.values[lit].astype("<f4")
    columns["scalar_fit"] = found.fit[lit].astype("<f4")
    columns["scalar_margin"] = found.margin[lit].astype("<f4")
    names = {f"class {value}": label for value, label in enumerate(found.labels)}
    with staged([path], overwrite=overwrite) as (draft,):
        write_points(draft, columns, {**names, "method": found.method, **provenance(result)})
    return [path]
