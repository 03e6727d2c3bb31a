"""Marked places of a result and what their pixels say: masks by name, and mean spectra."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.band_noise import correlation_of
from dsl_core.errors import DecodeError
from dsl_core.evaluation.marks import mask_of_outline, mask_of_runs, region_spectrum
from dsl_core.io.result.annotations_file import Annotations
from dsl_core.model.result_order import wavelengths_of

if TYPE_CHECKING:
    import xarray as xr

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]


def require_spectra(result: xr.Dataset) -> None:
    """Raise `DecodeError` for a result without spectra, `StoreError` where bands have no wavelengths."""
    if "reflectance" not in result:
        raise DecodeError("The result contains depth only. Reconstruct the scan with spectra.")
    wavelengths_of(result)


def correlation_of_bands(result: xr.Dataset) -> Floats:
    """How the bands (bands, bands) of a result with spectra err together, as `correlation_of` tells it."""
    std, flags = (result[name].values if name in result else None for name in ("reflectance_std", "flags"))
    return correlation_of(result["wavelength_nm"].values, result["reflectance"].values, std, flags)


def masks_of_marks(marks: Annotations, shape: tuple[int, int]) -> dict[str, Mask]:
    """Pins and regions of a result as masks by their names."""
    masks: dict[str, Mask] = {}
    for pin in marks.pins:
        mask = np.zeros(shape, bool)
        x, y = pin.pixel
        if 0 <= x < shape[1] and 0 <= y < shape[0]:
            mask[y, x] = True
        masks[pin.name] = masks.get(pin.name, np.zeros(shape, bool)) | mask
    for region in marks.regions:
        own = mask_of_runs(region.runs, shape) if region.runs else mask_of_outline(region.outline_px, shape)
        masks[region.name] = masks.get(region.name, np.zeros(shape, bool)) | own
    return masks


def colours_of_marks(marks: Annotations) -> dict[str, int]:
    """The indices in `mark_colours` of all marks, by name."""
    return {
        **{each.name: each.colour for each in marks.references},
        **{each.name: each.colour for each in marks.regions},
        **{each.name: each.colour for each in marks.pins},
    }


def spectra_of_masks(result: xr.Dataset, masks: Mapping[str, Mask]) -> dict[str, tuple[Floats, Floats]]:
    """Mean reflectance (bands,) of each place and its deviation, by name.

    That of a single pixel is as the result states it, that of more the mean of theirs: what a pixel of the
    place is uncertain by, whatever the place itself varies; NaN where the result states none. Raises
    `DecodeError` where no pixel has a spectrum.
    """
    require_spectra(result)
    reflectance = result["reflectance"].values
    is_known = "reflectance_std" in result
    std = result["reflectance_std"].values if is_known else reflectance
    found = {}
    for name, mask in masks.items():
        region = region_spectrum(reflectance, std, std, mask)
        if region.used == 0:
            raise DecodeError(
                f"{name}: none of its {region.pixels} pixels has a spectrum. Mark another place."
            )
        found[name] = (region.mean, region.pixel_std if is_known else np.full_like(region.mean, np.nan))
    return found
