"""The folder of a step: under which conditions it was captured, and how it is replaced without loss."""

from __future__ import annotations

import os
import shutil
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field, TypeAdapter, ValidationError

from dsl_core.devices.base import CameraInfo, ProjectorInfo
from dsl_core.devices.conditions import conditions_of
from dsl_core.errors import StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.atomic import make_folder, sync_folder
from dsl_core.io.campaign_folder import NOTE_NAME
from dsl_core.io.reading import read_json
from dsl_core.io.records import read_record
from dsl_core.model.base import Record, problems_in_words
from dsl_core.model.conditions import CaptureConditions, differences
from dsl_core.model.plan import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator

_ASIDE = ".replaced"
_SETTINGS = TypeAdapter(tuple[Setting, ...])
_CAMERA: TypeAdapter[CameraInfo | None] = TypeAdapter(CameraInfo | None)
_PROJECTOR: TypeAdapter[ProjectorInfo | None] = TypeAdapter(ProjectorInfo | None)


class CaptureNote(Record):
    """What a session writes next to the captures of a step; ``refused`` is the reason, empty for none.

    ``steps`` is how many the calibration had when this one was captured; 0 is unknown. ``settings`` are those
    of `Recipe.acts_at_capture` then.
    """

    conditions: CaptureConditions
    started: str
    finished: str = ""
    refused: str = ""
    steps: int = 0
    settings: dict[str, float] = Field(default_factory=dict)


def read_note(folder: Path) -> CaptureNote | None:
    """The note of a step, None where nothing has been started; raises `StoreError` when it is damaged."""
    path = folder / NOTE_NAME
    return read_record(path, CaptureNote) if path.exists() else None


def other_conditions(folder: Path, now: CaptureConditions) -> tuple[str, ...]:
    """Clauses in which the captures of a step, each scan of it included, differ from the conditions now."""
    note = read_note(folder)
    known = [] if note is None else [note.conditions]
    for manifest in sorted(folder.rglob(MANIFEST_NAME)):
        found = _scanned_under(manifest, manifest.stat().st_mtime_ns)
        known += [found] if found is not None else []
    clauses = [clause for each in known for clause in differences(each, now)]
    return tuple(dict.fromkeys(clauses))


def scan_settings(folder: Path) -> tuple[str, ...]:
    """Exposures and drive levels of the scans under a folder, each once, such as ``333.3 ms at 0.8``."""
    seen: dict[str, None] = {}
    for manifest in sorted(folder.rglob(MANIFEST_NAME)):
        with _damage_told(manifest):
            for setting in _SETTINGS.validate_python(read_json(manifest)["plan"]["settings"]):
                seen[f"{setting.exposure_ms:.4g} ms at {setting.level:g}"] = None
    return tuple(seen)


@contextmanager
def replacing(folder: Path) -> Iterator[None]:
    """Move the captures of a step aside, and put them back unless the block makes complete new ones."""
    aside = _aside(folder)
    if folder.exists():
        make_folder(aside.parent)
        _move(folder, aside)
    try:
        yield
    except BaseException:
        _put_back(folder)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def recover(folder: Path) -> None:
    """Finish a replacement that a crash interrupted: complete new captures stay, others give way."""
    if not _aside(folder).exists():
        return
    note = read_note(folder)
    if note is not None and note.finished:
        shutil.rmtree(_aside(folder), ignore_errors=True)
    else:
        _put_back(folder)


def _aside(folder: Path) -> Path:
    return folder.parent / _ASIDE / folder.name


def _put_back(folder: Path) -> None:
    if _aside(folder).exists():
        shutil.rmtree(folder, ignore_errors=True)
        _move(_aside(folder), folder)


def _move(source: Path, target: Path) -> None:
    """Rename a folder so that it has one of both names also after a power cut."""
    os.replace(source, target)
    sync_folder(target.parent)
    sync_folder(source.parent)


@lru_cache(maxsize=1024)
def _scanned_under(manifest: Path, changed_ns: int) -> CaptureConditions | None:
    """Conditions of a stored scan; of its manifest only the devices are looked at, which is fast."""
    with _damage_told(manifest):
        content = read_json(manifest)
        camera = _CAMERA.validate_python(content.get("camera"))
        projector = _PROJECTOR.validate_python(content.get("projector"))
        return None if camera is None or projector is None else conditions_of(camera, projector)


@contextmanager
def _damage_told(manifest: Path) -> Iterator[None]:
    """Raise `StoreError` for a manifest that says something else than a manifest should."""
    try:
        yield
        return
    except ValidationError as error:
        why = problems_in_words(error)
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        why = str(error) or type(error).__name__
    raise StoreError(f"{manifest} is damaged ({why}). Capture the step {manifest.parent.parent.name} again.")
