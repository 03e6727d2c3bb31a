"""Depth as TIFF: float32 in mm, NaN where there is no answer; deviation and flags in files beside it.

TIFF revision 6.0, one plane a file and uncompressed, so that readers of measured images take it as it is.
Pictures that show depth in colours are written by `export_png`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from dsl_core.io.export.common import ascii_text, depth_planes, provenance, require_suffix
from dsl_core.io.staging import staged
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr

#: The tag of TIFF that describes an image in words.
DESCRIPTION = 270


def export_tiff(
    result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write ``NAME.tiff``, ``NAME_std.tiff`` and ``NAME_flags.tiff``, as far as the result has them.

    Each file says what it holds and where it comes from. Raises `StoreError`.
    """
    require_suffix(path, ".tiff", ".tif")
    planes = depth_planes(result, "A TIFF of depth", path)
    source = [f"{key}: {value}" for key, value in provenance(result).items()]
    with staged(list(planes), overwrite=overwrite) as drafts:
        for draft, (title, values) in zip(drafts, planes.values(), strict=True):
            check()
            _write(draft, values, ascii_text("\n".join([title, *source])))
    return list(planes)


def _write(path: Path, values: NDArray[Any], description: str) -> None:
    from PIL import Image

    Image.fromarray(values).save(path, format="TIFF", tiffinfo={DESCRIPTION: description})
