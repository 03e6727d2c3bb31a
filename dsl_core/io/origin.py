"""With which rig and options a scan was taken, kept in its notes and in its result."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

_RIG, _OPTIONS = "scanned_with", "scanned_with_options"


def rig_notes(name: str, options: Mapping[str, str]) -> dict[str, str]:
    """Notes of a session from which its rig can be opened again; paths are made absolute."""
    # A path is relative to where the scan was started, and a resume may start elsewhere.
    fixed = {key: str(Path(v).absolute()) if key == "session" else v for key, v in options.items()}
    return {_RIG: name, _OPTIONS: json.dumps(fixed, sort_keys=True)}


def rig_of_notes(notes: Mapping[str, object]) -> tuple[str, dict[str, str]] | None:
    """Name and options of the rig; None when the notes do not (or not legibly) name one.

    >>> rig_of_notes(rig_notes("twin", {"scene": "plane"}))
    ('twin', {'scene': 'plane'})
    """
    if not isinstance(notes.get(_RIG), str):
        return None
    try:
        options = json.loads(str(notes.get(_OPTIONS, "{}")))
    except ValueError:
        return None
    if not isinstance(options, dict):
        return None
    return str(notes[_RIG]), {str(key): str(value) for key, value in options.items()}
