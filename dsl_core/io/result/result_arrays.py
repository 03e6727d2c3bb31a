"""A result in memory as plain arrays, for display: band first, float32, read one band after the other."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.result.result_file import load_result
from dsl_core.model.result import VARIABLES
from dsl_core.progress import NoProgress, Progress

if TYPE_CHECKING:
    import xarray as xr

#: What is read of a variable between two looks at whether the person has cancelled.
AT_ONCE_BYTES = 16e6


@dataclass(frozen=True)
class ResultArrays:
    """The arrays of a result by the names of `VARIABLES`; what the result does not hold is not there.

    ``missing`` names what `completed` put in its place as unknown.
    """

    path: Path
    wavelengths_nm: NDArray[np.float64]
    arrays: Mapping[str, NDArray[Any]]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    missing: tuple[str, ...] = ()

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        height, width = self.arrays["depth_mm"].shape
        return int(height), int(width)

    @property
    def has_spectra(self) -> bool:
        """Whether reflectance is there, and not only depth."""
        return "reflectance" in self.arrays

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The array of a name; raises ``KeyError``."""
        return self.arrays[name]

    def known(self, name: str) -> NDArray[Any] | None:
        """The array of a name; None where the result does not hold it itself."""
        return None if name in self.missing else self.arrays.get(name)

    def at(self, name: str, pixel: tuple[int, int]) -> NDArray[Any]:
        """Everything that a variable holds for a pixel ``(x, y)``: one value, or one per band or axis."""
        return self.arrays[name][..., pixel[1], pixel[0]]

    @property
    def picture(self) -> tuple[Path, tuple[int, int]]:
        """Path and shape: the same for a result and for what becomes of it, which is seen in the same way."""
        return self.path, self.shape

    def holds(self, pixel: tuple[int, int]) -> bool:
        """Whether a pixel ``(x, y)`` is in the image."""
        height, width = self.shape
        return 0 <= pixel[0] < width and 0 <= pixel[1] < height


def _parts(variable: xr.DataArray) -> list[slice]:
    """Slices of the first axis, of as many bands as `AT_ONCE_BYTES` hold: each read has a cost of its own."""
    each = max(1, int(AT_ONCE_BYTES // max(1, 4 * math.prod(variable.shape[1:]))))
    return [slice(first, first + each) for first in range(0, len(variable), each)]


def _ordered(result: xr.Dataset, path: Path) -> xr.Dataset:
    """The same with axes and bands in the order that is relied on."""
    for name in VARIABLES:
        axes = VARIABLES[name][0]
        if name in result and set(result[name].dims) != set(axes):
            has = ", ".join(str(axis) for axis in result[name].dims)
            raise StoreError(
                f"{path} has {name} along the axes ({has}); ({', '.join(axes)}) are needed. Rename them where"
                " the result was made."
            )
        if name in result:
            result[name] = result[name].transpose(*axes)
    if "reflectance" not in result:
        return result
    nm = result["wavelength_nm"].values if "wavelength_nm" in result.coords else np.empty(0)
    if not nm.size or not np.isfinite(nm).all() or len(np.unique(nm)) < nm.size:
        raise StoreError(
            f"{path} has a reflectance, but not one wavelength for each of its bands. Add the coordinate"
            " wavelength_nm, in nm."
        )
    return result if (np.diff(nm) > 0).all() else result.isel(wavelength_nm=np.argsort(nm))


def load_arrays(path: Path, progress: Progress | None = None) -> ResultArrays:
    """Read a whole result, with its bands rising; never holds much more than it.

    Raises `StoreError`, also for a result of another program whose arrays have other axes.
    """
    progress = progress or NoProgress()
    result = _ordered(load_result(path), path)
    if not {"depth_mm", "reflectance"} & set(result):
        raise StoreError(
            f"{path} contains columns of the projector and no depth. Reconstruct its scan with a calibration,"
            " or export the columns with 'dsl-scan export'."
        )
    parts = {name: _parts(result[name]) for name in VARIABLES if name in result}
    total, done, arrays = sum(map(len, parts.values())), 0, {}
    for name in parts:
        variable = result[name]
        kind = np.float32 if variable.dtype.kind == "f" else variable.dtype
        arrays[name] = np.empty(variable.shape, kind)
        for part in parts[name]:
            progress.report("read the result", done, total)
            arrays[name][part] = variable[part].values
            done += 1
    nm = result["wavelength_nm"].values if "wavelength_nm" in result.coords else np.empty(0)
    if "depth_mm" not in arrays:
        # Where pixels are is unknown; their spectra can be looked at all the same.
        arrays["depth_mm"] = np.full(arrays["reflectance"].shape[1:], np.nan, np.float32)
        return ResultArrays(path, np.asarray(nm, np.float64), arrays, dict(result.attrs), ("depth_mm",))
    return ResultArrays(path, np.asarray(nm, np.float64), arrays, dict(result.attrs))
