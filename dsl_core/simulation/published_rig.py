"""The published prototype as a calibrated rig: the default of the twin.

Figures of geometry, efficiency, gamma and halo are those the authors published (Shin et al., Dispersed
Structured Light for Hyperspectral 3D Imaging, CVPR 2024, supplement and public data). Camera response
and LED emission are this project's own fits by skewed Gaussians to the published curves (rms 0.006 of
the peak for the camera, 0.01 for the LEDs).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dsl_core.model.geometry import Lens, Pose
from dsl_core.model.rig import Film, ProjectorResponse, Provenance, Rgb, Rig, Sensor
from dsl_core.model.spectral import SpectralCurve

#: (peak, centre nm, width below nm, width above nm) of each term.
Terms = tuple[tuple[float, float, float, float], ...]
RESPONSE: tuple[Terms, Terms, Terms] = (
    (
        (0.042, 543.5, 36.6, 6.0),
        (0.546, 601.2, 12.7, 24.9),
        (0.486, 658.8, 30.7, 26.2),
        (0.056, 380.0, 73.9, 43.6),
    ),
    (
        (0.602, 508.1, 20.3, 58.5),
        (0.076, 669.4, 22.9, 22.2),
        (0.246, 584.3, 36.7, 27.7),
        (0.063, 380.0, 22.6, 73.6),
    ),
    ((0.545, 463.5, 52.0, 36.2), (0.041, 501.4, 13.1, 62.5), (0.036, 677.8, 31.7, 4.0)),
)
EMISSION: tuple[Terms, Terms, Terms] = (
    ((0.051, 651.4, 32.2, 11.9), (0.710, 638.8, 14.0, 6.2)),
    ((0.356, 509.7, 11.0, 41.1), (0.210, 577.7, 43.1, 12.8)),
    ((0.936, 453.2, 12.3, 11.9), (0.008, 411.2, 4.0, 90.0)),
)
#: Published points of first-order efficiency relative to the zero order: (nm, value).
EFFICIENCY = {
    1: ((400, 0.25), (440, 0.213), (500, 0.151), (550, 0.117), (660, 0.080), (700, 0.072)),
    -1: ((400, 0.19), (430, 0.162), (490, 0.126), (550, 0.083), (660, 0.061), (700, 0.056)),
}
#: Second order relative to the first (seed Fig. 5).
SECOND_ORDER = 0.04
#: First-order blue peak on white at the brighter setting, as a share of full scale (published graph).
BLUE_PEAK = 0.74
WAVELENGTHS_NM = np.arange(390.0, 711.0, 2.0)


def _curve(terms: Terms) -> SpectralCurve:
    nm = WAVELENGTHS_NM
    values = sum(
        a * np.exp(-0.5 * ((nm - mu) / np.where(nm < mu, low, high)) ** 2) for a, mu, low, high in terms
    )
    return SpectralCurve.of(nm, values)


def _rgb(three: tuple[Terms, Terms, Terms]) -> Rgb:
    return _curve(three[0]), _curve(three[1]), _curve(three[2])


def _efficiencies() -> dict[int, SpectralCurve]:
    """Monotone interpolation of the published points; second orders as a share of the first."""
    from scipy.interpolate import PchipInterpolator

    curves = {}
    for order, points in EFFICIENCY.items():
        nm, values = np.array(points).T
        first = PchipInterpolator(nm, values)(WAVELENGTHS_NM.clip(400, 700))
        curves[order] = SpectralCurve.of(WAVELENGTHS_NM, first)
        curves[2 * order] = SpectralCurve.of(WAVELENGTHS_NM, SECOND_ORDER * first)
    return curves


def _rotation() -> tuple[tuple[float, float, float], ...]:
    """The published rotation, made exactly orthonormal."""
    published = np.array(
        [[0.99702, 0.03338, 0.06958], [-0.01862, 0.97903, -0.20287], [-0.07490, 0.20097, 0.97673]]
    )
    u, _, v = np.linalg.svd(published)
    return tuple(tuple(row) for row in (u @ v).tolist())


@lru_cache(maxsize=1)
def published_rig() -> Rig:
    """The prototype's calibration, with the white scale set by the published blue peak."""
    rig = Rig(
        name="twin",
        camera=Lens(
            width_px=890,
            height_px=580,
            fx_px=1761.23,
            fy_px=1764.04,
            cx_px=428.86,
            cy_px=294.84,
            distortion=(-0.23400, 0.10229, -0.00193, -0.00087, 1.05616),
        ),
        projector=Lens(
            width_px=640,
            height_px=360,
            fx_px=982.96,
            fy_px=982.53,
            cx_px=337.78,
            cy_px=394.87,
            distortion=(-0.02184, 0.36888, -0.00058, 0.00293, -1.50212),
        ),
        pose=Pose(rotation=_rotation(), translation_mm=(-54.98, -20.13, 21.86)),  # type: ignore[arg-type]
        film=Film(distance_mm=29.0, lines_per_mm=480.0, tilt_x_deg=0.4, tilt_y_deg=-0.3, bend_per_mm=0.002),
        response=_rgb(RESPONSE),
        emission=_rgb(EMISSION),
        efficiency=_efficiencies(),
        sensor=Sensor(
            bayer="RGGB", bit_depth=12, black_level_dn=260.0, electrons_per_dn=10.0, read_noise_dn=1.0
        ),
        projector_response=ProjectorResponse(
            gamma=2.21, black_fraction=0.0, blur_px=0.6, halo_peak_per_px=0.0, halo_decay_px=31.0
        ),
        white_scale=1.0,
        provenance=Provenance(source="published prototype (Shin et al., CVPR 2024), parametric fit"),
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
