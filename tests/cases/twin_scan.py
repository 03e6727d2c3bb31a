"""A whole scan of the twin, held in memory, and what a spectral solver is given of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import DeviceRig
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Rig
from dsl_core.patterns.images import pattern_image
from dsl_core.pipeline import fit_plan
from dsl_core.reconstruction.geometry import reconstruct_geometry
from dsl_core.reconstruction.merge import LineStack, MergedScan, decode_columns, stack_lines
from dsl_core.reconstruction.scan_result import known_pixels
from dsl_core.reconstruction.spectral.tile_frames import Pixels
from dsl_core.simulation.sim_devices import open_twin


@dataclass(frozen=True)
class MemoryScan:
    """Frames of a plan by shot number; a `FrameSource`."""

    plan: CapturePlan
    frames: tuple[NDArray[np.uint16], ...]

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot."""
        return self.frames[shot.index]


def capture(devices: DeviceRig, plan: CapturePlan) -> MemoryScan:
    """Take all shots of a plan, fitted to the rig's image sizes."""
    plan = fit_plan(plan, devices)
    frames = []
    for shot in plan.shots():
        devices.projector.show(pattern_image(plan, shot))
        devices.camera.configure(shot.exposure_ms)
        devices.camera.prepare(shot.index)
        frames.append(devices.camera.snap().pixels)
    return MemoryScan(plan, tuple(frames))


def twin_scan(plan: CapturePlan | None = None, **options: str) -> tuple[DeviceRig, MemoryScan]:
    """Open a twin and scan its scene."""
    devices = open_twin(options)
    return devices, capture(devices, plan or CapturePlan())


def solver_input(rig: Rig, scan: MemoryScan) -> tuple[LineStack, Pixels]:
    """Everything up to the spectra, as `dsl_core.pipeline.reconstruct` does it."""
    merged = MergedScan(scan, rig)
    code, white = decode_columns(merged)
    stack = stack_lines(merged)
    return stack, known_pixels(reconstruct_geometry(rig, scan.plan, code, white, stack))
