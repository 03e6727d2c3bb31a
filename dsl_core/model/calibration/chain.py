"""What a diffuser of known reflectance says about the product of response, emission and efficiency."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from dsl_core.model.base import Record
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve


class ChainCorrection(Record):
    """Smooth factors that make the model reproduce a diffuser's line scan, each with its deviation.

    ``efficiency_factors`` (by order) and ``response_factors`` (R, G, B) multiply the rig's curves;
    ``white_scale_factor`` multiplies its white scale. ``chain_rel_std`` is the relative deviation that a
    reflectance keeps from the corrected chain, the scatter over the image included.
    ``largest_correction`` is the largest relative change of their product where there is light;
    ``wavelength_scale`` is by which share light is of a longer wavelength than the film's fit says, by the
    steep flanks of the emission (None in older records; nothing is corrected by it). ``pixels`` is how many
    were used and ``chi_square`` their reduced chi-square.
    """

    efficiency_factors: dict[int, SpectralCurve]
    response_factors: Rgb
    white_scale_factor: float = Field(gt=0)
    white_scale_rel_std: float = Field(ge=0)
    chain_rel_std: SpectralCurve
    largest_correction: float
    wavelength_scale: float | None = None
    wavelength_scale_std: float = 0.0
    pixels: int
    chi_square: float


def apply_chain(record: ChainCorrection, rig: Rig) -> Rig:
    """The rig with its curves multiplied by the factors; curves keep their wavelengths."""
    efficiency = {
        order: _times(curve, record.efficiency_factors[order])
        if order in record.efficiency_factors
        else curve
        for order, curve in rig.efficiency.items()
    }
    red, green, blue = (
        _times(curve, factor) for curve, factor in zip(rig.response, record.response_factors, strict=True)
    )
    return rig.model_copy(
        update={
            "efficiency": efficiency,
            "response": (red, green, blue),
            "white_scale": rig.white_scale * record.white_scale_factor,
            "white_scale_rel_std": record.white_scale_rel_std,
            "chain_rel_std": record.chain_rel_std,
        }
    )


def _times(curve: SpectralCurve, factor: SpectralCurve) -> SpectralCurve:
    """Product on the wavelengths of both; the curve's deviation is replaced by the factor's."""
    nm = np.union1d(curve.wavelengths_nm, factor.wavelengths_nm)
    value = curve.at(nm)
    std = None
    if factor.std is not None:
        std = np.abs(value) * np.interp(nm, factor.wavelengths_nm, factor.std)
    return SpectralCurve.of(nm, value * factor.at(nm), curve.unit, std)
