"""A whole scan of the twin, held in memory, and what a spectral solver is given of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import DeviceRig
from dsl_core.model.options import Options
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.result_sink import MemorySink
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.patterns.images import pattern_image
from dsl_core.pipeline import fit_plan
from dsl_core.reconstruction.geometry import Geometry, reconstruct_geometry
from dsl_core.reconstruction.merge import LineStack, MergedScan, decode_columns, stack_lines
from dsl_core.reconstruction.rows.assembly import Assembly
from dsl_core.reconstruction.rows.bands import bands_of
from dsl_core.reconstruction.scan_result import known_pixels
from dsl_core.reconstruction.spectral.solvers import RowSolver
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from dsl_core.simulation.sim_devices import open_twin

if TYPE_CHECKING:
    import xarray as xr


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


def assembled(
    rig: Rig, plan: CapturePlan, grid: WavelengthGrid, geometry: Geometry, maps: SpectralMaps
) -> xr.Dataset:
    """The result of a whole picture's geometry and spectra, as `dsl_core.pipeline.reconstruct` makes it."""
    bands = bands_of(plan, multiple=None)
    result = Assembly(rig, plan, Options(grid), geometry, bands, MemorySink())
    result.put(bands[0], maps)
    return result.finish(RowSolver(lambda *_: maps, maps.followed, maps.error), ())


def solver_input(rig: Rig, scan: MemoryScan) -> tuple[LineStack, Pixels]:
    """Everything up to the spectra, as `dsl_core.pipeline.reconstruct` does it."""
    merged = MergedScan(scan, rig)
    code, white = decode_columns(merged)
    stack = stack_lines(merged)
    return stack, known_pixels(reconstruct_geometry(rig, scan.plan, code, white, stack))
