"""Scans and reconstructions of a folder that were interrupted, and how to resume the latter."""

from __future__ import annotations

import ast
import contextlib
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsl_core.errors import DslError, StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.reading import read_bounded
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.lock import FolderLock
from dsl_core.io.scan.manifest import read_manifest
from dsl_core.io.scan.origin import rig_of_notes
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.pipeline import Options
from dsl_core.progress import Progress
from dsl_core.workflows.scans import reconstruct_to

_ENDING, _KEY, _LOCK, _ARRAYS = ".unfinished", "key.json", "writer.lock", "result.zarr"
_OVERWRITE = "overwrite"
#: After the facts, a key ends with shape, origin, height of a band of rows, and wavelengths.
_LAYOUT = re.compile(r"\((\d+), \d+\) \(\d+, \d+\) ([1-9]\d*) \[")
#: What reading a damaged key raises; the last two are for what is nested too deeply.
_UNREADABLE = (DslError, OSError, ValueError, SyntaxError, TypeError, RecursionError, MemoryError)


@dataclass(frozen=True)
class UnfinishedScan:
    """A scan whose first ``done`` of ``total`` frames are safe.

    ``rig`` is the name of the rig that took them, with its options; None where the scan does not say.
    """

    folder: Path
    done: int
    total: int
    rig: tuple[str, dict[str, str]] | None = None


@dataclass(frozen=True)
class UnfinishedResult:
    """A result of which ``done`` of ``total`` bands of rows are there.

    ``scan``, ``calibration`` and ``options`` are what it was begun with, ``overwrite`` whether that replaces
    what is at its ``target``.
    """

    target: Path
    scan: Path
    done: int
    total: int
    calibration: Rig
    options: Options
    overwrite: bool = False


def unfinished_scans(folder: Path) -> tuple[UnfinishedScan, ...]:
    """Scans of a folder that lack some frames and that nobody writes to; unreadable ones are left out.

    Of one without any frame nothing is safe that a new scan would not have.
    """
    found = []
    for path in sorted(folder.glob(f"*.dsl/{MANIFEST_NAME}")):
        if _is_in_use(path.parent / "lock"):
            continue
        with contextlib.suppress(DslError):
            reader = ScanReader(path.parent)
            total, lacking = reader.plan.shot_count, len(reader.missing())
            if 0 < lacking < total:
                rig = rig_of_notes(reader.manifest.notes)
                found.append(UnfinishedScan(path.parent, total - lacking, total, rig))
    return tuple(found)


def unfinished_results(folder: Path) -> tuple[UnfinishedResult, ...]:
    """Interrupted reconstructions of a folder whose scan is in it; the others are left out.

    One whose arrays are gone is of a result that was moved to its place: there is nothing to continue.
    """
    found = []
    for work in sorted(folder.glob(f".*{_ENDING}")):
        if (work / _ARRAYS).is_dir() and not _is_in_use(work / _LOCK):
            with contextlib.suppress(*_UNREADABLE):
                found.append(_read(work))
    return tuple(found)


def resume_result(found: UnfinishedResult, progress: Progress | None = None) -> Path:
    """Continue an interrupted reconstruction to its end; raises what `reconstruct_to` raises."""
    # Whether the calibration may be used was settled when it was begun.
    given = found.scan, found.calibration, found.options, progress
    return reconstruct_to(found.target, *given, override_calibration=True, overwrite=found.overwrite)


def _read(work: Path) -> UnfinishedResult:
    facts, _, layout = read_bounded(work / _KEY).decode().partition("\n")
    _, manifest, _, rig, options = json.loads(facts)
    size = _LAYOUT.match(layout)
    if size is None:
        raise StoreError(f"{work} does not say how large its result is. Reconstruct the scan again.")
    rows, height = int(size[1]), int(size[2])
    target = work.with_name(work.name.removeprefix(".").removesuffix(_ENDING))
    return UnfinishedResult(
        target,
        _scan_of(target, manifest),
        len(list(work.glob("rows.*.json"))),
        -(-rows // height),
        Rig.model_validate_json(rig),
        _options_of(options),
        (work / _OVERWRITE).exists(),
    )


def _scan_of(target: Path, manifest: str) -> Path:
    for path in target.parent.glob(f"*.dsl/{MANIFEST_NAME}"):
        with contextlib.suppress(DslError):
            if read_manifest(path.parent).model_dump_json() == manifest:
                return path.parent
    raise StoreError(f"The scan of {target} is not next to it. Put it there, or reconstruct it again.")


def _options_of(text: str) -> Options:
    """Options from their ``repr``; raises `ValueError` for any that this version would write otherwise."""
    call = ast.parse(text, mode="eval").body
    if not isinstance(call, ast.Call):
        raise ValueError(f"{text} cannot be read as options")
    values = {str(each.arg): _value_of(each.value) for each in call.keywords}
    options = Options(**values)
    if repr(options) != text:
        raise ValueError(f"{text} are options of another version")
    return options


def _value_of(node: ast.expr) -> Any:
    if isinstance(node, ast.Call):
        return WavelengthGrid.model_validate(
            {str(each.arg): ast.literal_eval(each.value) for each in node.keywords}
        )
    return ast.literal_eval(node)


def _is_in_use(lock: Path) -> bool:
    if not lock.is_file():
        return False
    try:
        FolderLock(lock).release()
    except StoreError:
        return True
    return False
