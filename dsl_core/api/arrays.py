"""Pictures, columns and spectra of other instruments, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike, NDArray

from dsl_core.api import FilePath
from dsl_core.extras import names_missing_packages

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from dsl_core.model.plan import CodeSet
    from dsl_core.model.rig import Rig


@names_missing_packages
def decode_stack(
    pictures: Sequence[ArrayLike],
    code: CodeSet,
    projector_size_px: tuple[int, int],
    white: ArrayLike | None = None,
    black: ArrayLike | None = None,
) -> xr.Dataset:
    """Columns and rows of the projector that each pixel sees, from grey pictures in the order of a code.

    ``pictures`` are arrays (rows, columns) of whole numbers as the camera gave them; ``code`` is a
    `CapturedCode` of `Stripes` (Gray, binary, XOR) and `Phases` (shifted sinusoids) of
    `dsl_core.model.captured_code`, ``projector_size_px`` (width, height). Without white or black the extremes
    of the pictures stand for it::

        code = CapturedCode(column_sets=(Stripes(code="gray", bits=10, inverse=False),))
        columns = dsl.decode_stack(pictures, code, (1024, 768))["column_px"]

    The dataset holds ``column_px`` and ``column_std_px`` (px, NaN where undecided), ``row_px`` if rows are
    coded, and ``flags``, over ``y`` and ``x``. Raises `DecodeError` when pictures differ in size, when their
    number is not that of the code, or when the code does not tell one position from another.
    """
    from dsl_core.workflows import stacks

    return stacks.decode_stack(pictures, code, projector_size_px, white, black)


@names_missing_packages
def depth_of_columns(calibration: Rig, column_px: ArrayLike) -> NDArray[np.float64]:
    """Depth along the camera's axis, mm, of the columns (px) that all pixels see; NaN where there is none.

    ``calibration`` is what `load_calibration` returns; ``column_px`` (rows, columns) has the camera's size.
    Each camera ray meets the plane of its projector column. Raises `DecodeError` for another size.
    """
    from dsl_core.workflows import stacks

    return stacks.depth_of_columns(calibration, column_px)


def read_spectra(path: FilePath) -> dict[str, xr.DataArray]:
    """Reflectances of a spectroradiometer's or this program's file, by name, over ``wavelength_nm``.

    ASD, SVC, Spectral Evolution, Ocean, Avantes, CS-2000, JCAMP-DX, CGATS, ENVI libraries and tables of text
    are known; a spectrum without a name has that of the file. To compare one with a result, take it at its
    bands::

        tile = dsl.read_spectra("tile.csv")["tile"].interp(wavelength_nm=result["wavelength_nm"])
        off = result.dsl.region((48, 28, 6, 5))["reflectance"] - tile

    Raises `CalibrationError` for a file without reflectances, and one whose units cannot be told.
    """
    import xarray as xr

    from dsl_core.io.spectra.reference_file import read_references

    over = "wavelength_nm"
    return {
        (each.name or Path(path).stem): xr.DataArray(
            list(each.curve.values), {over: list(each.curve.wavelengths_nm)}, (over,), name="reflectance"
        )
        for each in read_references(Path(path)).references
    }
