"""The few pixels that represent a whole picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.result import SPECTRUM_INVALID
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.shading import Plane, plane_shading

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
#: Samples across and down by default, and those of a quick look.
GRID, LOOK_GRID = (8, 3), (12, 8)
#: Distance of the samples from the rim of the picture, as a share of it.
RIM = 0.04


@dataclass(frozen=True)
class SamplePixels:
    """Sample pixels: flat indices, depth, shading and incidence, each of shape (samples,).

    ``lit_share`` is the share of the picture that the projector lights. ``spectra`` (samples, bands) at
    ``wavelengths_nm`` are what a quick look saw there, None for reference reflectances.
    """

    pixels: NDArray[np.int64]
    depth_mm: Floats
    shading: Floats
    incidence_tan: Floats
    lit_share: float
    spectra: Floats | None = None
    wavelengths_nm: Floats | None = None

    def part(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> SamplePixels:
        """Some of the samples, by a mask or by their numbers."""
        return replace(
            self,
            pixels=self.pixels[chosen],
            depth_mm=self.depth_mm[chosen],
            shading=self.shading[chosen],
            incidence_tan=self.incidence_tan[chosen],
            spectra=None if self.spectra is None else self.spectra[chosen],
        )


def plane_samples(rig: Rig, depth_mm: float | None = None, grid: tuple[int, int] = GRID) -> SamplePixels:
    """A plane that faces the camera, where the projector lights it; raises `PlanError` if nowhere.

    Without ``depth_mm`` it is at the rig's usual depth.
    """
    depth_mm = rig.usual_depth_mm if depth_mm is None else depth_mm
    depth = _plane(depth_mm).depth_mm(rig)
    lit = _inside(rig, depth)
    if not lit.any():
        raise PlanError(
            f"The projector of rig {rig.name!r} lights nothing of a plane at {depth_mm:g} mm."
            " Choose a depth inside the rig's range."
        )
    return _of_plane(rig, depth_mm, _spread(lit, grid), float(lit.mean()))


def _plane(depth_mm: float) -> Plane:
    return Plane(np.array([0.0, 0.0, 1.0 / depth_mm]))


def _of_plane(rig: Rig, depth_mm: float, pixels: NDArray[np.int64], lit_share: float) -> SamplePixels:
    plane = _plane(depth_mm)
    depth, shares = plane.depth_mm(rig), plane_shading(rig, plane).ravel()[pixels]
    return SamplePixels(pixels, depth.ravel()[pixels], shares, _incidence(rig, depth, pixels), lit_share)


def scene_samples(rig: Rig, result: xr.Dataset) -> SamplePixels:
    """Some pixels of a quick look at a scene, with the depth, shading and spectrum found there.

    Raises `PlanError` when the look has no spectra, another size, or no valid pixel.
    """
    height, width = result["depth_mm"].shape
    if (height, width) != (rig.camera.height_px, rig.camera.width_px):
        raise PlanError(
            f"The quick look is {width} x {height} pixels; rig {rig.name!r} takes pictures of"
            f" {rig.camera.width_px} x {rig.camera.height_px}. Name the rig, with the options, that it was"
            " scanned with, or scan with this rig."
        )
    if "reflectance" not in result:
        raise PlanError("The quick look has no spectra. Reconstruct its scan with spectra.")
    valid = (result["flags"].values & int(SPECTRUM_INVALID)) == 0
    valid &= np.isfinite(result["reflectance"].values).all(0) & np.isfinite(result["shading"].values)
    if not valid.any():
        raise PlanError("The quick look has no pixel with a spectrum. Scan again with more light.")
    pixels = _spread(valid, LOOK_GRID)
    depth = result["depth_mm"].values.astype(np.float64)
    return SamplePixels(
        pixels,
        depth.ravel()[pixels],
        result["shading"].values.ravel()[pixels].astype(np.float64),
        _incidence(rig, depth, pixels),
        float(valid.mean()),
        result["reflectance"].values.reshape(-1, valid.size)[:, pixels].T.astype(np.float64),
        result["wavelength_nm"].values.astype(np.float64),
    )


def _inside(rig: Rig, depth_mm: Floats) -> NDArray[np.bool_]:
    """Pixels whose point the projector's frame lights directly, (rows, columns)."""
    index = torch.arange(depth_mm.size)
    column, row = zero_order(rig, index, torch.as_tensor(depth_mm.ravel()))
    lens = rig.projector
    lit = (column > -0.5) & (column < lens.width_px - 0.5) & (row > -0.5) & (row < lens.height_px - 0.5)
    return np.asarray(lit.numpy()).reshape(depth_mm.shape)


def _spread(usable: NDArray[np.bool_], grid: tuple[int, int]) -> NDArray[np.int64]:
    """Usable pixels nearest to an even grid whose points take turns in the phase of the mosaic."""
    height, width = usable.shape
    across, down = min(grid[0], width), min(grid[1], height)
    x = np.linspace(RIM, 1 - RIM, across) * (width - 1)
    y = np.linspace(RIM, 1 - RIM, down) * (height - 1) if down > 1 else np.array([(height - 1) / 2])
    phases = {(a, b): np.argwhere(usable[a::2, b::2]) * 2 + (a, b) for a in (0, 1) for b in (0, 1)}
    chosen = []
    for j, top in enumerate(y):
        for i, left in enumerate(x):
            near = phases[(i // 2 + j) % 2, i % 2]
            near = near if len(near) else np.argwhere(usable)
            best = near[np.argmin(((near - (top, left)) ** 2).sum(1))]
            chosen.append(best[0] * width + best[1])
    return np.unique(np.asarray(chosen, np.int64))


def _incidence(rig: Rig, depth_mm: Floats, pixels: NDArray[np.int64]) -> Floats:
    """Tangent of the angle between the way to the projector and the way to the camera's plane, (samples,)."""
    points = (pixel_rays(rig.camera) * depth_mm).reshape(3, -1)[:, pixels]
    to_light = rig.pose.projector_centre_mm[:, None] - points
    return np.asarray(np.hypot(to_light[0], to_light[1]) / np.abs(to_light[2]))
