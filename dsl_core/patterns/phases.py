"""Shifted sinusoids of several periods: a phase from each, and one position from all of them.

The phase of equal steps over a period is that of their first harmonic (Creath: "Phase-measurement
interferometry techniques", 1988), with the deviation ``sqrt(2 / steps) * noise / amplitude``. Periods are
counted by trying all of the finest: the position is the one that all phases, and stripes if there are any,
fit best. This holds for coarse-to-fine sets as well as for sets told apart by their beat.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.captured_code import Phases
from dsl_core.patterns.reading import AxisReading, Floats, Measured

TURN = 2 * np.pi
#: Error of a phase that no noise explains: uneven steps, a display that is not linear.
MODEL_STD_RAD = 0.08
#: How sure the edge of a stripe is, px.
EDGE_PX = 0.3
#: The second best count of periods must fit worse by this much chi-square.
CLEARLY_WORSE = 9.0
#: The best one fits when each phase is within so many deviations.
FITS = 25.0
#: An amplitude of fewer deviations is no sinusoid.
LEAST_SIGMAS = 3.0


def phase_levels(spec: Phases, count: int, index: int) -> NDArray[np.float64]:
    """Frame ``index`` of a set over ``count`` columns or rows, 0..1, shape (count,)."""
    which, step = divmod(index, spec.steps)
    phase = TURN * np.arange(count) / spec.periods_px[which] + np.deg2rad(spec.start_deg)
    return np.asarray(0.5 + 0.5 * np.cos(phase + spec.direction * TURN * step / spec.steps))


def read_phases(
    spec: Phases, count: int, frames: Iterator[Measured], coarse: AxisReading | None = None
) -> AxisReading:
    """Positions on an axis of ``count`` px from all steps of all periods, taken one by one.

    ``coarse`` is what stripes say. Raises `DecodeError` when one period, shorter than the axis, is all there
    is.
    """
    if coarse is None and len(spec.periods_px) == 1 and spec.periods_px[0] < count - 1:
        raise DecodeError(
            f"Sinusoids of {spec.periods_px[0]:g} px alone do not say which of the {count} px they are at."
            " Add a second period, or stripes, to the mapping."
        )
    found = [_phase(spec, frames) for _ in spec.periods_px]
    order = np.argsort(spec.periods_px)
    finest = int(order[0])
    period = spec.periods_px[finest]
    phase, phase_std, amplitude, sigmas = found[finest]
    fraction = phase / TURN
    best = np.full(phase.shape, np.inf, np.float32)
    second, position = best.copy(), np.zeros(phase.shape, np.float32)
    for turns in range(-1, int(np.ceil(count / period)) + 1):
        here = (period * (fraction + turns)).astype(np.float32)
        misfit = np.zeros(phase.shape, np.float32)
        for k in order[1:]:
            off = _wrapped(TURN * here / spec.periods_px[k] - found[k][0])
            # An error of the finest phase moves the others too.
            std = np.hypot(found[k][1], phase_std * period / spec.periods_px[k])
            misfit += (off / std) ** 2
        if coarse is not None:
            # Anywhere in its stripe a pixel fits the stripe.
            outside = np.abs(here - coarse.position_px) - np.float32(np.sqrt(3)) * coarse.std_px
            misfit += (np.maximum(outside, 0) / np.hypot(EDGE_PX, period * phase_std / TURN)) ** 2
        misfit[(here < -0.5) | (here > count - 0.5)] = np.inf
        better = misfit < best
        second = np.where(better, best, np.minimum(second, misfit))
        position = np.where(better, here, position)
        best = np.where(better, misfit, best)
    with np.errstate(invalid="ignore"):
        undecided = ~(second - best >= CLEARLY_WORSE) | ~(best <= FITS * len(spec.periods_px))
    undecided |= ~(sigmas >= LEAST_SIGMAS)
    if coarse is not None:
        undecided |= coarse.undecided
    std_px = (period * phase_std / TURN).astype(np.float32)
    return AxisReading(position.clip(0, count - 1), std_px, amplitude, sigmas, undecided)


def _phase(spec: Phases, frames: Iterator[Measured]) -> tuple[Floats, Floats, Floats, Floats]:
    """Phase of one period and its deviation (rad), amplitude, and that in deviations."""
    real: Floats | None = None
    for step in range(spec.steps):
        value, variance = next(frames)
        turn = TURN * step / spec.steps
        if real is None:
            real, imaginary = np.zeros_like(value), np.zeros_like(value)
            noise = np.zeros_like(value)
        real += value * np.float32(np.cos(turn))
        imaginary -= value * np.float32(spec.direction * np.sin(turn))
        noise += variance / spec.steps
    assert real is not None
    amplitude = np.hypot(real, imaginary) * np.float32(2 / spec.steps)
    std = np.sqrt(noise * np.float32(2 / spec.steps))
    with np.errstate(divide="ignore", invalid="ignore"):
        sigmas = np.nan_to_num(amplitude / std, nan=0.0, posinf=1e6)
        phase_std = np.hypot(1 / np.maximum(sigmas, 1e-3), MODEL_STD_RAD).astype(np.float32)
    phase = np.arctan2(imaginary, real) - np.float32(np.deg2rad(spec.start_deg))
    return np.mod(phase, np.float32(TURN)), phase_std, amplitude, sigmas.astype(np.float32)


def _wrapped(angle: Floats) -> Floats:
    """The same angle within half a turn of zero."""
    return np.asarray(angle - TURN * np.round(angle / TURN), np.float32)
