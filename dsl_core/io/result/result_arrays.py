"""A result in memory as plain arrays, for display: band first, float32, read one band after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.result.result_file import load_result
from dsl_core.model.result import VARIABLES
from dsl_core.progress import NoProgress, Progress


@dataclass(frozen=True)
class ResultArrays:
    """The arrays of a result by the names of `VARIABLES`; what the result does not hold is missing."""

    path: Path
    wavelengths_nm: NDArray[np.float64]
    arrays: Mapping[str, NDArray[Any]]
    attributes: Mapping[str, Any] = field(default_factory=dict)

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

    def at(self, name: str, pixel: tuple[int, int]) -> NDArray[Any]:
        """Everything that a variable holds for a pixel ``(x, y)``: one value, or one per band or axis."""
        return self.arrays[name][..., pixel[1], pixel[0]]

    def holds(self, pixel: tuple[int, int]) -> bool:
        """Whether a pixel ``(x, y)`` is in the image."""
        height, width = self.shape
        return 0 <= pixel[0] < width and 0 <= pixel[1] < height


def load_arrays(path: Path, progress: Progress | None = None) -> ResultArrays:
    """Read a whole result; never holds more than the result and one band. Raises `StoreError`."""
    progress = progress or NoProgress()
    result = load_result(path)
    if "depth_mm" not in result:
        raise StoreError(
            f"{path} contains columns of the projector and no depth. Reconstruct its scan with a calibration,"
            " or export the columns with 'dsl-scan export'."
        )
    names = [name for name in VARIABLES if name in result]
    total = sum(len(result[name]) if result[name].ndim > 2 else 1 for name in names)
    done, arrays = 0, {}
    for name in names:
        variable = result[name]
        kind = np.float32 if variable.dtype.kind == "f" else variable.dtype
        arrays[name] = np.empty(variable.shape, kind)
        parts = range(len(variable)) if variable.ndim > 2 else [...]
        for part in parts:
            progress.report("read the result", done, total)
            arrays[name][part] = variable[part].values
            done += 1
    nm = result["wavelength_nm"].values if "wavelength_nm" in result.coords else np.empty(0)
    return ResultArrays(path, np.asarray(nm, np.float64), arrays, dict(result.attrs))
