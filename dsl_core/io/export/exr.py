"""Spectral OpenEXR: reflectance as channels ``T.430,000000nm``, a preview, and depth.

Layout: A. Fichet, R. Pacanowski, A. Wilkie, An OpenEXR Layout for Spectral Images, JCGT 10(3), 2021. The
decimal comma is theirs, since a dot separates layers; ``T`` is a reflective or transmissive quantity. All
channels are float32, so NaN stays NaN. The preview is linear, as OpenEXR expects, and ``Z`` is in mm.
Attributes ``dsl_...`` say where the data come from.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.atomic import disk_full, is_full
from dsl_core.io.export.common import colours, plane, provenance, require, require_suffix, wavelengths_nm
from dsl_core.io.staging import staged
from dsl_core.optics.colour import srgb_decode
from dsl_core.solve.many import Check, never
from dsl_core.words import readable

if TYPE_CHECKING:
    import xarray as xr

#: Begins the names of attributes that say where the data come from.
_PREFIX = "dsl_"


def channel_name(wavelength_nm: float) -> str:
    """Name of a band's channel.

    >>> channel_name(432.5)
    'T.432,500000nm'
    """
    return f"T.{wavelength_nm:.6f}nm".replace(".", ",").replace(",", ".", 1)


def export_exr(
    result: xr.Dataset, path: Path, *, overwrite: bool = False, check: Check = never
) -> list[Path]:
    """Write all bands, linear R, G, B and depth into one file; raises `StoreError`."""
    require_suffix(path, ".exr")
    if (shown := readable(str(path))) != str(path):
        raise StoreError(
            f"{shown} cannot be written as OpenEXR, which takes no such letters in this locale. Choose a path"
            " of plain letters, or a locale in UTF-8."
        )
    require(result, "A spectral OpenEXR file", "reflectance", "wavelength_nm")
    import OpenEXR

    cube = plane(result, "reflectance")
    channels: dict[str, NDArray[np.float32]] = {
        channel_name(w): np.ascontiguousarray(band)
        for w, band in zip(wavelengths_nm(result), cube, strict=True)
    }
    rgb = colours(result)
    if rgb is not None:
        check()
        linear = srgb_decode(rgb)
        channels |= {name: np.ascontiguousarray(c) for name, c in zip("RGB", linear, strict=True)}
    if "depth_mm" in result:
        check()
        channels["Z"] = np.ascontiguousarray(plane(result, "depth_mm"))
    header: dict[str, Any] = {
        # OpenEXR has names of its own, ``version`` and ``type`` among them, with meanings and types.
        **{f"{_PREFIX}{key}": value for key, value in provenance(result).items()},
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "spectralLayoutVersion": "1.0",
        "EV": 0.0,
        "depthUnit": "mm",
    }
    with staged([path], overwrite=overwrite) as (draft,):
        check()
        try:
            OpenEXR.File(header, channels).write(str(draft))
        except (RuntimeError, ValueError, TypeError) as error:
            if is_full(draft):
                raise disk_full(path) from error
            raise StoreError(f"{path} could not be written as OpenEXR ({error}).") from error
    return [path]
