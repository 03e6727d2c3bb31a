"""From maps and cubes to the result that a user opens."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.calibration.accepted import missed_attributes
from dsl_core.model.fit import ATTRIBUTE, Fit
from dsl_core.model.options import Options
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import BLACK_ATTRIBUTE, SPECTRUM_INVALID, Flag
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from dsl_core.version import __version__

#: Bands with less than this share of data count as decided by the prior.
DECIDED_FROM = 0.5
#: Reduced chi-square above which no spectrum explains a pixel's frames.
POOR_FIT_FROM = 3.0


def known_pixels(geometry: Geometry) -> Pixels:
    """What the spectral solver needs to know of each pixel."""
    surface = geometry.surface
    depth_mm = geometry.depth_mm if geometry.seen_depth_mm is None else geometry.seen_depth_mm
    valid = ((geometry.flags & int(SPECTRUM_INVALID)) == 0) & np.isfinite(surface.shading)
    return Pixels(
        geometry.column_px,
        depth_mm.astype(np.float32),
        surface.shading.astype(np.float32),
        surface.shading_rel_std.astype(np.float32),
        geometry.amplitude,
        geometry.amplitude_std,
        geometry.offset,
        geometry.offset_std,
        geometry.column_std_px,
        valid,
    )


def maps_of_rows(
    rig: Rig, grid: WavelengthGrid, geometry: Geometry, rows: slice, spectra: SpectralMaps | None
) -> dict[str, NDArray[np.generic]]:
    """The variables of a result for some rows of a picture, with ``spectra`` of these if there are any."""
    from dsl_core.optics.colour import reflectance_to_srgb

    here, flags = geometry.of_rows(rows), geometry.flags[rows].copy()
    arrays: dict[str, NDArray[np.generic]] = {
        "depth_mm": here.depth_mm.astype(np.float32),
        "depth_std_mm": here.depth_std_mm.astype(np.float32),
        "column_px": here.column_px,
        "column_std_px": here.column_std_px,
        "points_mm": here.points_mm(rig, rows),
        "normals": here.surface.normals.astype(np.float32),
        "shading": here.surface.shading.astype(np.float32),
    }
    if spectra is not None:
        flags |= _spectral_flags(spectra)
        arrays.update(
            reflectance=spectra.reflectance,
            reflectance_std=with_highlight(here, with_calibration(rig, grid, spectra)),
            data_share=spectra.data_share,
            reach=spectra.reach,
            rgb=reflectance_to_srgb(spectra.reflectance, grid.centres_nm).astype(np.float32),
        )
    arrays["flags"] = flags
    return arrays


def maps_without_spectra(rig: Rig, options: Options, geometry: Geometry) -> dict[str, NDArray[np.generic]]:
    """The variables of a result, but for spectra, of the part of the picture that the options ask for."""
    rows, columns = options.part
    top, bottom, _ = rows.indices(len(geometry.flags))
    maps = maps_of_rows(rig, options.grid, geometry, slice(top, bottom), None)
    return {name: values[..., columns] for name, values in maps.items()}


def attributes_of(
    rig: Rig, plan: CapturePlan, fit: Fit, black_dn_per_ms: Sequence[float] = ()
) -> dict[str, str | int | float]:
    """What a result says of itself; of the light of black frames only where it is known."""
    attributes: dict[str, str | int | float] = {"rig": rig.name, "plan": plan.name, "version": __version__}
    if black_dn_per_ms:
        attributes[BLACK_ATTRIBUTE] = json.dumps([float(f"{value:.4g}") for value in black_dn_per_ms])
    return attributes | {ATTRIBUTE: fit.model_dump_json()} | missed_attributes(rig.calibrations)


def with_calibration(rig: Rig, grid: WavelengthGrid, spectra: SpectralMaps) -> NDArray[np.float32]:
    """Deviation of the reflectance (bands, rows, columns), calibration included.

    What the calibration leaves open is a share of the reflectance: two for all wavelengths
    (``white_scale_rel_std``, ``reference_rel_std``) and one for each (``chain_rel_std``).
    """
    chain = 0.0 if rig.chain_rel_std is None else rig.chain_rel_std.at(grid.centres_nm)
    level = np.hypot(rig.white_scale_rel_std, rig.reference_rel_std)
    share = np.broadcast_to(np.hypot(chain, level), grid.count).astype(np.float32)
    if not share.any():
        return spectra.std
    return np.asarray(np.hypot(spectra.std, share[:, None, None] * spectra.reflectance), np.float32)


def with_highlight(geometry: Geometry, std: NDArray[np.float32]) -> NDArray[np.float32]:
    """Deviation of the reflectance (bands, rows, columns), with what a highlight adds to all bands."""
    return std if geometry.highlight is None else np.hypot(std, geometry.highlight)


def _spectral_flags(spectra: SpectralMaps) -> NDArray[np.uint16]:
    with np.errstate(invalid="ignore"):
        unreached = (spectra.data_share < DECIDED_FROM).any(0)
    flags = np.zeros(unreached.shape, np.uint16)
    flags[unreached] |= np.uint16(int(Flag.BANDS_UNREACHED))
    flags[spectra.chi_square > POOR_FIT_FROM] |= np.uint16(int(Flag.POOR_FIT))
    flags[spectra.at_bound] |= np.uint16(int(Flag.AT_BOUND))
    return flags
