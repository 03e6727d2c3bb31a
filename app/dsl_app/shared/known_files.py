"""Recognises files and folders quickly, and words why one cannot be opened."""

from __future__ import annotations

import re
from collections.abc import Iterator
from enum import Enum
from itertools import chain, count, islice
from pathlib import Path

from dsl_app.shared.paths import barrier, is_dir, is_file, there
from dsl_core.io import CAMPAIGN_NAME, MANIFEST_NAME, PUBLISHED_PLACES, PUBLISHED_STARTS
from dsl_core.io.neighbours import RESULT_SUFFIX
from dsl_core.io.reading import read_json
from dsl_core.words import counted

RESULT_NAME = "zarr.json"
_MARKS = ".marks.json"
_OPENS = (
    "dsl-scan opens scans (folders NAME.dsl), results (folders NAME.zarr), plans and pattern sets (.json),"
    " campaigns, calibrated rigs, and reference spectra (text, ENVI, ASD, SVC, JCAMP-DX, CGATS and others)."
    " Use File, Import for folders of pictures, and for scans and calibrations in the published layout."
)
#: What folders with these endings are, and the file that none of them lacks.
_WHOLE = {".dsl": ("scan", MANIFEST_NAME), ".zarr": ("result", RESULT_NAME)}


class Kind(Enum):
    """Kinds of files and folders that are recognised without reading them completely."""

    SCAN = "scan"
    RESULT = "result"
    CAMPAIGN = "campaign"
    CALIBRATION = "calibration"
    PLAN = "plan"
    PATTERNS = "pattern set"
    REFERENCE = "reference spectrum"
    PUBLISHED = "folder in the published layout"
    PICTURES = "folder of pictures"
    MISSING = "missing"
    UNKNOWN = "unknown"


def kind_of(path: Path) -> Kind:
    """The kind of a file or folder."""
    if not there(path):
        return Kind.MISSING
    for name, kind in (
        (MANIFEST_NAME, Kind.SCAN),
        (RESULT_NAME, Kind.RESULT),
        (CAMPAIGN_NAME, Kind.CAMPAIGN),
    ):
        if is_file(path / name):
            return kind
    if is_dir(path) and _is_published(path):
        return Kind.PUBLISHED
    if is_dir(path) and _has_pictures(path):
        return Kind.PICTURES
    suffix = path.suffix.lower()
    if suffix == ".json" and is_file(path):
        return _kind_of_json(path)
    # The window comes up before numpy, which the formats need.
    from dsl_core.io.spectra.catalogue import suffixes

    return Kind.REFERENCE if suffix in suffixes() and is_file(path) else Kind.UNKNOWN


def _is_published(folder: Path) -> bool:
    """Whether a folder has the published layout, perhaps incomplete."""
    if any(there(folder / place) for place in PUBLISHED_PLACES):
        return True
    try:
        names = [each.name.lower() for each in folder.iterdir() if is_dir(each)]
    except OSError:
        return False
    return any(re.sub("[^a-z0-9]", "", name).startswith(PUBLISHED_STARTS) for name in names)


def _has_pictures(folder: Path) -> bool:
    """Whether a folder has as many pictures as a capture needs, or an archive that may hold them all."""
    from dsl_core.io.pictures.array_file import ARCHIVES
    from dsl_core.io.pictures.candidates import FEWEST

    try:
        if any(each.suffix.lower() in ARCHIVES for each in folder.iterdir()):
            return True
        return len(list(islice(_pictures(folder), FEWEST))) == FEWEST
    except OSError:
        return False


def _pictures(folder: Path) -> Iterator[Path]:
    from dsl_core.io.pictures.picture_file import PICTURES

    return (each for each in folder.iterdir() if each.suffix.lower() in PICTURES)


def has_pictures(folder: Path) -> bool:
    """Whether a folder, or one directly in it, has a capture's pictures; not for the published layout."""
    if kind_of(folder) is not Kind.UNKNOWN:
        return kind_of(folder) is Kind.PICTURES
    try:
        return is_dir(folder) and any(is_dir(each) and _has_pictures(each) for each in folder.iterdir())
    except OSError:
        return False


def _kind_of_json(path: Path) -> Kind:
    try:
        content = read_json(path)
    except (OSError, ValueError):
        return Kind.UNKNOWN
    keys = set(content) if isinstance(content, dict) else set()
    if "camera_size_px" in keys or "spectral" in keys:
        return Kind.PLAN
    if {"levels", "frames"} <= keys:
        return Kind.PATTERNS
    return Kind.CALIBRATION if keys & {"film", "response", "rig"} else Kind.UNKNOWN


def meant_by(path: Path) -> Path:
    """The folder of a scan, result or campaign if the path is one of its files, else the path itself."""
    if path.name in (MANIFEST_NAME, RESULT_NAME, CAMPAIGN_NAME):
        return path.parent
    if path.name.endswith(_MARKS):
        plain = path.with_name(path.name.removesuffix(_MARKS))
        # A result may have been given a name without an ending.
        return plain if is_file(plain / RESULT_NAME) else plain.with_name(f"{plain.name}{RESULT_SUFFIX}")
    return path


def first_free(folder: Path, stem: str, suffix: str = "") -> Path:
    """A path in a folder that does not exist yet: its name is the stem, with a number if that is taken."""
    names = chain((stem,), (f"{stem}-{number}" for number in count(2)))
    return next(path for name in names if not there(path := folder / f"{name}{suffix}"))


def breakable(path: Path | str) -> str:
    """A path whose lines may break at its slashes, by zero-width spaces."""
    return str(path).replace("/", "/" + chr(0x200B))


def refusal(path: Path) -> str:
    """Why nothing opened a path, and what to do."""
    if reason := barrier(path):
        return f"{path} cannot be read ({reason}). Choose another file, or change the rights to its folder."
    match kind_of(path):
        case Kind.MISSING:
            return f"{path} no longer exists. Choose another file, or connect its drive."
        case Kind.REFERENCE:
            return (
                f"{path.name} may contain a reference spectrum, to compare with a result. Open a result"
                " first, then this file again."
            )
        case Kind.PLAN | Kind.PATTERNS:
            return f"{path.name} is a plan or pattern set. Use 'Open plan' on the Scan page to open it."
        case Kind.CALIBRATION:
            return (
                f"{path.name} is a calibration. Import it into the library on the Calibrate page, then choose"
                " it on the Scan page."
            )
        case Kind.PUBLISHED:
            return f"{path.name} has the layout of another program. Use File, Import to import it."
        case Kind.UNKNOWN if _is_empty(path):
            return f"The folder {path.name} is empty. Choose another one, or copy it again from where it was."
        case Kind.UNKNOWN if path.suffix in _WHOLE:
            what, part = _WHOLE[path.suffix]
            return (
                f"{path.name} is not a whole {what}: it has no {part}. Copy it again from where it was, with"
                " everything in it."
            )
        case Kind.UNKNOWN if path.suffix.lower() == ".json":
            return (
                f"{path.name} is neither a plan, a pattern set nor a calibration of dsl-scan. Choose another"
                " file."
            )
        case Kind.UNKNOWN if told := _of_pictures(path):
            return told
        case Kind.UNKNOWN:
            return f"{path.name} is not a known scan, result, reference spectrum or calibration. {_OPENS}"
        case kind:
            return f"{path.name} is a {kind.value}, but no page could open it. The log says why (Ctrl+L)."


def _of_pictures(path: Path) -> str:
    """What to do with something of a capture that is not the whole of it; empty if it is of none."""
    from dsl_core.io.pictures.array_file import ARCHIVES
    from dsl_core.io.pictures.candidates import FEWEST
    from dsl_core.io.pictures.picture_file import PICTURES

    if is_file(path) and path.suffix.lower() in PICTURES | ARCHIVES:
        return (
            f"{path.name} is opened only with all pictures of its capture. Drop their folder, or choose it"
            " with File, Import."
        )
    if not is_dir(path):
        return ""
    if few := len(list(_pictures(path))):
        return (
            f"The folder {path.name} has {counted(few, 'picture')}; a capture has at least {FEWEST}: white,"
            " black and its stripes. Choose the folder that has them all."
        )
    return ""


def _is_empty(path: Path) -> bool:
    try:
        return is_dir(path) and not any(path.iterdir())
    except OSError:
        return False
