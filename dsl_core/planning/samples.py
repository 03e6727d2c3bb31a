"""The few pixels that represent a whole picture."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.result import BLACK_ATTRIBUTE, SPECTRUM_INVALID
from dsl_core.model.result_order import wavelengths_of
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.pinhole import rays_at
from dsl_core.optics.sensor import relative_gain
from dsl_core.optics.shading import shading
from dsl_core.solve.thinned import thinned

if TYPE_CHECKING:
    import xarray as xr

Floats = NDArray[np.float64]
#: Samples across and down by default, and those of a quick look.
GRID, LOOK_GRID = (8, 3), (12, 8)
#: Distance of the samples from the rim of the picture, as a share of it.
RIM = 0.04
#: Of pictures of more pixels about so many are asked whether the projector lights them, spread over all.
ASKED = 300_000
#: Spectra of a look hardly change in so many nm beyond its bands.
SHORT_NM = 20.0


@dataclass(frozen=True)
class SamplePixels:
    """Sample pixels: flat indices, depth, shading and incidence, each of shape (samples,).

    Shading holds the camera's gain, as that of results does. ``lit_share`` is the share of the picture that
    the projector lights. ``spectra`` (samples, bands) at ``wavelengths_nm`` are what a quick look saw there,
    None for reference reflectances. ``black_dn_per_ms`` is what its black frames hold on average in R, G and
    B, light of the room included; None where nobody looked.
    """

    pixels: NDArray[np.int64]
    depth_mm: Floats
    shading: Floats
    incidence_tan: Floats
    lit_share: float
    spectra: Floats | None = None
    wavelengths_nm: Floats | None = None
    black_dn_per_ms: tuple[float, ...] | None = None

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
    lit, lit_share = _inside(rig, depth_mm)
    if not lit.any():
        raise PlanError(
            f"The projector of rig {rig.name!r} lights nothing of a plane at {depth_mm:g} mm."
            " Choose a depth inside the rig's range."
        )
    return _of_plane(rig, depth_mm, _spread(lit, grid), lit_share)


def _of_plane(rig: Rig, depth_mm: float, pixels: NDArray[np.int64], lit_share: float) -> SamplePixels:
    depth, facing = np.full(pixels.shape, float(depth_mm)), np.array([[0.0], [0.0], [-1.0]])
    points = _points(rig, pixels, depth)
    gain = np.broadcast_to(relative_gain(rig), (rig.camera.height_px, rig.camera.width_px)).ravel()[pixels]
    light = shading(rig, points, facing) * gain
    return SamplePixels(pixels, depth, light, _incidence(rig, points), lit_share)


def scene_samples(rig: Rig, result: xr.Dataset) -> SamplePixels:
    """Some pixels of a quick look at a scene, with the depth, shading, spectrum and light of the room there.

    A look whose bands end far from those that plans are predicted for says nothing of the rest: references
    stand in for its spectra.

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
    depth = result["depth_mm"].values.ravel()[pixels].astype(np.float64)
    shade = result["shading"].values.ravel()[pixels].astype(np.float64)
    incidence = _incidence(rig, _points(rig, pixels, depth))
    black = _black_of(result.attrs.get(BLACK_ATTRIBUTE))
    found = SamplePixels(pixels, depth, shade, incidence, float(valid.mean()), black_dn_per_ms=black)
    nm, bands = wavelengths_of(result, "The quick look"), WavelengthGrid()
    if max(nm.min() - bands.start_nm, bands.stop_nm - nm.max()) > SHORT_NM:
        return found
    spectra = result["reflectance"].values.reshape(-1, valid.size)[:, pixels].T.astype(np.float64)
    return replace(found, spectra=spectra, wavelengths_nm=nm)


def _black_of(told: object) -> tuple[float, ...] | None:
    """The light of black frames as a result tells it; None where it does not, or in no numbers."""
    try:
        found = np.array(json.loads(str(told)), float)
    except (ValueError, TypeError):
        return None
    return tuple(found.tolist()) if found.shape == (3,) and np.isfinite(found).all() else None


def _inside(rig: Rig, depth_mm: float) -> tuple[NDArray[np.bool_], float]:
    """Asked pixels whose point the projector's frame lights directly, (rows, columns), and their share."""
    lit = np.zeros((rig.camera.height_px, rig.camera.width_px), bool)
    asked = thinned(np.arange(lit.size), ASKED)
    depth = torch.full(asked.shape, float(depth_mm), dtype=torch.float64)
    column, row = zero_order(rig, torch.as_tensor(asked), depth)
    lens = rig.projector
    inside = (column > -0.5) & (column < lens.width_px - 0.5) & (row > -0.5) & (row < lens.height_px - 0.5)
    lit.ravel()[asked] = inside.numpy()
    return lit, float(inside.double().mean())


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


def _points(rig: Rig, pixels: NDArray[np.int64], depth_mm: Floats) -> Floats:
    """Points (3, samples) that pixels see at their depth (samples,), mm."""
    rows, columns = np.divmod(pixels, rig.camera.width_px)
    return rays_at(rig.camera, columns.astype(np.float64), rows.astype(np.float64)) * depth_mm


def _incidence(rig: Rig, points_mm: Floats) -> Floats:
    """Tangent of the angle between the way to the projector and the way to the camera's plane, (samples,)."""
    to_light = rig.pose.projector_centre_mm[:, None] - points_mm
    return np.asarray(np.hypot(to_light[0], to_light[1]) / np.abs(to_light[2]))
