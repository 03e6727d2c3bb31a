"""Rig profiles on disk: by path, or by name from the folder of this computer's rigs."""

from __future__ import annotations

from pathlib import Path

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.doctor import DATA_SHEETS, Finding, Grade, examine
from dsl_core.devices.profile import RigProfile, open_parts
from dsl_core.errors import DeviceError, DslError
from dsl_core.io.records import read_record, write_record
from dsl_core.io.rig_file import load_rig
from dsl_core.model.rig import Rig
from dsl_core.resources import own_folder

SUFFIX = ".json"


def profiles_folder() -> Path:
    """Where profiles are found by name, next to the calibration library; it need not exist."""
    return own_folder() / "rigs"


def profile_path(name: str) -> Path | None:
    """The file of a profile, absolute: a path ending in ``.json``, or a name in the folder; None without."""
    if name.endswith(SUFFIX):
        return Path(name).absolute()
    path = profiles_folder() / f"{name}{SUFFIX}"
    return path if Path(name).name == name and path.is_file() else None


def profile_names() -> list[str]:
    """Names of the profiles in the folder."""
    return sorted(path.stem for path in profiles_folder().glob(f"*{SUFFIX}"))


def load_profile(path: Path) -> RigProfile:
    """Read a profile; raises `DeviceError` that names the fields that are wrong."""
    return read_record(
        path,
        RigProfile,
        "Correct the file; the help page on connecting devices has an example.",
        called="The rig profile",
        fault="is not valid",
        error=DeviceError,
        most=5,
    )


def save_profile(profile: RigProfile, path: Path, *, overwrite: bool = False) -> Path:
    """Write a profile, whole or not at all, and return its path; raises `StoreError`."""
    return write_record(path, profile, overwrite=overwrite)


def examine_profile(path: Path) -> list[Finding]:
    """Try the devices of a profile, and read its file ``nominal``; raises `DeviceError` for the profile."""
    profile = load_profile(path)
    nominal, trouble = read_nominal(profile, path.parent)
    return [*examine(profile, nominal), *trouble]


def read_nominal(profile: RigProfile, folder: Path) -> tuple[Rig | None, list[Finding]]:
    """What the file ``nominal`` of a profile in a folder says, None without one, and its faults."""
    if profile.nominal:
        try:
            return load_rig(folder / profile.nominal), []
        except DslError as error:
            return None, [Finding(DATA_SHEETS, Grade.BAD, str(error))]
    return None, []


def open_profile(path: Path) -> DeviceRig:
    """Open the devices of a profile; raises `DeviceError` for those, `CalibrationError` for ``nominal``."""
    profile = load_profile(path)
    nominal = load_rig(path.parent / profile.nominal) if profile.nominal else None
    return open_parts(profile, nominal)
