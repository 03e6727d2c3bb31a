"""Blur and halo of the projector from the zero order of scan lines on a flat target.

A pixel at column q sees ``y_k = a g(q - x_k) + o`` of the line at x_k: box, blur and halo
(`optics.light_path.zero_order_profile`). Amplitude a, column q and dark signal o are each pixel's own;
blur width, halo peak and halo decay are common. All are fitted together by Gauss-Newton steps in which each
pixel's unknowns are eliminated first. Lines closer than their width show each edge at several places, so that
blur and column do not mix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError
from dsl_core.model.plan import ScanLines
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.progress import NoProgress, Progress

Floats = NDArray[np.float64]

#: Relative error of the modelled profile within `NEAR_PX` of a line, added to each variance.
MODEL_ERROR, NEAR_PX = 0.002, 8.0
#: Steps in all, and those at the start that move columns only, until each is near its own.
ITERATIONS, SETTLING = 14, 4
MIN_PIXELS = 100
#: The decay of a halo too faint to show it: start and deviation of its logarithm.
DECAY_PX, DECAY_LOG_STD = 30.0, 0.7
#: Steps of numerical derivatives by blur, peak and the decay's logarithm.
STEPS = (1e-3, 1e-5, 1e-3)
#: A pixel whose chi-square is so many times the others' sees something else; so does one that moved so far.
MAX_CHI_SQUARE, MAX_SHIFT_PX = 5.0, 2.0

#: What the blur of a projector in focus (px) and the peak of its halo (share of a line's light a px) can be.
BLUR_PX, MAX_HALO_PER_PX = (0.05, 5.0), 0.1


@dataclass(frozen=True)
class ZeroOrderFit:
    """Columns (px) and amplitudes (DN per ms) of pixels (P,), which of them are good, and what all share.

    ``std`` holds the deviations of blur (px), halo peak (1/px) and halo decay (px).
    """

    column_px: Floats
    amplitude: Floats
    good: NDArray[np.bool_]
    response: ProjectorResponse
    std: tuple[float, float, float]
    chi_square: float


@dataclass(frozen=True)
class _Data:
    """Values of the lines around each pixel, (window, P): signal, variance (infinite: unused), centres."""

    y: Floats
    variance: Floats
    centres: Floats
    width_px: int


def fit_zero_order(
    lines: ScanLines,
    coarse_px: Floats,
    radiance: NDArray[np.floating],
    std: NDArray[np.floating],
    start: ProjectorResponse,
    reach_px: float,
    progress: Progress | None = None,
) -> ZeroOrderFit:
    """Fit blur and halo with the columns of some pixels; a measured spread keeps its shape.

    ``coarse_px`` (P,) are decoded columns; ``radiance`` and ``std`` (frames, P) are DN per ms, the deviation
    infinite where saturated. Lines up to ``reach_px`` from a column show no first order. Raises
    `CalibrationError` when too few pixels follow the model.
    """
    data = _window(lines, coarse_px, radiance, std, reach_px)
    common = np.array([start.blur_px, start.halo_peak_per_px, np.log(start.halo_decay_px or DECAY_PX)])
    column, amplitude, offset = coarse_px.copy(), data.y.max(0), np.zeros(len(coarse_px))
    use = amplitude > 0
    _require_peaks(use)
    progress = progress or NoProgress()
    for round_ in range(ITERATIONS):
        progress.report("blur and halo", round_, ITERATIONS)
        variance = data.variance + np.where(
            np.abs(column - data.centres) < NEAR_PX, (MODEL_ERROR * amplitude) ** 2, 0.0
        )
        weight = 1 / variance
        value, by_column, by_common = _derivatives(data, column, start, common)
        residual = data.y - amplitude * value - offset
        local = np.stack([value, amplitude * by_column, np.ones_like(value)])
        step, step_common, covariance = _step(
            local, amplitude * by_common, residual, weight, use, common, hold=round_ < SETTLING
        )
        chi = (weight * residual**2).sum(0) / np.maximum(np.isfinite(variance).sum(0) - 3, 1)
        if round_ >= SETTLING:
            use = (
                (chi < MAX_CHI_SQUARE * max(float(np.median(chi)), 1.0))
                & (np.abs(column - coarse_px) < MAX_SHIFT_PX)
                & (amplitude > 0)
            )
        _require_peaks(use)
        common = common + step_common
        common[:2] = common[0].clip(*BLUR_PX), common[1].clip(0.0, MAX_HALO_PER_PX)
        common[2] = common[2].clip(np.log(3.0), np.log(300.0))
        amplitude, column, offset = amplitude + step[0], column + step[1].clip(-0.7, 0.7), offset + step[2]
    require_plausible(float(common[0]), float(common[1]))
    scale = np.sqrt(max(float(np.median(chi[use])), 1.0))
    blur, peak, decay = float(common[0]), float(common[1]), float(np.exp(common[2]))
    spread = np.sqrt(np.diag(covariance)) * scale * (1.0, 1.0, decay)
    response = start.of_width(blur).model_copy(update={"halo_peak_per_px": peak, "halo_decay_px": decay})
    return ZeroOrderFit(
        column, amplitude, use, response, (spread[0], spread[1], spread[2]), float(np.mean(chi[use]))
    )


def require_plausible(blur_px: float, halo_peak_per_px: float) -> None:
    """Raise `CalibrationError` where blur or halo ended at the edge of what a projector can have."""
    low, high = BLUR_PX
    if not low < blur_px < high:
        raise CalibrationError(
            f"The projector's blur came out as {blur_px:g} px, at the edge of what is plausible ({low:g} to"
            f" {high:g} px). Focus the projector on the target, check that nothing saturates, and capture the"
            " step again."
        )
    if halo_peak_per_px >= MAX_HALO_PER_PX:
        raise CalibrationError(
            f"The projector's halo came out as {halo_peak_per_px:g} of a line's light a pixel; less than"
            f" {MAX_HALO_PER_PX:g} is plausible. Clean the projector's lens and the film, keep the room dark,"
            " and capture the step again."
        )


def _require_peaks(use: NDArray[np.bool_]) -> None:
    """Raise `CalibrationError` where too few pixels are used."""
    if use.sum() < MIN_PIXELS:
        raise CalibrationError(
            f"The lines are resolved in only {int(use.sum())} of {len(use)} pixels. Check that a flat white"
            " target fills the picture, in focus and not saturated, and capture the step again."
        )


def _window(
    lines: ScanLines,
    coarse_px: Floats,
    radiance: NDArray[np.floating],
    std: NDArray[np.floating],
    reach_px: float,
) -> _Data:
    half = int(max(reach_px, NEAR_PX) / lines.step_px)
    first = (lines.width_px - 1) / 2
    nearest = np.round((coarse_px - first) / lines.step_px).astype(int)
    index = nearest + np.arange(-half, half + 1)[:, None]
    exists = (index >= 0) & (index < len(radiance))
    index_in = index.clip(0, len(radiance) - 1)
    y = np.take_along_axis(radiance, index_in, 0).astype(float)
    variance = np.take_along_axis(std, index_in, 0).astype(float) ** 2
    exists &= np.isfinite(variance) & np.isfinite(y)
    return _Data(
        np.where(exists, y, 0.0),
        np.where(exists, variance, np.inf),
        first + lines.step_px * index.astype(float),
        lines.width_px,
    )


def _profile(data: _Data, column: Floats, start: ProjectorResponse, common: Floats) -> Floats:
    response = start.of_width(float(common[0])).model_copy(
        update={"halo_peak_per_px": float(common[1]), "halo_decay_px": float(np.exp(common[2]))}
    )
    distance = torch.as_tensor(column - data.centres)
    return np.asarray(
        zero_order_profile(distance, -data.width_px / 2, data.width_px / 2, response).numpy(), np.float64
    )


def _derivatives(
    data: _Data, column: Floats, start: ProjectorResponse, common: Floats
) -> tuple[Floats, Floats, Floats]:
    """Profile, its derivative by the column, and by what pixels share, (3, window, P)."""
    value = _profile(data, column, start, common)
    shift = 1e-3
    by_column = (
        _profile(data, column + shift, start, common) - _profile(data, column - shift, start, common)
    ) / (2 * shift)
    rows = []
    for i, step in enumerate(STEPS):
        moved = common.copy()
        moved[i] += step
        rows.append((_profile(data, column, start, moved) - value) / step)
    return value, by_column, np.stack(rows)


def _step(
    local: Floats,
    common: Floats,
    residual: Floats,
    weight: Floats,
    use: NDArray[np.bool_],
    at: Floats,
    *,
    hold: bool,
) -> tuple[Floats, Floats, Floats]:
    """Steps of each pixel's unknowns (3, P) and the common ones (3,), and the covariance of the latter."""
    own = np.einsum("akp,bkp,kp->pab", local, local, weight) + 1e-12 * np.eye(3)
    cross = np.einsum("akp,gkp,kp->pag", local, common, weight)
    right = np.einsum("akp,kp,kp->pa", local, residual, weight)
    solved = np.linalg.solve(own, np.concatenate([cross, right[..., None]], -1))
    normal = np.einsum("gkp,hkp,kp->pgh", common, common, weight) - np.einsum(
        "pag,pah->pgh", cross, solved[..., :3]
    )
    toward = np.einsum("gkp,kp,kp->pg", common, residual, weight) - np.einsum(
        "pag,pa->pg", cross, solved[..., 3]
    )
    total, pull = normal[use].sum(0), toward[use].sum(0)
    total[2, 2] += DECAY_LOG_STD**-2
    pull[2] -= (at[2] - np.log(DECAY_PX)) * DECAY_LOG_STD**-2
    covariance = np.linalg.inv(total + 1e-9 * np.diag(np.diag(total)))
    step_common = np.zeros(3) if hold else covariance @ pull
    return (solved[..., 3] - solved[..., :3] @ step_common).T, step_common, covariance
