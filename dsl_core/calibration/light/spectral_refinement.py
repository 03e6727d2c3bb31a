"""Camera response and LED emission refined on surfaces of known reflectance (Eq. 1 of the method).

The method (Shin et al., CVPR 2024, supplement) minimises the squared differences of measured and simulated
intensities plus ``w`` times the squared gradients of response and emission over wavelength, w = 0.005. Here:

- curves are ``start * exp(deviation)``, so that they stay positive, and the gradient is that of the deviation
  from the start: what was measured or stated before is not flattened;
- intensities count by their noise, relative to the white of their channel, so that ``w`` keeps the meaning it
  has for intensities between zero and one; it is the published one unless the evidence of the data is asked;
- a response may also be shifted along the wavelengths, since edges of filters move more than they deform;
- emission that was measured is held by its own deviation instead of by the gradient.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.spectral_nodes import NODES_NM
from dsl_core.model.rig import Rgb, Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.smooth_functions import hat_functions, log_determinant

Floats = NDArray[np.float64]

PUBLISHED_WEIGHT = 0.005
FINE_NM = np.arange(400.0, 701.0)
#: Prior deviation of a response's level, and of the light on the chart against that on the Spectralon.
LEVEL_STD, CHART_LEVEL_STD = 0.3, 0.02
#: Prior deviation of a shift, nm, and the share of its peak below which a curve's slope says nothing of it.
SHIFT_STD_NM, SHIFT_FLOOR = 2.0, 0.02
#: The same for emission that was measured: what it may still deviate by stands in its own deviation.
FIXED_STD_NM = 1e-3
#: Unknowns of a curve: a deviation at each node, and the shift.
UNKNOWNS = len(NODES_NM) + 1
#: Weights and relative errors of a reflectance that the evidence chooses from.
WEIGHTS = tuple(PUBLISHED_WEIGHT * 10.0**k for k in (-5, -4, -3.5, -3, -2.5, -2, -1.5, -1, 0, 1))
REFLECTANCE_ERRORS = (0.0, 0.001, 0.003, 0.01, 0.03)
#: Least relative deviation of a measured emission at a node, and of a datum.
EMISSION_FLOOR, DATUM_FLOOR = 1e-3, 2e-4
ITERATIONS = 8


@dataclass(frozen=True)
class SurfaceSignals:
    """Signals of surfaces at unit shading: DN per ms at full drive, arrays (surfaces, channels, lights).

    ``reflectance`` (surfaces, wavelengths `FINE_NM`); ``lights`` (lights, LEDs) is what each light is made
    of. ``own_level`` marks surfaces of the chart, whose common level may be off a little; the others (the
    Spectralon) define the level and have no error of reflectance.
    """

    signal: Floats
    std: Floats
    reflectance: Floats
    lights: Floats
    own_level: NDArray[np.bool_]

    def only(self, keep: NDArray[np.bool_]) -> SurfaceSignals:
        """The surfaces where ``keep`` is true."""
        return SurfaceSignals(
            self.signal[keep], self.std[keep], self.reflectance[keep], self.lights, self.own_level[keep]
        )


@dataclass(frozen=True)
class Refinement:
    """Deviations (6, `UNKNOWNS`) of R, G, B response and emission, covariance, and how they were found.

    ``chart_level`` is the logarithm of the chart's level against the Spectralon's.
    """

    deviation: Floats
    covariance: Floats
    chart_level: float
    weight: float
    reflectance_error: float
    evidence: float


class SpectralModel:
    """Signals of surfaces as a function of deviations from a rig's curves, with their derivatives."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.response = np.stack([curve.at(FINE_NM) for curve in rig.response])
        self.emission = np.stack([curve.at(FINE_NM) for curve in rig.emission])
        #: What each unknown of each curve does to its logarithm, (6, UNKNOWNS, wavelengths).
        self.basis = np.stack([_basis(curve) for curve in (*self.response, *self.emission)])

    @property
    def size(self) -> int:
        """Number of unknowns: six curves and the level of the chart."""
        return 6 * UNKNOWNS + 1

    def curves(self, deviation: Floats) -> tuple[Floats, Floats]:
        """Responses and emissions (3, wavelengths) with deviations (6, `UNKNOWNS`) put in."""
        factor = np.exp(np.einsum("kn,knw->kw", deviation, self.basis))
        return self.response * factor[:3], self.emission * factor[3:]

    def predict(self, unknowns: Floats, data: SurfaceSignals) -> tuple[Floats, Floats]:
        """Signals (surfaces, channels, lights) and derivatives by the unknowns (..., unknowns)."""
        response, emission = self.curves(unknowns[:-1].reshape(6, -1))
        level = self.rig.white_scale * np.exp(unknowns[-1] * data.own_level)
        density = np.einsum("cw,lw->clw", response, emission)
        reflected = data.reflectance * level[:, None]
        by_light = data.lights @ density  # (3, lights, wavelengths)
        signal = np.moveaxis(by_light @ reflected.T, 2, 0)
        slope = np.zeros((*signal.shape, self.size))
        n = UNKNOWNS
        for c in range(3):
            slope[:, c, :, c * n : (c + 1) * n] = _moments(reflected, by_light[c], self.basis[c])
            of_led = _moments(reflected, density[:, c], self.basis[3 + c])
            slope[..., (3 + c) * n : (4 + c) * n] = of_led[:, :, None] * data.lights[:, c, None]
        slope[..., -1] = signal * data.own_level[:, None, None]
        return signal, slope


def _moments(reflected: Floats, light: Floats, basis: Floats) -> Floats:
    """Sums over wavelengths of surfaces (p, w), lights (m, w) and basis functions (n, w), (p, m, n)."""
    pairs = (light[:, None] * basis).reshape(-1, basis.shape[1])
    return np.asarray((reflected @ pairs.T).reshape(len(reflected), len(light), len(basis)))


def refine(
    rig: Rig,
    data: SurfaceSignals,
    weight: float | None = PUBLISHED_WEIGHT,
    error: float | None = None,
    progress: Progress | None = None,
) -> Refinement:
    """The most likely deviations; ``weight`` or reflectance ``error`` None are chosen by the evidence."""
    weights = WEIGHTS if weight is None else (weight,)
    errors = REFLECTANCE_ERRORS if error is None else (error,)
    pairs = [(w, e) for w in weights for e in errors]
    progress = progress or NoProgress()
    tried = []
    for done, (w, e) in enumerate(pairs):
        progress.report("refine", done, len(pairs))
        tried.append(_solve(rig, data, w, e))
    progress.report("refine", len(pairs), len(pairs))
    return max(tried, key=lambda refinement: refinement.evidence)


def residuals(rig: Rig, data: SurfaceSignals, found: Refinement) -> Floats:
    """Measured minus modelled signals, as a share of the surface's modelled signal under its brightest light.

    Shape (surfaces, channels, lights).
    """
    predicted, _ = SpectralModel(rig).predict(np.append(found.deviation.ravel(), found.chart_level), data)
    return np.asarray((data.signal - predicted) / predicted.max(2, keepdims=True))


def refined_curves(rig: Rig, found: Refinement) -> tuple[Rgb, Rgb, float]:
    """Responses, emissions and white scale with the deviations put in.

    The scale is kept identifiable: the integrals of the three responses sum to what they did before, and so
    do those of the emissions; the white scale takes the rest. Deviations of the curves are those of their
    shapes: the common factor of three curves is the white scale's.
    """
    model = SpectralModel(rig)
    response, emission = model.curves(found.deviation)
    keep_r = float(model.response.sum() / response.sum())
    keep_e = float(model.emission.sum() / emission.sum())
    n = 3 * UNKNOWNS
    std_r = _shape_std(model.basis[:3], found.covariance[:n, :n], response)
    std_e = _shape_std(model.basis[3:], found.covariance[n:, n:], emission)
    return (
        _curves(response * keep_r, std_r * keep_r),
        _curves(emission * keep_e, std_e * keep_e),
        rig.white_scale / (keep_r * keep_e),
    )


def _solve(rig: Rig, data: SurfaceSignals, weight: float, error: float) -> Refinement:
    """Gauss and Newton from the start curves, and the evidence by Laplace's approximation."""
    model = SpectralModel(rig)
    std = _total_std(data, error)
    prior = _prior(rig, weight, _unit(data, std))
    x = np.zeros(model.size)
    for _ in range(ITERATIONS):
        predicted, slope = model.predict(x, data)
        a = (slope / std[..., None]).reshape(-1, model.size)
        miss = ((data.signal - predicted) / std).ravel()
        # numpy's solvers let other threads run meanwhile, scipy's do not.
        curvature = a.T @ a + prior
        step = np.linalg.solve(curvature, a.T @ miss - prior @ x)
        x = x + np.clip(step, -0.5, 0.5)
        if np.abs(step).max() < 1e-6:
            break
    root = np.linalg.cholesky(curvature)
    predicted, _ = model.predict(x, data)
    cost = float((((data.signal - predicted) / std) ** 2).sum() + x @ prior @ x)
    evidence = -0.5 * cost - float(np.log(std).sum()) + 0.5 * log_determinant(prior)
    evidence -= float(np.log(np.diag(root)).sum())
    inverse = np.linalg.inv(root)
    covariance = (inverse.T @ inverse)[:-1, :-1]
    return Refinement(x[:-1].reshape(6, -1), covariance, float(x[-1]), weight, error, evidence)


def _total_std(data: SurfaceSignals, error: float) -> Floats:
    """Noise, a floor for what no model has, and the error of the chart's reflectances."""
    white = data.signal.max(2, keepdims=True)
    relative = DATUM_FLOOR + error * data.own_level[:, None, None]
    return np.asarray(np.sqrt(data.std**2 + (relative * data.signal) ** 2 + (0.1 * relative * white) ** 2))


def _unit(data: SurfaceSignals, std: Floats) -> float:
    """Mean square deviation of a datum relative to the white of its channel: Eq. 1 weighs data by one."""
    white = data.signal.max((0, 2), keepdims=True)
    return float(1 / np.mean((white / std) ** 2))


def _prior(rig: Rig, weight: float, unit: float) -> Floats:
    """Precision (unknowns, unknowns): gradients of Eq. 1, levels, and the emission's own deviation."""
    n = len(NODES_NM)
    gradient = np.diff(np.eye(n), axis=0)
    smooth = weight / unit * gradient.T @ gradient + np.eye(n) / (n * LEVEL_STD**2)
    precision = np.zeros((6 * UNKNOWNS + 1, 6 * UNKNOWNS + 1))
    for k, curve in enumerate((*rig.response, *rig.emission)):
        free = k < 3 or curve.std is None
        nodes = slice(k * UNKNOWNS, k * UNKNOWNS + n)
        precision[nodes, nodes] = smooth if free else np.diag(1 / _relative_std(curve) ** 2)
        shift = (k + 1) * UNKNOWNS - 1
        precision[shift, shift] = 1 / (SHIFT_STD_NM if free else FIXED_STD_NM) ** 2
    precision[-1, -1] = 1 / CHART_LEVEL_STD**2
    return precision


def _relative_std(curve: SpectralCurve) -> Floats:
    value = np.maximum(curve.at(NODES_NM), 1e-12)
    std = np.interp(NODES_NM, curve.wavelengths_nm, np.array(curve.std))
    return np.asarray(np.clip(std / value, EMISSION_FLOOR, 1.0))


def _basis(curve: Floats) -> Floats:
    """Effect of a curve's unknowns on its logarithm, (UNKNOWNS, wavelengths)."""
    slope = np.gradient(curve, FINE_NM) / np.maximum(curve, SHIFT_FLOOR * curve.max())
    return np.concatenate([hat_functions(FINE_NM, NODES_NM).T, -slope[None]])


def _shape_std(basis: Floats, covariance: Floats, curves: Floats) -> Floats:
    """Deviation (3, wavelengths) of three curves whose integrals sum to a constant."""
    n = UNKNOWNS
    share = (curves[:, None, :] * basis).sum(-1).ravel() / curves.sum()
    out = np.empty_like(curves)
    for k in range(3):
        effect = np.zeros((basis.shape[2], 3 * n))
        effect[:, k * n : (k + 1) * n] = basis[k].T
        effect -= share
        out[k] = curves[k] * np.sqrt(np.maximum(np.einsum("wi,ij,wj->w", effect, covariance, effect), 0))
    return out


def _curves(values: Floats, std: Floats) -> Rgb:
    red, green, blue = (SpectralCurve.of(FINE_NM, v, std=s) for v, s in zip(values, std, strict=True))
    return red, green, blue
