"""Depth as an array of NumPy: float32 in mm, NaN where there is no answer; deviation and flags beside it.

The format has no room for where the data come from; ``NAME.zarr`` itself says it.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.io.export.common import depth_planes, require_suffix
from dsl_core.io.staging import staged
from dsl_core.solve.many import Check, never

if TYPE_CHECKING:
    import xarray as xr


def export_npy(
    result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write ``NAME.npy``, ``NAME_std.npy`` and ``NAME_flags.npy``, as far as the result has them.

    Raises `StoreError`.
    """
    require_suffix(path, ".npy")
    planes = depth_planes(result, "An array of depth", path)
    with staged(list(planes), overwrite=overwrite) as drafts:
        for draft, (_, values) in zip(drafts, planes.values(), strict=True):
            check()
            np.save(draft, values)
    return list(planes)
