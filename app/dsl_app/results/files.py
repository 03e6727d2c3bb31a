"""What a result looks like as a picture, and which files an export of it writes. No Qt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DslError
from dsl_core.io.result.result_arrays import ResultArrays


def is_complete(session: Path) -> bool:
    """Whether a scan lacks no frame; who reconstructs it complains of one that cannot be read."""
    from dsl_core.io.scan.folder import ScanReader

    try:
        return not ScanReader(session).missing()
    except DslError:
        return True


def expected_files(targets: dict[str, Path], result: ResultArrays) -> list[Path]:
    """Files that an export writes."""
    from dsl_core.io.export.depth_maps import depth_files

    files: list[Path] = []
    for form, path in targets.items():
        if form == "envi":
            headers = [path]
            if "reflectance_std" in result.arrays:
                headers.append(path.with_name(f"{path.stem}_std.hdr"))
            files += [file for header in headers for file in (header, header.with_suffix(".img"))]
        elif form in ("tiff", "npy"):
            files += depth_files(path, "depth_std_mm" in result.arrays, "flags" in result.arrays)
        elif form == "png":
            files += sorted(path.parent.glob(f"{path.stem}_*.png"))
        else:
            files.append(path)
    return files


def picture_of(rgb: NDArray[np.float32]) -> NDArray[np.uint8]:
    """RGBA bytes (rows, columns, 4) of colours (3, rows, columns), 0..1; transparent without an answer."""
    picture = np.empty((*rgb.shape[1:], 4), np.uint8)
    for channel in range(3):
        level = np.nan_to_num(rgb[channel]).clip(0, 1)
        picture[..., channel] = (level * 255 + 0.5).astype(np.uint8)
    picture[..., 3] = np.where(np.isfinite(rgb[0]), 255, 0)
    return picture
