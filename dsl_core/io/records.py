"""Records as JSON files: written whole or not at all, and read with a sentence about what is wrong."""

from __future__ import annotations

from codecs import BOM_UTF8
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from dsl_core.errors import DslError, StoreError
from dsl_core.io.atomic import make_folder, write_atomic
from dsl_core.io.patience import advice_on
from dsl_core.io.reading import read_bounded
from dsl_core.io.sealed import SealError, seal, unseal
from dsl_core.io.staging import write_text
from dsl_core.model.base import Record, problems_in_words

R = TypeVar("R", bound=Record)


def write_record(path: Path, record: Record, *, overwrite: bool = False, sealed: bool = True) -> Path:
    """Write a record as JSON, whole or not at all, and return its path.

    It carries its checksum unless it is not ``sealed``, as a file for people to edit. Raises `StoreError`.
    """
    text = _json(path, record)
    return write_text(path, seal(text).decode() if sealed else f"{text}\n", overwrite=overwrite)


def replace_record(path: Path, record: Record) -> None:
    """Write a record with its checksum in place of an older one, in a folder that is made if need be.

    Raises `StoreError`.
    """
    make_folder(path.parent)
    write_atomic(path, seal(_json(path, record)))


def _json(path: Path, record: Record) -> str:
    try:
        return record.model_dump_json(indent=1)
    except ValueError as error:
        raise StoreError(
            f"{path} cannot be written: it would name a file or folder whose name is not in UTF-8. Rename"
            " that one and repeat the command."
        ) from error


def read_record(
    path: Path,
    kind: type[R],
    remedy: str = "Restore it from a copy, or delete it and calibrate again.",
    *,
    called: str = "",
    fault: str = "is damaged or from another version",
    error: type[DslError] = StoreError,
    most: int = 1,
) -> R:
    """A record from its JSON file, which must match its checksum if it has one.

    Raises ``error`` that says how the file is ``called`` and what its ``fault`` is, names the first ``most``
    fields that are wrong, and ends with a ``remedy``.
    """
    name = f"{called} {path}".strip()
    try:
        return kind.model_validate_json(unseal(read_bounded(path).removeprefix(BOM_UTF8)).decode())
    except UnicodeDecodeError as failure:
        raise error(f"{name} cannot be read (it is not a text file). {remedy}") from failure
    except OSError as failure:
        reason = failure.strerror or failure
        raise error(f"{name} cannot be read ({reason}). {advice_on(failure, remedy)}") from failure
    except ValidationError as failure:
        raise error(f"{name} {fault}: {_problems(failure, most)}. {remedy}") from failure
    except SealError as failure:
        raise error(
            f"{name} was changed or damaged after it was written: {failure}. Restore it from a copy. If you"
            " changed it yourself, delete its last field, checksum."
        ) from failure


def _problems(failure: ValidationError, most: int) -> str:
    """What keeps a file from being a record; another version is named before its many unknown fields."""
    found = failure.errors()
    for item in found:
        if item["loc"] == ("schema_version",):
            supported = item.get("ctx", {}).get("expected", "another")
            return f"it has schema version {item['input']!r}; this program supports version {supported}"
    if found[0]["type"] == "json_invalid":
        return f"the file is not JSON ({found[0]['ctx']['error']}); it may be cut off"
    if not found[0]["loc"] and found[0]["type"] == "model_type":
        return "the file does not contain a JSON object"
    kind = _looks_like({str(item["loc"][0]) for item in found if item["type"] == "extra_forbidden"})
    if kind:
        return f"it contains {kind}"
    more = f"; and {len(found) - most} more" if len(found) > most else ""
    return problems_in_words(failure, most) + more


#: Fields that tell what else a file may be.
_KINDS = {
    "a calibrated rig": {"camera", "film"},
    "a capture plan": {"code", "spectral"},
    "a set of patterns": {"comb_error", "levels"},
    "a rig profile": {"camera", "projector"},
}


def _looks_like(foreign: set[str]) -> str:
    """What a file is whose fields a record does not know; empty where that is not known either."""
    return next((kind for kind, fields in _KINDS.items() if fields <= foreign), "")
