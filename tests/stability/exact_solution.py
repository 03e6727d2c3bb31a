"""The spectral solver's answer again, pixel by pixel in 106 bits, by another elimination.

The posterior of `dsl_core.reconstruction.spectral.solving.solver` is the solution of an arrow: the banded
matrix of data and prior, bordered by the broad-band rows, ``[[A, R], [R', -I]]``. Its factorisation
``L D L'`` in double-double arithmetic needs neither Woodbury's identity nor a banded triangular solver.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.spectral.solving.prior import Prior
from tests.stability.double_double import Floats, Wide

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class System:
    """Normal equations as the solver is given them, in doubles, which hold singles exactly.

    ``data`` (bandwidth + 1, bands, pixels), ``right`` (bands, pixels), ``rows`` (bands, n, pixels).
    """

    data: Floats
    right: Floats
    rows: Floats

    @property
    def bands(self) -> int:
        """Number of bands."""
        return int(self.data.shape[1])

    @property
    def pixels(self) -> int:
        """Number of systems."""
        return int(self.data.shape[2])

    def at(self, pixels: slice | NDArray[np.int64]) -> System:
        """The equations of some pixels."""
        return System(self.data[..., pixels], self.right[..., pixels], self.rows[..., pixels])


@dataclass(frozen=True)
class Solved:
    """Solution (bands, right sides, pixels) and the logarithm of the determinant (pixels,)."""

    x: Wide
    log_determinant: Floats
    quadratic: Floats


def exact_tau(system: System, prior: Prior) -> Floats:
    """The place of the largest evidence (pixels,), by the solver's parabola, from exact evidences."""
    # All in one: arrays are small, and each operation costs more than its numbers.
    many = system.at(np.tile(np.arange(system.pixels), len(prior.taus)))
    evidence = exact_evidence(many, np.repeat(prior.taus, system.pixels), prior).reshape(len(prior.taus), -1)
    best = evidence.argmax(0).clip(1, len(evidence) - 2)
    at = np.arange(evidence.shape[1])
    left, middle, right = (evidence[best + i, at] for i in (-1, 0, 1))
    bend = 2 * middle - left - right
    peak = (0.5 * (right - left) / np.maximum(bend, 1e-6)).clip(-1, 1)
    shift = np.where(bend > 0, peak, np.sign(right - left))
    logs = np.log(prior.taus)
    return np.asarray(np.exp(logs[best] + shift * (logs[1] - logs[0])))


def exact_evidence(system: System, tau: Floats, prior: Prior) -> Floats:
    """Twice the logarithm of the evidence of a deviation (pixels,) up to a constant (pixels,)."""
    posterior = _solve(system, tau, prior)
    taus, which = np.unique(tau, return_inverse=True)
    bands, count = system.bands, len(taus)
    none = System(np.zeros((3, bands, count)), np.zeros((bands, count)), np.zeros((bands, 0, count)))
    volume = _solve(none, taus, prior).log_determinant[which]
    return np.asarray(volume - posterior.log_determinant + posterior.quadratic)


def exact_nodes(system: System, tau: Floats, prior: Prior, pinned: Mask, values: Floats) -> Floats:
    """Node values (bands, pixels) under given deviations; ``pinned`` bands have the ``values`` given."""
    return _solve(system, tau, prior, pinned, values).x[:, 0].double()


def exact_band_std(system: System, tau: Floats, prior: Prior, band: int) -> Floats:
    """Standard deviation (pixels,) of the mean over an inner band's triangle, by the posterior alone."""
    weights = np.zeros((system.bands, system.pixels))
    weights[band - 1 : band + 2] = np.array([1, 4, 1])[:, None]
    unit = System(system.data, weights, system.rows)
    flat = Prior(prior.taus, 0.0, prior.level_std, prior.bounds)
    return np.asarray(np.sqrt(_solve(unit, tau, flat).quadratic) / 6)


def _solve(
    system: System, tau: Floats, prior: Prior, pinned: Mask | None = None, values: Floats | None = None
) -> Solved:
    """Factorise and solve the arrow of every pixel."""
    one = Wide.of(np.ones(1))
    tightness = one / (Wide.of(tau) * Wide.of(tau))
    ridge = one / (Wide.of(np.array([prior.level_std])) * Wide.of(np.array([prior.level_std])))
    bandwidth = max(len(system.data) - 1, 2)
    band = Wide.of(np.zeros((bandwidth + 1, system.bands, system.pixels)))
    band.put(slice(0, len(system.data)), Wide.of(system.data))
    for offset, rough in enumerate(_roughness(system.bands)):
        for j in range(system.bands - offset):
            more = tightness * Wide.of(np.array([rough[j]]))
            band.put((offset, j), band[offset, j] + (more + ridge if offset == 0 else more))
    right = Wide.of(system.right) + ridge * Wide.of(np.array([prior.level]))
    border = Wide.of(system.rows.copy())
    count = system.rows.shape[1]
    below = Wide.of(np.zeros((count, system.pixels)))
    if pinned is not None and values is not None:
        band, border, right, below = _hold(band, border, right, below, pinned, Wide.of(values))
    corner = Wide.of(np.broadcast_to(-np.eye(count)[..., None], (count, count, system.pixels)).copy())
    return _eliminate(band, border, corner, right, below)


def _roughness(bands: int) -> list[NDArray[np.float64]]:
    """Diagonals of the squared second differences, small whole numbers."""
    differences = np.diff(np.eye(bands), 2, axis=0)
    return [np.diagonal(differences.T @ differences, offset).copy() for offset in range(3)]


def _hold(
    band: Wide, border: Wide, right: Wide, below: Wide, pinned: Mask, values: Wide
) -> tuple[Wide, Wide, Wide, Wide]:
    """The equations of the free bands, with the pinned ones moved to the right side."""
    bands = pinned.shape[0]
    held = Wide(np.where(pinned, values.high, 0.0), np.where(pinned, values.low, 0.0))
    for j in range(bands):
        for offset in range(band.high.shape[0]):
            if j + offset < bands:
                right.put(j, right[j] - band[offset, j] * held[j + offset])
                if offset:
                    right.put(j + offset, right[j + offset] - band[offset, j] * held[j])
        for r in range(border.high.shape[1]):
            below.put(r, below[r] - border[j, r] * held[j])
    for offset in range(band.high.shape[0]):
        free = ~pinned[: bands - offset] & ~pinned[offset:]
        for part in (band.high, band.low):
            part[offset, : bands - offset] *= free
    band.high[0][pinned] = 1.0
    free = ~pinned[:, None]
    border = Wide(border.high * free, border.low * free)
    right = Wide(np.where(pinned, held.high, right.high), np.where(pinned, held.low, right.low))
    return band, border, right, below


def _eliminate(band: Wide, border: Wide, corner: Wide, right: Wide, below: Wide) -> Solved:
    """``L D L'`` of the arrow with its right side carried along, then back substitution; uses all up."""
    bandwidth, bands = band.high.shape[0] - 1, band.high.shape[1]
    rows = border.high.shape[1]
    log, quadratic = np.zeros(right.high.shape[-1]), np.zeros(right.high.shape[-1])
    for j in range(bands):
        pivot = band[0, j]
        log += pivot.log()
        quadratic += (right[j] * right[j] / pivot).double()
        for a in range(1, min(bandwidth, bands - 1 - j) + 1):
            factor = band[a, j] / pivot
            for b in range(a, min(bandwidth, bands - 1 - j) + 1):
                band.put((b - a, j + a), band[b - a, j + a] - factor * band[b, j])
            border.put(j + a, border[j + a] - factor[None] * border[j])
            right.put(j + a, right[j + a] - factor * right[j])
        for r in range(rows):
            factor = border[j, r] / pivot
            for s in range(rows):
                corner.put((r, s), corner[r, s] - factor * border[j, s])
            below.put(r, below[r] - factor * right[j])
    y, more_log, more = _small(corner, below)
    x = Wide.of(np.zeros((bands, 1, right.high.shape[-1])))
    for j in range(bands - 1, -1, -1):
        rest = right[j]
        for a in range(1, min(bandwidth, bands - 1 - j) + 1):
            rest = rest - band[a, j] * x[j + a, 0]
        for r in range(rows):
            rest = rest - border[j, r] * y[r]
        x.put((j, 0), rest / band[0, j])
    return Solved(x, log + more_log, quadratic + more)


def _small(corner: Wide, below: Wide) -> tuple[Wide, Floats, Floats]:
    """The few unknowns of the corner, a negative definite block that fills; also their log and square."""
    rows, pixels = below.high.shape
    log, quadratic = np.zeros(pixels), np.zeros(pixels)
    for j in range(rows):
        log += (-corner[j, j]).log()
        quadratic += (below[j] * below[j] / corner[j, j]).double()
        for a in range(j + 1, rows):
            factor = corner[a, j] / corner[j, j]
            for b in range(j, rows):
                corner.put((a, b), corner[a, b] - factor * corner[j, b])
            below.put(a, below[a] - factor * below[j])
    y = Wide.of(np.zeros((rows, pixels)))
    for j in range(rows - 1, -1, -1):
        rest = below[j]
        for a in range(j + 1, rows):
            rest = rest - corner[j, a] * y[a]
        y.put(j, rest / corner[j, j])
    return y, log, quadratic
