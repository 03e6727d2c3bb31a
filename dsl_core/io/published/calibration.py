"""The published calibration: where its files are, which are missing, and what they hold.

Lenses and pose are in the file of `dsl_core.io.published.stereo`, the rest in arrays of NumPy:

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

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.io.published.layout import FileRecord
from dsl_core.io.published.stereo import Size, Stereo, load_stereo, save_stereo
from dsl_core.io.reading import read_array
from dsl_core.io.staging import staged
from dsl_core.model.rig import Provenance, Rgb, Rig
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid

STEREO_NAME = Path("calibration", "calibration_propcam.xml")
TABLE_FOLDER = Path("dataset", "image_formation")
#: What a calibrated rig knows only together with its own lenses, pose and curves, and how to call it.
_MEASURED_OF_BASE = {
    "residual": "residual columns",
    "flat_field": "flat field",
    "lateral_colour": "lateral colour",
    "geometry_covariance": "covariance of lenses and pose",
    "column_std_px": "uncertainty of columns",
    "chain_rel_std": "uncertainty of the spectra",
    "white_scale_rel_std": "uncertainty of the white scale",
}


@dataclass(frozen=True)
class PublishedCalibration:
    """Everything the published files hold; the film's shape and the scale of the curves are not in them."""

    stereo: Stereo
    response: Rgb
    emission: Rgb
    efficiency: dict[int, SpectralCurve]

    def rig(self, base: Rig) -> Rig:
        """A rig with these lenses, pose and curves; film, sensor and scales are those of ``base``.

        What ``base`` measured of its own lenses and curves does not hold for these, and is left out.
        """
        fresh = {field: Rig.model_fields[field].default for field in _MEASURED_OF_BASE}
        lost = [what for field, what in _MEASURED_OF_BASE.items() if getattr(base, field) != fresh[field]]
        without = f"; without its {', '.join(lost)}, which hold for its own lenses and curves" if lost else ""
        return base.model_copy(
            update={
                **fresh,
                "name": "published",
                "camera": self.stereo.camera,
                "projector": self.stereo.projector,
                "pose": self.stereo.pose,
                "response": self.response,
                "emission": self.emission,
                "efficiency": self.efficiency,
                "correspondence": None,
                "conditions": None,
                "calibrations": (),
                "provenance": Provenance(
                    source="published calibration layout",
                    notes=f"film, sensor and scales from {base.name!r}{without}",
                ),
            }
        )


def load_calibration(
    root: Path, projector_size_px: Size = (640, 360), camera_size_px: Size | None = None
) -> PublishedCalibration:
    """Read lenses, pose and spectral tables below ``root``; raises `CalibrationError`."""
    stereo = load_stereo(root / STEREO_NAME, projector_size_px, camera_size_px)
    return PublishedCalibration(stereo, *load_tables(root / TABLE_FOLDER))


def export_calibration(rig: Rig, root: Path, *, overwrite: bool = False) -> list[Path]:
    """Write a rig's lenses, pose and curves in the published layout below ``root``; raises `StoreError`."""
    stereo = Stereo(camera=rig.camera, projector=rig.projector, pose=rig.pose)
    return [
        *save_tables(rig, root / TABLE_FOLDER, overwrite=overwrite),
        save_stereo(stereo, root / STEREO_NAME, overwrite=overwrite),
    ]


def holds_calibration(root: Path) -> bool:
    """Whether a folder is laid out as a published calibration, complete or not."""
    return (root / STEREO_NAME.parent).is_dir() or (root / TABLE_FOLDER).is_dir()


def check_calibration(root: Path) -> list[FileRecord]:
    """What of a published calibration is there, missing or misnamed, and what to do."""
    records = [_stereo_record(root)]
    for name, (expected, _) in TABLE_NAMES.items():
        found = find_table(root / TABLE_FOLDER, name)
        records.append(_record(root, TABLE_FOLDER / expected, found, f"the {name} cannot be imported"))
    lines = root / TABLE_FOLDER / FIRST_ORDER_NAME
    if lines.is_file():
        return [*records, _record(root, TABLE_FOLDER / FIRST_ORDER_NAME, lines, "")]
    name, advice = (TABLE_FOLDER / FIRST_ORDER_NAME).as_posix(), "the analytic model's lines are used instead"
    return [*records, FileRecord(name, None, "optional", advice)]


def _stereo_record(root: Path) -> FileRecord:
    folder = root / STEREO_NAME.parent
    others = sorted(folder.glob("*.xml")) + sorted(folder.glob("*.yml"))
    found = root / STEREO_NAME if (root / STEREO_NAME).is_file() else next(iter(others), None)
    return _record(root, STEREO_NAME, found, "lenses and pose cannot be imported")


def _record(root: Path, expected: Path, found: Path | None, loss: str) -> FileRecord:
    if found is None:
        return FileRecord(expected.as_posix(), None, "missing", f"{loss}; put the file there")
    name = found.relative_to(root).as_posix()
    if name == expected.as_posix():
        return FileRecord(name, name, "ok", "")
    return FileRecord(expected.as_posix(), name, "misnamed", f"rename {name} to {expected.name}")


#: Published name, then the name of earlier versions.
TABLE_NAMES = {
    "response": ("CRF.npy", "CRF_cam.npy"),
    "emission": ("PEF.npy", "CRF_proj.npy"),
    "efficiency": ("DG.npy", "intensity_dg.npy"),
}
FIRST_ORDER_NAME = "first_order_correspondence_model.npy"
ORDERS = (-1, 0, 1)

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
            f"{folder / TABLE_NAMES[name][0]} does not exist: the table of the {name} is needed."
        )
    table = np.asarray(_open(path), np.float64)
    rows = table.T if name != "efficiency" and table.ndim == 2 else table
    if rows.ndim != 2 or len(rows) != 3:
        wanted = "(3, bands), orders -1, 0, +1" if name == "efficiency" else "(bands, 3), channels R, G, B"
        raise CalibrationError(f"{path} has shape {table.shape}; {wanted} is needed.")
    if not np.isfinite(rows).all() or (rows < 0).any():
        raise CalibrationError(
            f"{path} contains negative or non-finite values; a {name} cannot. Measure it again."
        )
    bands = rows.shape[1]
    if bands not in _GRIDS:
        known = ", ".join(str(count) for count in sorted(_GRIDS))
        raise CalibrationError(
            f"{path} has {bands} bands; published tables have {known}. Resample it to one of their grids."
        )
    return [SpectralCurve.of(_GRIDS[bands].centres_nm, row) for row in rows]


def _open(path: Path) -> NDArray[np.generic]:
    try:
        table = read_array(path)
    except (OSError, ValueError, EOFError) as error:
        raise CalibrationError(f"{path} is not an array that NumPy can read ({error}).") from error
    if not isinstance(table, np.ndarray) or table.dtype.kind not in "iuf":
        raise CalibrationError(f"{path} does not contain a single array of numbers.")
    return table
