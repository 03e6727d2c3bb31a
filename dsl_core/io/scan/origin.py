"""With which rig and options a scan was taken, and what its result was made with, kept as notes."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Mapping
from pathlib import Path

from dsl_core.errors import StoreError
from dsl_core.model.rig import Rig
from dsl_core.resources import expanded

_RIG, _OPTIONS, _COMPUTER = "scanned_with", "scanned_with_options", "scanned_on"
_CALIBRATION, _CORRESPONDENCE = "calibration_digest", "correspondence"

#: Options of the twin that change no picture.
_OF_NO_PICTURE = {"device", "realtime"}


def rig_notes(name: str, options: Mapping[str, str]) -> dict[str, str]:
    """Notes of a scan from which its rig can be opened again; paths are made absolute."""
    # A path is relative to where the scan was started, and a resume may start elsewhere.
    is_path = {"scan", "session"} if name == "replay" else set()
    fixed = {key: str(Path(v).absolute()) if key in is_path else v for key, v in options.items()}
    # A rig that is named by the path of its profile, likewise.
    name = str(Path(name).absolute()) if name.endswith(".json") else name
    return {_RIG: name, _OPTIONS: json.dumps(fixed, sort_keys=True), _COMPUTER: _this_computer()}


def is_of_this_computer(notes: Mapping[str, object]) -> bool:
    """Whether the notes were written on this computer, by this user."""
    # Earlier versions noted the whole name.
    return notes.get(_COMPUTER) in (_this_computer(), _this_computer(platform.node()))


def computer_name() -> str:
    """The name of this computer without the domain, which many get from whatever network they are in.

    >>> computer_name() in platform.node() and "." not in computer_name()
    True
    """
    return platform.node().partition(".")[0]


def _this_computer(name: str | None = None) -> str:
    """A digest, so that a scan that is handed on names neither computer nor user."""
    name = computer_name() if name is None else name
    home = expanded(Path("~"))
    return hashlib.sha256(f"{name}\n{home}".encode()).hexdigest()[:16]


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


def refuse_other_rig(
    folder: Path,
    stored: Mapping[str, object],
    given: Mapping[str, object],
    defaults_of: Callable[[str], Mapping[str, str]],
) -> None:
    """Raise `StoreError` where notes of a scan and of a rig name another rig, or options that differ.

    The twin's scene is an option, so its frames would be those of another scene. Options that are not given
    are what ``defaults_of`` says of a rig by its name. Notes that name no rig, such as those of devices that
    a script has put together, tell nothing.
    """
    was, now = rig_of_notes(stored), rig_of_notes(given)
    if was is None or now is None:
        return
    defaults = defaults_of(now[0]) if was[0] == now[0] else {}
    before, after = ({**defaults, **options} for _, options in (was, now))
    kept = (before.keys() | after.keys()) - (_OF_NO_PICTURE if now[0] == "twin" else set())
    pairs = [("its rig", was[0], now[0])] + [
        (f"the option {key}", before.get(key), after.get(key)) for key in sorted(kept)
    ]
    found = [
        f"{what} is {_said(old)} in the scan and {_said(new)} now"
        for what, old, new in pairs
        if not _is_same(old, new)
    ]
    if found:
        raise StoreError(
            f"{folder} belongs to another scan: {'; '.join(found)}."
            " Open the rig as it was for that scan, or choose a new name."
        )


def _said(value: str | None) -> str:
    return "not given" if value is None else value


def _is_same(one: str | None, other: str | None) -> bool:
    """Whether two texts say the same; scripts write 650.0 for what is typed as 650."""
    try:
        return one == other or float(str(one)) == float(str(other))
    except ValueError:
        return False


def model_notes(rig: Rig, correspondence: str) -> dict[str, str]:
    """Attributes of a result that say which calibration and which correspondence model it was made with."""
    return {_CALIBRATION: calibration_digest(rig), _CORRESPONDENCE: correspondence}


def model_of_notes(notes: Mapping[str, object]) -> tuple[str | None, str]:
    """Digest of the calibration, None where an older result does not note it, and the correspondence."""
    digest = notes.get(_CALIBRATION)
    return None if digest is None else str(digest), str(notes.get(_CORRESPONDENCE, "auto"))


def calibration_digest(rig: Rig) -> str:
    """The same for calibrations that give the same result, whatever they are called and noted to be."""
    content = rig.model_dump_json(exclude={"name", "provenance", "calibrations"})
    return hashlib.sha256(content.encode()).hexdigest()[:32]
