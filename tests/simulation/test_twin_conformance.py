"""The twin keeps every promise of a rig."""

from __future__ import annotations

from dsl_core.devices.base import Camera, DeviceRig, Projector, Spectroradiometer, Stage
from dsl_core.devices.conformance import (
    CameraConformance,
    ProjectorConformance,
    RigConformance,
    SpectroradiometerConformance,
    StageConformance,
)
from dsl_core.devices.registry import open_rig


class TestTwin(
    CameraConformance, ProjectorConformance, StageConformance, SpectroradiometerConformance, RigConformance
):
    def open_rig(self) -> DeviceRig:
        return open_rig("twin", {"size": "32x24", "scene": "plane"})

    def open_camera(self) -> Camera:
        rig = self.open_rig()
        return rig.camera

    def open_projector(self) -> Projector:
        return self.open_rig().projector

    def open_stage(self) -> Stage:
        stage = self.open_rig().stage
        assert stage is not None
        return stage

    def open_spectroradiometer(self) -> Spectroradiometer:
        instrument = self.open_rig().spectroradiometer
        assert instrument is not None
        return instrument
