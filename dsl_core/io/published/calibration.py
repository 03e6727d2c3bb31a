"""The published calibration: where its files are, which are missing, and the rig that they make.

Lenses and pose are in the file of `dsl_core.io.published.stereo`, curves in those of
`dsl_core.io.published.curve_tables`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError

from dsl_core.errors import CalibrationError
from dsl_core.io.published.curve_tables import (
    FIRST_ORDER_NAME,
    TABLE_NAMES,
    find_table,
    load_tables,
    save_tables,
)
from dsl_core.io.published.layout import FileRecord
from dsl_core.io.published.stereo import Size, Stereo, load_stereo, save_stereo
from dsl_core.io.published.stereo_rig import as_large_as
from dsl_core.io.staging import check_targets
from dsl_core.model.base import problems_in_words
from dsl_core.model.rig import Provenance, Rgb, Rig
from dsl_core.model.spectral import SpectralCurve

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
    "reference_rel_std": "uncertainty of its white",
}


@dataclass(frozen=True)
class PublishedCalibration:
    """Everything the published files hold; the film's shape and the scale of the curves are not in them.

    What camera and LEDs were measured in is anybody's choice: curves of each are relative to their largest.
    """

    stereo: Stereo
    response: Rgb
    emission: Rgb
    efficiency: dict[int, SpectralCurve]

    def rig(self, base: Rig) -> Rig:
        """A rig with these lenses, pose and curves; film, sensor and scales are those of ``base``.

        What ``base`` measured of its own lenses and curves does not hold for these, and is left out. Raises
        `CalibrationError` where no such rig can be.
        """
        fresh = {field: Rig.model_fields[field].default for field in _MEASURED_OF_BASE}
        lost = [what for field, what in _MEASURED_OF_BASE.items() if getattr(base, field) != fresh[field]]
        without = f"; without its {', '.join(lost)}, which hold for its own lenses and curves" if lost else ""
        made = base.model_copy(
            update={
                **fresh,
                "name": "published",
                "camera": self.stereo.camera,
                "projector": self.stereo.projector,
                "pose": self.stereo.pose,
                "response": as_large_as(base.response, self.response),
                "emission": as_large_as(base.emission, self.emission),
                "efficiency": self.efficiency,
                "correspondence": None,
                "conditions": None,
                "calibrations": (),
                "provenance": Provenance(
                    source="published calibration layout",
                    notes=f"film, sensor and scales, those of the curves too, from {base.name!r}{without}",
                ),
            }
        )
        try:
            return Rig.model_validate(made.model_dump())
        except ValidationError as error:
            raise CalibrationError(
                f"The calibration makes no rig: {problems_in_words(error)}. Correct its files; if its"
                " lengths are in metres, give --unit-mm 1000."
            ) from error

    def in_units_of(self, unit_mm: float) -> PublishedCalibration:
        """The same where the lengths of its file are in units of ``unit_mm``."""
        pose = self.stereo.pose
        there = pose.model_copy(update={"translation_mm": tuple((unit_mm * pose.vector_mm).tolist())})
        return replace(self, stereo=self.stereo.model_copy(update={"pose": there}))


def load_calibration(
    root: Path, projector_size_px: Size = (640, 360), camera_size_px: Size | None = None
) -> PublishedCalibration:
    """Read lenses, pose and spectral tables below ``root``; raises `CalibrationError`."""
    stereo = load_stereo(root / STEREO_NAME, projector_size_px, camera_size_px)
    return PublishedCalibration(stereo, *load_tables(root / TABLE_FOLDER))


def export_calibration(rig: Rig, root: Path, *, overwrite: bool = False) -> list[Path]:
    """Write a rig's lenses, pose and curves in the published layout below ``root``; raises `StoreError`.

    Where one of the files is there and may not be replaced, none is written: old lenses and new tables would
    pass for one rig.
    """
    tables = [root / TABLE_FOLDER / name for name, _ in TABLE_NAMES.values()]
    check_targets([*tables, root / STEREO_NAME], overwrite=overwrite)
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
