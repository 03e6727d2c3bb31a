"""The published prototype as a calibrated rig: the default of the twin.

Its figures are in ``resources/rigs/published.json``. Those of geometry, efficiency, gamma and halo are as the
authors published them (Shin et al., Dispersed Structured Light for Hyperspectral 3D Imaging, CVPR 2024,
supplement and public data). Camera response and LED emission are this project's own fits by skewed Gaussians
to the published curves (rms 0.006 of the peak for the camera, 0.01 for the LEDs).
"""

from __future__ import annotations

import json
from functools import lru_cache
from typing import Any

import numpy as np

from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.resources import resource_path

#: Second order relative to the first (supplement, Fig. 5).
SECOND_ORDER = 0.04
#: First-order blue peak on white at the brighter setting, as a share of full scale (published graph).
BLUE_PEAK = 0.74
WAVELENGTHS_NM = np.arange(390.0, 711.0, 2.0)


def _rgb(terms: list[list[list[float]]]) -> Rgb:
    """Curves that are sums of terms: peak, centre (nm), width below and width above it (nm)."""
    nm = WAVELENGTHS_NM
    curves = [
        sum(a * np.exp(-0.5 * ((nm - mu) / np.where(nm < mu, low, high)) ** 2) for a, mu, low, high in each)
        for each in terms
    ]
    red, green, blue = (SpectralCurve.of(nm, values) for values in curves)
    return red, green, blue


def _efficiencies(published: dict[str, list[list[float]]]) -> dict[int, SpectralCurve]:
    """Monotone interpolation of published points (nm, value); second orders as a share of the first."""
    from scipy.interpolate import PchipInterpolator

    curves = {}
    for order, points in published.items():
        nm, values = np.array(points).T
        first = PchipInterpolator(nm, values)(WAVELENGTHS_NM.clip(400, 700))
        curves[int(order)] = SpectralCurve.of(WAVELENGTHS_NM, first)
        curves[2 * int(order)] = SpectralCurve.of(WAVELENGTHS_NM, SECOND_ORDER * first)
    return curves


@lru_cache(maxsize=1)
def published_rig() -> Rig:
    """The prototype's calibration, with the white scale set by the published blue peak."""
    figures: dict[str, Any] = json.loads(resource_path("rigs/published.json").read_text(encoding="utf-8"))
    u, _, v = np.linalg.svd(figures["pose"]["rotation"])
    figures["pose"]["rotation"] = (u @ v).tolist()  # exactly orthonormal
    curves = {
        "response": _rgb(figures["response"]),
        "emission": _rgb(figures["emission"]),
        "efficiency": _efficiencies(figures["efficiency"]),
    }
    source = "published prototype (Shin et al., CVPR 2024), parametric fit"
    rig = Rig.model_validate(
        {"name": "twin", "white_scale": 1.0, "provenance": {"source": source}, **figures, **curves}
    )
    return _with_radiometry(rig)


def _with_radiometry(rig: Rig) -> Rig:
    """Set the white scale and the halo by the published intensity graph of a white pixel.

    Blue channel, 333 ms at level 0.8: the first-order peak of a 5 px line reads 0.74 of full scale, the
    halo 0.10 of that scale where its exponential meets the line.
    """
    from dsl_core.optics.spectra import chain_response

    nm = np.arange(400.0, 701.0)
    blue_first = chain_response(rig, 1, nm)[2].sum(0)
    blue_zero = chain_response(rig, 0, nm)[2].sum()
    line_nm = 10
    peak = max(np.convolve(blue_first, np.ones(line_nm), "valid"))
    exposure = 1000.0 / 3.0 * rig.projector_response.radiance(0.8)
    scale = BLUE_PEAK * rig.sensor.full_scale_dn / (peak * exposure)
    halo = (0.104 / BLUE_PEAK) * peak / blue_zero / 5.0
    projector = rig.projector_response.model_copy(
        update={"halo_peak_per_px": float(halo), "black_fraction": 0.0005}
    )
    return rig.model_copy(update={"white_scale": float(scale), "projector_response": projector})
