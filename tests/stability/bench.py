"""A small window of the published rig's image, scanned by formula: any depth, any spectrum, real noise.

No renderer and no scene: pixels have a depth and a spectrum each, their light follows from the model equation
with bands a quarter as wide as the solver's. What follows - frames, black, bracket, decoding, geometry,
spectra - is the engine's own, up to the finished result, in single or double precision.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel, correspondence, zero_order
from dsl_core.optics.image_formation import ImageFormation, OrderPath
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.sensor import bayer_channels, digitise
from dsl_core.optics.spectra import hat_moments
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.patterns.images import pattern_image
from dsl_core.reconstruction.geometry import reconstruct_geometry
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack, MergedScan, decode_columns, stack_lines
from dsl_core.reconstruction.scan_result import known_pixels
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from tests.cases.crop import cropped_rig
from tests.cases.twin_scan import MemoryScan, assembled

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
#: Reflectance of pixels (wavelengths, pixels) at wavelengths (nm).
Spectrum = Callable[[Floats], Floats]

#: Bands of the forward model.
FINE_NM, STEP_NM = np.arange(392.5, 701.0, 2.5), 2.5
GRID = WavelengthGrid()
SIZE = (20, 12)
WINDOW_PX = 5
#: Where both first orders reach whole, at 700 mm.
MIDDLE = (380, 260)


def lines_plan(step_px: int = 4) -> CapturePlan:
    """Scan lines under a code of columns."""
    return CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=step_px))


def comb_plan(period_px: int) -> CapturePlan:
    """A comb under a code of columns: few frames."""
    return CapturePlan(
        code=GrayCode(rows=False), spectral=LineComb(width_px=5, step_px=2, period_px=period_px)
    )


def grey(value: float) -> Spectrum:
    """The same reflectance at all wavelengths and pixels."""
    return lambda nm: np.full((len(nm), 1), value)


HALF_GREY = grey(0.5)


@dataclass(frozen=True)
class Patch:
    """What is in the window: a rig whose camera reads it alone, depths (rows, columns) and spectra.

    ``lit`` is the share of the projector's light that reaches each pixel; ``shading`` replaces that of the
    depths.
    """

    rig: Rig = field(default_factory=lambda: cropped_rig(MIDDLE, SIZE))
    depth_mm: Floats = field(default_factory=lambda: np.full(SIZE[::-1], 700.0))
    spectrum: Spectrum = HALF_GREY
    lit: float | Floats = 1.0
    shading: Floats | None = None
    plan: CapturePlan = field(default_factory=lines_plan)
    seed: int = 0
    noise: bool = True

    @property
    def truth(self) -> Floats:
        """Reflectance at the reported bands, (bands, rows, columns)."""
        values = self.spectrum(GRID.centres_nm)
        return np.broadcast_to(values, (GRID.count, self.depth_mm.size)).reshape(-1, *self.depth_mm.shape)


def scanned(patch: Patch) -> MemoryScan:
    """All frames of a patch's plan, with black level, noise, rounding and saturation."""
    camera = patch.rig.camera
    plan = patch.plan.model_copy(update={"camera_size_px": (camera.width_px, camera.height_px)})
    shots = list(plan.shots())
    rates = _rates(patch, plan)
    rng = np.random.default_rng(patch.seed) if patch.noise else None
    frames = [
        digitise(patch.rig.sensor, (rate * shot.exposure_ms).astype(np.float32), rng)
        for rate, shot in zip(rates, shots, strict=True)
    ]
    return MemoryScan(plan, tuple(frames))


@functools.cache
def _drives(plan: CapturePlan) -> tuple[Floats, NDArray[np.intp]]:
    """What the projector shows, (pictures, width, LEDs), and the picture of every shot.

    Most cases have the same plan, and settings show the same pictures.
    """
    shown = np.stack([pattern_image(plan, shot)[0] for shot in plan.shots()])
    pictures, which = np.unique(shown, axis=0, return_inverse=True)
    return pictures / 255, which.ravel()


def _rates(patch: Patch, plan: CapturePlan) -> Floats:
    """Expected DN per ms of every shot, (shots, rows, columns)."""
    rig, shape = patch.rig, patch.depth_mm.shape
    pixels = torch.arange(patch.depth_mm.size)
    depth = torch.as_tensor(patch.depth_mm.ravel())
    drives, which = _drives(plan)
    response = rig.projector_response
    light = response.radiance(drives)
    column = zero_order(rig, pixels, depth)[0]
    everywhere = torch.ones_like(column[None], dtype=torch.bool)
    moments = {order: hat_moments(rig, order, FINE_NM, STEP_NM)[0] for order in (0, 1, -1)}
    paths = [OrderPath(column[None], everywhere, moments[0], 0.0)]
    for order in (1, -1):
        footprint = GratingModel(rig).trace(pixels, depth, order, FINE_NM)
        slope = float((footprint.columns[-1] - footprint.columns[0]).abs().mean() / np.ptp(FINE_NM))
        inside = footprint.inside(rig.projector.width_px, rig.projector.height_px)
        paths.append(OrderPath(footprint.columns, inside, moments[order], slope * STEP_NM))
    falls = true_shading(patch) if patch.shading is None else patch.shading
    shading = torch.as_tensor((falls * patch.lit).ravel())
    reflectance = np.broadcast_to(patch.spectrum(FINE_NM), (len(FINE_NM), depth.numel())).copy()
    colours = ImageFormation(response, light, paths, shading).forward(torch.as_tensor(reflectance)).numpy()
    own = bayer_channels(rig.sensor.bayer, *shape).ravel()
    mosaic = colours[own, :, np.arange(own.size)].T.reshape(-1, *shape)
    return np.asarray(mosaic[which])


def true_shading(patch: Patch) -> Floats:
    """Cosine over squared distance of the depth map itself, its normals by differences."""
    points = pixel_rays(patch.rig.camera) * patch.depth_mm
    down, across = (np.gradient(points, axis=axis) for axis in (1, 2))
    normal = np.cross(across, down, axis=0)
    normal *= -np.sign(normal[2]) / np.linalg.norm(normal, axis=0)
    to_light = patch.rig.pose.projector_centre_mm[:, None, None] - points
    distance = np.linalg.norm(to_light, axis=0)
    cosine = (normal * to_light).sum(0) / distance
    return np.asarray(np.maximum(cosine, 0) * (patch.rig.reference_distance_mm / distance) ** 2)


@dataclass(frozen=True)
class Staged:
    """A scan between its stages, to be tampered with: decoded code, white, and the stack of line frames."""

    rig: Rig
    plan: CapturePlan
    code: DecodedCode
    white: MergedFrame
    stack: LineStack

    def finish(self, dtype: torch.dtype, device: str = "cpu", threads: int = 2) -> xr.Dataset:
        """The rest of `dsl_core.pipeline.reconstruct`, the spectra in a chosen precision."""
        geometry = reconstruct_geometry(
            self.rig, self.plan, self.code, self.white, self.stack, surface_window_px=WINDOW_PX, device=device
        )
        maps = SpectralReconstruction(
            self.rig,
            self.plan,
            GRID,
            correspondence(self.rig),
            self.stack.radiance,
            self.stack.std,
            known_pixels(geometry),
            device=device,
            dtype=dtype,
        ).run(threads=threads)
        return assembled(self.rig, self.plan, GRID, geometry, maps)


def staged(patch: Patch) -> Staged:
    """A scanned patch, merged and decoded."""
    scan = scanned(patch)
    merged = MergedScan(scan, patch.rig)
    code, white = decode_columns(merged)
    return Staged(patch.rig, scan.plan, code, white, stack_lines(merged))
