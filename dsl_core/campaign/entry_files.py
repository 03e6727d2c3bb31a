"""Calibrations of the library as files: written for another computer or program, and taken in again."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, get_args

from dsl_core.errors import StoreError
from dsl_core.io.calibration_library import CalibrationLibrary, LibraryEntry, read_entry
from dsl_core.io.rig_file import load_rig, save_rig
from dsl_core.io.staging import staged

Form = Literal["entry", "rig", "published"]


def export_entry(entry: LibraryEntry, target: Path, form: str, overwrite: bool = False) -> list[Path]:
    """Write an entry whole (``entry``), its rig alone, or the published files; returns what was written.

    Raises `StoreError` for another form, and when a target exists or cannot be written.
    """
    match form:
        case "entry":
            with staged([target], overwrite=overwrite) as (draft,):
                draft.write_text(entry.model_dump_json(indent=1) + "\n", encoding="utf-8")
            return [target]
        case "rig":
            return [save_rig(entry.rig, target, overwrite=overwrite)]
        case "published":
            from dsl_core.io.published import export_calibration

            return export_calibration(entry.rig, target, overwrite=overwrite)
    raise StoreError(f"--form must be {', '.join(get_args(Form))}, not {form!r}.")


def import_entry(source: Path, library: CalibrationLibrary, name: str = "") -> LibraryEntry:
    """Take an exported entry, or a rig's file, into a library as the current version of its name.

    Raises `StoreError` or `CalibrationError` when the file holds neither.
    """
    found = read_entry(source)
    if found is None:
        rig = load_rig(source)
        return library.store(name or rig.name, rig)
    return library.store(name or found.name, found.rig, found.accepted, found.history)
