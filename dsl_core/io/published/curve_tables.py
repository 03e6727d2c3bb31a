"""Curves of the published calibration: three arrays of NumPy, and one of columns that is not read.

=========================================  =====================================================
file                                       content
=========================================  =====================================================
``CRF.npy``                                camera response, (bands, 3) = R, G, B
``PEF.npy``                                projector emission, (bands, 3) = R, G, B
``DG.npy``                                 efficiency, (3, bands) = orders -1, 0, +1
``first_order_correspondence_model.npy``   line index, (bands, depths, rows, columns), int16, not read
=========================================  =====================================================

No file holds its wavelengths; the number of bands tells them (see ``_GRIDS``). Earlier versions of the
published code call the tables ``CRF_cam.npy``, ``CRF_proj.npy`` and ``intensity_dg.npy``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.published.curves import centres_nm
from dsl_core.io.reading import read_array
from dsl_core.io.staging import staged
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid

#: Published name, then the name of earlier versions.
TABLE_NAMES = {
    "response": ("CRF.npy", "CRF_cam.npy"),
    "emission": ("PEF.npy", "CRF_proj.npy"),
    "efficiency": ("DG.npy", "intensity_dg.npy"),
}
FIRST_ORDER_NAME = "first_order_correspondence_model.npy"
ORDERS = (-1, 0, 1)
#: Noise apart, no order has more than all of the light.
MOST_EFFICIENCY = 1.05

#: Grids the published code uses, by number of bands.
_GRIDS = {
    47: WavelengthGrid(start_nm=430, stop_nm=660, step_nm=5),
    24: WavelengthGrid(start_nm=430, stop_nm=660, step_nm=10),
    25: WavelengthGrid(start_nm=420, stop_nm=660, step_nm=10),
    29: WavelengthGrid(start_nm=400, stop_nm=680, step_nm=10),
}


def load_tables(folder: Path) -> tuple[Rgb, Rgb, dict[int, SpectralCurve]]:
    """Read response, emission and efficiency of the orders, whose numbers of bands must be published ones.

    Raises `CalibrationError` that names the file and the shape it should have.
    """
    response, emission, efficiency = (_load(folder, name) for name in TABLE_NAMES)
    return (
        (response[0], response[1], response[2]),
        (emission[0], emission[1], emission[2]),
        dict(zip(ORDERS, efficiency, strict=True)),
    )


def save_tables(rig: Rig, folder: Path, *, overwrite: bool = False) -> list[Path]:
    """Write a rig's curves as the three tables, 430 to 660 nm every 5 nm.

    Raises `StoreError` when a file already exists (unless ``overwrite``), `CalibrationError` when the rig
    has no efficiency for one of the orders -1, 0, +1.
    """
    # Order zero is one by definition of a rig's efficiencies, and then not in the rig.
    efficiency = {0: SpectralCurve.of([550.0], [1.0]), **rig.efficiency}
    lacking = [order for order in ORDERS if order not in efficiency]
    if lacking:
        raise CalibrationError(
            f"The rig {rig.name!r} has no efficiency of order {lacking[0]:+d}, which DG.npy contains."
            " Export the rig as JSON instead, or calibrate with that order."
        )
    centres = WavelengthGrid().centres_nm
    tables = {
        "response": np.stack([curve.at(centres) for curve in rig.response], axis=-1),
        "emission": np.stack([curve.at(centres) for curve in rig.emission], axis=-1),
        "efficiency": np.stack([efficiency[order].at(centres) for order in ORDERS]),
    }
    targets = [folder / TABLE_NAMES[name][0] for name in tables]
    with staged(targets, overwrite=overwrite) as drafts:
        for draft, table in zip(drafts, tables.values(), strict=True):
            np.save(draft, table, allow_pickle=False)
    return targets


def find_table(folder: Path, name: str) -> Path | None:
    """The file of a table under its published or its earlier name."""
    return next((folder / n for n in TABLE_NAMES[name] if (folder / n).is_file()), None)


def _load(folder: Path, name: str) -> list[SpectralCurve]:
    path = find_table(folder, name)
    if path is None:
        raise CalibrationError(
            f"{folder / TABLE_NAMES[name][0]} does not exist: the table of the {name} is needed. Copy it"
            " there."
        )
    table = np.asarray(_open(path), np.float64)
    rows = table.T if name != "efficiency" and table.ndim == 2 else table
    if rows.ndim != 2 or len(rows) != 3:
        wanted = "(3, bands), orders -1, 0, +1" if name == "efficiency" else "(bands, 3), channels R, G, B"
        raise CalibrationError(f"{path} has shape {table.shape}; {wanted} is needed. Save it like that.")
    if not np.isfinite(rows).all() or (rows < 0).any():
        raise CalibrationError(
            f"{path} contains negative or non-finite values; a {name} cannot. Measure it again."
        )
    bands = rows.shape[1]
    if not rows.any(axis=1).all():
        raise CalibrationError(
            f"{path}: the {name} of a colour or an order is zero throughout. Measure it again."
        )
    if name == "efficiency" and rows.max() > MOST_EFFICIENCY:
        raise CalibrationError(
            f"{path} holds up to {rows.max():.3g}; an efficiency is a share of the light, not more than 1."
            " Divide a table in percent by 100, and any other by the light without film."
        )
    if bands not in _GRIDS:
        known = ", ".join(str(count) for count in sorted(_GRIDS))
        raise CalibrationError(
            f"{path} has {bands} bands; published tables have {known}. Resample it to one of their grids."
        )
    nm = _GRIDS[bands].centres_nm
    if name != "efficiency":
        centres_nm(path, [(nm, row) for row in rows], "in the order of columns")
    return [SpectralCurve.of(nm, row) for row in rows]


def _open(path: Path) -> NDArray[np.generic]:
    try:
        table = read_array(path)
    except (OSError, ValueError, EOFError) as error:
        raise CalibrationError(
            f"{path} is not an array that NumPy can read ({error}). Save it again."
        ) from error
    if not isinstance(table, np.ndarray) or table.dtype.kind not in "iuf":
        raise CalibrationError(f"{path} does not contain a single array of numbers. Save it again.")
    return table
