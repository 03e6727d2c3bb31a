"""A rig put together from drivers: which one for each device, at which address, with which settings."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Literal, cast

from pydantic import Field, JsonValue

from dsl_core.devices.base import Camera, Device, DeviceRig, Projector, Spectroradiometer, Stage
from dsl_core.devices.driver_table import KINDS, Kind, open_device
from dsl_core.model.base import Record
from dsl_core.model.rig import Rig


class DevicePart(Record):
    """A device of a rig: its driver's name, and what that driver's settings record takes."""

    driver: str
    settings: dict[str, JsonValue] = Field(default_factory=dict)


class RigProfile(Record):
    """One rig. ``nominal`` is the file with the figures of its data sheets, relative to the profile's own."""

    schema_version: Literal[1] = 1
    name: str = Field(min_length=1)
    camera: DevicePart
    projector: DevicePart
    stage: DevicePart | None = None
    spectroradiometer: DevicePart | None = None
    nominal: str = ""
    note: str = ""

    def parts(self) -> dict[Kind, DevicePart]:
        """The devices that the rig has, by kind, in the order in which they are opened."""
        found = {kind: cast("DevicePart | None", getattr(self, kind)) for kind in KINDS}
        return {kind: part for kind, part in found.items() if part is not None}


def open_parts(profile: RigProfile, nominal: Rig | None = None) -> DeviceRig:
    """Open every device of a profile; where one fails, those already open are closed.

    Raises `DeviceError`.
    """
    with ExitStack() as opened:
        devices: dict[Kind, Device] = {}
        for kind, part in profile.parts().items():
            devices[kind] = opened.enter_context(open_device(kind, part.driver, part.settings))
        opened.pop_all()
    return DeviceRig(
        name=profile.name,
        camera=cast(Camera, devices["camera"]),
        projector=cast(Projector, devices["projector"]),
        stage=cast("Stage | None", devices.get("stage")),
        spectroradiometer=cast("Spectroradiometer | None", devices.get("spectroradiometer")),
        nominal=nominal,
    )
