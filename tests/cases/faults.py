"""Devices that fail as real ones do: lost, late and repeated frames, unplugged cables, slow links.

What goes wrong at a shot depends only on the seed, the shot and the attempt, never on the order of
calls, so that an interrupted and resumed scan meets the same faults as an unbroken one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame


@dataclass(frozen=True)
class FaultPlan:
    """How often what goes wrong.

    ``lost``, ``repeated`` and ``late`` are shares of all exposures: no frame; the frame before with its
    number; the picture before under a new number. ``camera_gone_at`` and ``projector_gone_at`` name the
    shot, respectively the pattern shown, from which on the device does not answer. ``slow_s`` is added to
    every frame.
    """

    seed: int = 0
    lost: float = 0.0
    repeated: float = 0.0
    late: float = 0.0
    camera_gone_at: int | None = None
    projector_gone_at: int | None = None
    slow_s: float = 0.0


def with_faults(rig: DeviceRig, plan: FaultPlan) -> DeviceRig:
    """The same rig behind a camera and a projector that fail as planned."""
    wait = rig.sleep or (lambda seconds: None)
    return replace(
        rig, camera=FaultyCamera(rig.camera, plan, wait), projector=FaultyProjector(rig.projector, plan)
    )


class FaultyCamera(Camera):
    """Forwards to a camera, except when the plan says otherwise."""

    def __init__(self, camera: Camera, plan: FaultPlan, wait: Callable[[float], None]) -> None:
        self._camera = camera
        self._plan = plan
        self._wait = wait
        self._shot = self._attempt = 0
        self._before: Frame | None = None

    @property
    def info(self) -> CameraInfo:
        """Info of the camera behind."""
        return self._camera.info

    def configure(self, exposure_ms: float) -> float:
        """Configure the camera behind."""
        return self._camera.configure(exposure_ms)

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        """Announce the shot, which also decides what goes wrong."""
        self._shot, self._attempt = shot_index, attempt
        self._camera.prepare(shot_index, attempt)

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """A frame, an old frame, or `DeviceError`."""
        plan = self._plan
        if plan.camera_gone_at is not None and self._shot >= plan.camera_gone_at:
            raise DeviceError(f"The camera {self.info.model} does not answer. Check its cable and power.")
        self._wait(plan.slow_s)
        chance = np.random.default_rng((plan.seed, self._shot, self._attempt)).random()
        frame = self._camera.snap(timeout_ms)
        if chance < plan.lost:
            raise DeviceError(f"No frame arrived within {timeout_ms:g} ms. Check the camera's cable.")
        before = self._before
        if before is not None and chance < plan.lost + plan.repeated:
            return before
        if before is not None and chance < plan.lost + plan.repeated + plan.late:
            return replace(frame, pixels=before.pixels.copy())
        self._before = frame
        return frame

    def close(self) -> None:
        """Close the camera behind."""
        self._camera.close()


class FaultyProjector(Projector):
    """Forwards to a projector until it is unplugged."""

    def __init__(self, projector: Projector, plan: FaultPlan) -> None:
        self._projector = projector
        self._plan = plan
        self._shown = 0

    @property
    def info(self) -> ProjectorInfo:
        """Info of the projector behind."""
        return self._projector.info

    def show(self, image: NDArray[np.uint8]) -> None:
        """Show an image, or raise `DeviceError` from the planned one on."""
        gone_at = self._plan.projector_gone_at
        if gone_at is not None and self._shown >= gone_at:
            raise DeviceError(f"The projector {self.info.model} does not answer. Check its cable and power.")
        self._projector.show(image)
        self._shown += 1

    def close(self) -> None:
        """Close the projector behind."""
        self._projector.close()
