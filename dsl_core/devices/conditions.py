"""The settings in force on a rig's devices, and a calibration for them only where they agree."""

from __future__ import annotations

from dataclasses import replace

from dsl_core.devices.base import CameraInfo, DeviceRig, ProjectorInfo
from dsl_core.errors import CalibrationError
from dsl_core.model.conditions import CameraConditions, CaptureConditions, ProjectorConditions, differences
from dsl_core.model.rig import Rig


def conditions_of(camera: CameraInfo, projector: ProjectorInfo) -> CaptureConditions:
    """What the devices say of themselves, as the conditions of a capture."""
    return CaptureConditions(
        camera=CameraConditions(
            model=camera.model,
            serial=camera.serial,
            size_px=(camera.width_px, camera.height_px),
            region_px=camera.region_px,
            binning=camera.binning,
            gain_db=camera.gain_db,
            bayer=camera.bayer,
            bit_depth=camera.bit_depth,
            mirrored=camera.mirrored,
        ),
        projector=ProjectorConditions(
            model=projector.model,
            serial=projector.serial,
            size_px=(projector.width_px, projector.height_px),
            mode=projector.mode,
            frame_period_ms=projector.frame_period_ms,
        ),
    )


def current_conditions(devices: DeviceRig) -> CaptureConditions:
    """The conditions in force on a rig now."""
    return conditions_of(devices.camera.info, devices.projector.info)


def check_conditions(rig: Rig, devices: DeviceRig) -> tuple[str, ...]:
    """Clauses naming every setting in which devices differ from those that were calibrated.

    Empty when they agree, and for calibrations that do not say how they were captured.
    """
    if rig.conditions is None:
        return ()
    return differences(rig.conditions, current_conditions(devices))


def with_calibration(
    devices: DeviceRig, rig: Rig, override: bool = False
) -> tuple[DeviceRig, tuple[str, ...]]:
    """The same devices with a calibration to scan with, and the differences that were overridden.

    ``devices`` stays as it is. Raises `CalibrationError` naming every difference, unless ``override``: then
    the calibration is used as one that does not say how it was captured.
    """
    found = check_conditions(rig, devices)
    if found and not override:
        raise CalibrationError(
            f"The calibration {rig.name!r} is not for these devices: {'; '.join(found)}."
            " Set them back, calibrate again, or use it anyway with --override-calibration."
        )
    return replace(devices, calibration=rig.model_copy(update={"conditions": None}) if found else rig), found
