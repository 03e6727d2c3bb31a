"""What a result does not hold, put in as unknown: results of other programs hold what they like."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.result import VARIABLES
from dsl_core.model.result_order import known_bands
from dsl_core.optics.colour import hold_colour, reflectance_to_srgb

#: What is put in for what a result does not hold: unknown values, no flags, bands that no order is known of.
_UNKNOWN: dict[str, np.generic] = {
    "depth_std_mm": np.float32(np.nan),
    "points_mm": np.float32(np.nan),
    "flags": np.uint16(0),
}
_UNKNOWN_OF_BANDS: dict[str, np.generic] = {
    "reflectance_std": np.float32(np.nan),
    "data_share": np.float32(np.nan),
    "reach": np.uint8(0),
}


def completed(result: ResultArrays) -> ResultArrays:
    """A result with all that a person may look at; ``missing`` names what it does not hold itself.

    What is missing takes no memory, but for the colours, which are those of its spectra.
    """
    height, width = result.shape
    arrays: dict[str, NDArray[Any]] = dict(result.arrays)
    missing = list(result.missing)
    for name, value in (_UNKNOWN | _UNKNOWN_OF_BANDS if result.has_spectra else _UNKNOWN).items():
        if name not in arrays:
            lengths = {"y": height, "x": width, "axis": 3, "wavelength_nm": len(result.wavelengths_nm)}
            arrays[name] = np.broadcast_to(value, tuple(lengths[axis] for axis in VARIABLES[name][0]))
            missing.append(name)
    if result.has_spectra and "rgb" not in arrays:
        known = result.without_missing_bands()
        arrays["rgb"] = reflectance_to_srgb(known["reflectance"], known.wavelengths_nm)
    return replace(result, arrays=arrays, missing=tuple(missing))


def missing_text(result: ResultArrays) -> str:
    """What a result does not hold or knows of no pixel, in sentences; empty where there is all to look at.

    >>> missing_text(ResultArrays(None, np.empty(0), {}, missing=("depth_std_mm", "flags")))
    'This result does not hold: standard deviation of depth; reasons why the pixel is limited.'
    """
    names = [VARIABLES[name][2].split("; ")[0].split(" (")[0] for name in result.missing]
    sentences = [f"This result does not hold: {'; '.join(names)}."] if names else []
    for name, what in (("depth_mm", "depth"), ("reflectance", "spectrum")):
        values = result.known(name)
        if values is not None and not any(np.isfinite(part).any() for part in values):
            sentences.append(f"No pixel of this result has a {what}.")
    if not result.has_spectra:
        return " ".join(sentences)
    bands = result.wavelengths_nm[known_bands(result["reflectance"])]
    if not hold_colour(bands):
        sentences.append(
            f"The bands, {bands.min():g} to {bands.max():g} nm, hold too little of a colour: the colours of"
            " pictures are as if the spectra continued straight around them."
        )
    return " ".join(sentences)
