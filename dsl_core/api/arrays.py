"""Pictures, columns and spectra of other instruments, as arrays."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike, NDArray

from dsl_core.api import FilePath, path_of
from dsl_core.extras import names_missing_packages

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from dsl_core.model.board import Board
    from dsl_core.model.calibration.geometry import GeometryCalibration
    from dsl_core.model.plan import CodeSet
    from dsl_core.model.rig import BayerPattern, Rig


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
def calibrate_geometry(
    poses: Iterable[Sequence[ArrayLike]],
    board: Board,
    projector_size_px: tuple[int, int],
    *,
    bayer: BayerPattern | None = None,
    camera_binning: float = 1.0,
    baseline_mm: float | None = None,
    hold: Collection[str] = (),
) -> GeometryCalibration:
    """Lenses of camera and projector, and their pose, from pictures of a board under Gray code.

    ``poses`` holds for each pose of the board its pictures, arrays (rows, columns) of values linear in light:
    pattern and inverse of every bit of the projector's columns, then of its rows if there are any, then white
    and black. Without rows the record is ``columns_only``: fy, cy and ty of the projector are assumed.
    ``board`` is a `Checkerboard` or `Charuco` of `dsl_core.model.board`, ``projector_size_px`` (width,
    height), ``bayer`` the mosaic of the camera, ``camera_binning`` how many pixels of the sensor a pixel
    spans, ``baseline_mm`` a measured distance of the devices that checks the printed size. ``hold`` names
    terms of distortion that are zero in both lenses, of k1, k2, k3 and tangential: few poses do not determine
    all::

        found = dsl.calibrate_geometry(poses, Checkerboard(columns=11, rows=7, square_mm=20), (640, 360))
        depth_mm = dsl.depth_of_columns(found, columns)

    The record has ``camera``, ``projector`` (px), ``pose`` (mm), each with its deviation, ``rms_px``, a line
    for each of the ``poses``, and ``warnings``: sentences on what is doubtful. Poses that cannot be read are
    left out. Raises `CalibrationError` when fewer than three are left, or pictures are missing or differ in
    size.
    """
    from dsl_core.workflows import stacks

    return stacks.calibrate_stacks(poses, board, projector_size_px, bayer, camera_binning, baseline_mm, hold)


@names_missing_packages
def depth_of_columns(calibration: Rig | GeometryCalibration, column_px: ArrayLike) -> NDArray[np.float64]:
    """Depth along the camera's axis, mm, of the columns (px) that all pixels see; NaN where there is none.

    ``calibration`` is what `load_calibration` or `calibrate_geometry` returns; ``column_px`` (rows, columns)
    has the camera's size. Each camera ray meets the plane of its projector column. Raises `DecodeError` for
    another size, and `CalibrationError` for what is no calibration.
    """
    from dsl_core.workflows import stacks

    return stacks.depth_of_columns(calibration, column_px)


def read_spectra(path: FilePath) -> dict[str, xr.DataArray]:
    """Reflectances of a spectroradiometer's or this program's file, by name, over ``wavelength_nm``.

    ASD, SVC, Spectral Evolution, Ocean, Avantes, CS-2000, JCAMP-DX, CGATS, ENVI libraries and tables of text
    are known; a spectrum without a name has that of the file. The attribute ``notes`` of each lists what was
    made of the file: values read as percent, taken as deleted, or left out; empty where nothing was. To
    compare one with a result, average it over its bands::

        tile = result.dsl.at_bands(dsl.read_spectra("tile.csv")["tile"])
        off = result.dsl.region((48, 28, 6, 5))["reflectance"] - tile

    Raises `CalibrationError` for a file without reflectances, and one whose units cannot be told.
    """
    import xarray as xr

    from dsl_core.io.spectra.reference_file import read_references

    over, found = "wavelength_nm", read_references(path_of(path))
    return {
        (each.name or path_of(path).stem): xr.DataArray(
            list(each.curve.values),
            {over: list(each.curve.wavelengths_nm)},
            (over,),
            name="reflectance",
            attrs={"notes": list(found.all_notes)},
        )
        for each in found.references
    }
