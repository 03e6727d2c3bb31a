"""The rig ``replay``: a scan on disk, played back by name."""

from __future__ import annotations

from pydantic import BaseModel, Field

from dsl_core.devices.base import DeviceRig
from dsl_core.devices.registry import with_options
from dsl_core.devices.replay import replay_rig
from dsl_core.errors import DeviceError
from dsl_core.io.scan.as_exposed import as_exposed
from dsl_core.io.scan.folder import ScanReader


class ReplayOptions(BaseModel):
    """What ``replay`` can be asked for."""

    scan: str = Field(description="folder of the scan to play back")


@with_options(ReplayOptions)
def open_replay(options: dict[str, str]) -> DeviceRig:
    """Plays a saved scan back; option ``scan`` is its folder.

    Raises `DeviceError` for other options, `StoreError` when the folder is not a scan.
    """
    # Notes of scans that were replayed before call it by its earlier name.
    if set(options) not in ({"scan"}, {"session"}):
        given = ", ".join(sorted(options)) or "none"
        raise DeviceError(f"The rig 'replay' takes one option, scan=NAME.dsl; given: {given}.")
    (folder,) = options.values()
    reader = ScanReader(folder)
    known = reader.calibration, reader.manifest.camera, reader.manifest.projector
    return replay_rig(reader, *known, exposed=as_exposed(reader))
