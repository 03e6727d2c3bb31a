"""A surface as Wavefront OBJ in mm, with its material (.mtl) and texture (.png).

Layout: Wavefront Technologies, Object Files (.obj), appendix B1 of the Advanced Visualizer's manual (1995).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.export.common import ascii_text
from dsl_core.io.export.mesh.surface import Surface
from dsl_core.solve.many import Check
from dsl_core.words import readable

#: Lines written between two checks.
_LINES = 20_000
MATERIAL = "surface"


def material_files(path: Path) -> list[Path]:
    """The files of material and texture; names without spaces, at which many readers end a name."""
    # As this locale says what is written in UTF-8 within the files.
    stem = os.fsdecode("_".join(readable(path.stem).split()).encode())
    return [path.with_name(f"{stem}.mtl"), path.with_name(f"{stem}.png")]


def write_obj(
    file: IO[str], surface: Surface, material: str, origin: Mapping[str, str], check: Check
) -> None:
    """Write the geometry; ``material`` is the name of the .mtl file, empty without a texture."""
    file.write("# unit mm, camera frame: x right, y down, z forward\n")
    file.writelines(
        f"# {key}: {ascii_text(' '.join(value.split()))[:200]}\n" for key, value in origin.items()
    )
    if material:
        file.write(f"mtllib {material}\nusemtl {MATERIAL}\n")
    places = surface.places.copy()
    # OBJ counts from the lower left corner.
    places[:, 1] = 1 - places[:, 1]
    tables: list[tuple[str, NDArray[np.float32]]] = [("v %.5f %.5f %.5f\n", surface.points_mm)]
    if material:
        tables.append(("vt %.6f %.6f\n", places))
    tables.append(("vn %.4f %.4f %.4f\n", surface.normals))
    for form, values in tables:
        for lines in _slices(len(values)):
            check()
            file.write("".join(form % tuple(row) for row in values[lines].tolist()))
    corner = "%d/%d/%d" if material else "%d//%d"
    form, times = f"f {corner} {corner} {corner}\n", 3 if material else 2
    for lines in _slices(len(surface.triangles)):
        check()
        numbered = np.repeat(surface.triangles[lines] + 1, times, axis=1)
        file.write("".join(form % tuple(row) for row in numbered.tolist()))


def material_text(texture: str) -> str:
    """The .mtl file: a dull surface with the texture of a file of this name."""
    lines: Sequence[str] = (
        f"newmtl {MATERIAL}",
        "Ka 0 0 0",
        "Kd 1 1 1",
        "Ks 0 0 0",
        "illum 1",
        f"map_Kd {texture}",
    )
    return "\n".join(lines) + "\n"


def _slices(count: int) -> Iterator[slice]:
    return (slice(first, first + _LINES) for first in range(0, count, _LINES))
