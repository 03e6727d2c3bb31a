"""From maps and cubes to the result that a user opens."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.calibration.accepted import missed_attributes
from dsl_core.model.fit import ATTRIBUTE, FitFinding
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import SPECTRUM_INVALID, Flag, build_result
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.fit_findings import fit_of
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.spectral.spectra import SpectralMaps
from dsl_core.reconstruction.spectral.tile_frames import Pixels
from dsl_core.version import __version__

if TYPE_CHECKING:
    import xarray as xr

#: Bands with less than this share of data count as decided by the prior.
DECIDED_FROM = 0.5
#: Reduced chi-square above which no spectrum explains a pixel's frames.
POOR_FIT_FROM = 3.0


def known_pixels(geometry: Geometry) -> Pixels:
    """What the spectral solver needs to know of each pixel."""
    surface = geometry.surface
    valid = ((geometry.flags & int(SPECTRUM_INVALID)) == 0) & np.isfinite(surface.shading)
    return Pixels(
        geometry.column_px,
        geometry.depth_mm.astype(np.float32),
        surface.shading.astype(np.float32),
        surface.shading_rel_std.astype(np.float32),
        geometry.amplitude,
        geometry.amplitude_std,
        geometry.offset,
        geometry.offset_std,
        valid,
    )


def assemble(
    rig: Rig,
    plan: CapturePlan,
    grid: WavelengthGrid,
    geometry: Geometry,
    spectra: SpectralMaps | None,
    findings: Iterable[FitFinding] = (),
    part: tuple[slice, slice] = (slice(None), slice(None)),
) -> xr.Dataset:
    """The dataset of a scan; without spectra when only depth was requested.

    ``findings`` are those that were made on the way. Of the picture, a ``part`` (rows, columns) is kept.
    """
    from dsl_core.optics.colour import reflectance_to_srgb

    flags = geometry.flags.copy()
    arrays: dict[str, NDArray[np.generic]] = {
        "depth_mm": geometry.depth_mm.astype(np.float32),
        "depth_std_mm": geometry.depth_std_mm.astype(np.float32),
        "column_px": geometry.column_px,
        "column_std_px": geometry.column_std_px,
        "points_mm": geometry.points_mm(rig),
        "normals": geometry.surface.normals.astype(np.float32),
        "shading": geometry.surface.shading.astype(np.float32),
    }
    if spectra is not None:
        flags |= _spectral_flags(spectra)
        arrays.update(
            reflectance=spectra.reflectance,
            reflectance_std=with_calibration(rig, grid, spectra),
            data_share=spectra.data_share,
            reach=spectra.reach,
            rgb=reflectance_to_srgb(spectra.reflectance, grid.centres_nm).astype(np.float32),
        )
    arrays["flags"] = flags
    attributes: dict[str, str | int | float] = {"rig": rig.name, "plan": plan.name, "version": __version__}
    fit = fit_of(rig, plan, grid, geometry.depth_mm, flags[part], spectra, findings)
    attributes[ATTRIBUTE] = fit.model_dump_json()
    attributes |= missed_attributes(rig.calibrations)
    return build_result(arrays, grid.centres_nm, attributes).isel(y=part[0], x=part[1])


def with_calibration(rig: Rig, grid: WavelengthGrid, spectra: SpectralMaps) -> NDArray[np.float32]:
    """Deviation of the reflectance (bands, rows, columns), calibration included.

    What the calibration leaves open is a share of the reflectance: one for all wavelengths
    (``white_scale_rel_std``) and one for each (``chain_rel_std``).
    """
    chain = 0.0 if rig.chain_rel_std is None else rig.chain_rel_std.at(grid.centres_nm)
    share = np.broadcast_to(np.hypot(chain, rig.white_scale_rel_std), grid.count).astype(np.float32)
    if not share.any():
        return spectra.std
    return np.asarray(np.hypot(spectra.std, share[:, None, None] * spectra.reflectance), np.float32)


def _spectral_flags(spectra: SpectralMaps) -> NDArray[np.uint16]:
    with np.errstate(invalid="ignore"):
        unreached = (spectra.data_share < DECIDED_FROM).any(0)
    flags = np.zeros(unreached.shape, np.uint16)
    flags[unreached] |= np.uint16(int(Flag.BANDS_UNREACHED))
    flags[spectra.chi_square > POOR_FIT_FROM] |= np.uint16(int(Flag.POOR_FIT))
    flags[spectra.at_bound] |= np.uint16(int(Flag.AT_BOUND))
    return flags
