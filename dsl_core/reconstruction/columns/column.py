"""The projector column of a pixel below one pixel, from the zero-order peak across the line frames.

Around its column a pixel sees ``y_k = a g(q - x_k)``: the line's profile blurred by the projector, plus
the halo. Amplitude and column are fitted by weighted least squares (variable projection, Gauss-Newton)
from the frames within a few columns; the dim slopes that the brighter setting resolves count by their
inverse variance like everything else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields

import torch
from torch import Tensor

from dsl_core.optics.lines.profile import halo_of_band
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.reconstruction.columns.loose_columns import LOOSE_PX, loose_columns

#: Steps of the fit, and the longest, px.
ITERATIONS, STEP_PX = 6, 0.7
#: Where the fit of a measured spread starts, from the decoded column, px.
ASIDE_PX = 0.35
#: Where it starts again where it has not led to the peak, px: just within the ends of the column.
ENDS_PX = (-0.45, 0.45)
#: Relative error of the modelled peak (blur, halo, neighbouring pixels), added to each variance, where a scan
#: was not asked for its own (`peak_error`).
MODEL_ERROR = 0.0015
#: The same for combs, where the first orders of other lines are under the peak. So much the brightness of a
#: peak is off by in any case: they are nearly alike in its frames, which moves no column.
COMB_ERROR = 0.05
#: A column is loose, whatever its fit says, unless the line next to its own lights it by so many deviations:
#: without, the fit has stopped where the slope of that line would begin.
SEEN_SIGMAS = 3.0
#: Out of the column that the code names, by so many px from its middle, noise might be taken for that light:
#: there it must be as clear as this.
APART_PX, CLEAR_SIGMAS = 0.65, 8.0
#: A refined column this far from the decoded one is not the same peak.
MAX_SHIFT_PX = 2.0
#: Above this reduced chi-square the profile does not fit (two surfaces in one pixel, motion).
MAX_CHI_SQUARE = 25.0
#: Peaks beyond that are fitted again, as wide as surfaces out of focus make them (relative to what is
#: expected) and with this relative error: pixels see other light as well, of glare or a second surface.
FOCI, UNUSUAL_ERROR = (1.0, 0.75, 1.35, 1.8, 2.4), 0.03
#: What any peak of even width leaves may be uneven, as light that travels in a translucent surface is: it
#: displaces columns by this many times what as much noise would, and by no more than so many px.
UNEVEN, MOST_UNEVEN_PX = 10.0, 1.0
#: What fits no better than this then is not one peak.
UNUSUAL_CHI_SQUARE = 4.0


@dataclass(frozen=True)
class Column:
    """Refined columns of some pixels and their deviation (px), zero-order amplitude and its deviation.

    ``unusual`` are those whose peak has another shape than expected, ``saturated`` those of which a frame
    around the peak is saturated.
    """

    column_px: Tensor
    std_px: Tensor
    amplitude: Tensor
    amplitude_std: Tensor
    refined: Tensor
    unusual: Tensor
    saturated: Tensor


def refine(peaks: LinePeaks, model_error: float | None = None) -> Column:
    """Refine decoded columns.

    ``model_error`` is that of the peak, relative to it, None for the usual one. Where the fit fails, the
    decoded column stays, with the deviation of a whole pixel, ``1/sqrt(12)``. Its amplitude is that of the
    brightest frame near it, or of the fit to what is left where frames are saturated, with an infinite
    deviation: less would make light of the zero order next to them.
    """
    coarse_px, single = peaks.coarse_px, peaks.lines.single
    if model_error is None:
        model_error = MODEL_ERROR if single else COMB_ERROR
    fit = fit_peaks(peaks, model_error)
    unusual = _is_unusual(fit)
    poor = torch.nonzero(unusual).ravel()
    error = torch.full_like(fit.amplitude, model_error)
    if not single and model_error < COMB_ERROR and len(poor):
        # What most peaks leave says little of a colour, or a material, whose first orders are bright.
        fit = _best_of(fit, poor, (fit_peaks(peaks.some(poor), COMB_ERROR),))
        error[poor] = COMB_ERROR
        unusual = _is_unusual(fit)
    if single and len(poor):
        # Sharp lines show no slope but at their ends, where a fit may have to begin.
        again = peaks.some(poor)
        fit = _best_of(fit, poor, (fit_peaks(again, model_error, aside) for aside in ENDS_PX))
        unusual = _is_unusual(fit)
        poor = torch.nonzero(unusual).ravel()
    if single and len(poor):
        unlike = peaks.some(poor)
        fit = _best_of(fit, poor, (fit_peaks(unlike.wider(focus), UNUSUAL_ERROR) for focus in FOCI))
    q, chi_square = fit.column_px, fit.chi_square
    std_px = torch.sqrt(chi_square.clip(min=1) / fit.information)
    limit = torch.where(unusual, UNUSUAL_CHI_SQUARE, MAX_CHI_SQUARE)
    good = (fit.used > 3) & (fit.amplitude > 0) & (chi_square < limit) & (std_px < 1 / math.sqrt(12))
    good &= ((q - coarse_px).abs() < MAX_SHIFT_PX) & torch.isfinite(q)
    otherwise = torch.where(fit.measured, fit.brightest, torch.maximum(fit.amplitude, fit.brightest))
    apart = (q - coarse_px).abs() > APART_PX
    is_loose = fit.beside < torch.where(apart, CLEAR_SIGMAS, SEEN_SIGMAS)
    if single or peaks.leaves_gaps:
        # Where every place is on a slope, a comb's wide deviation is that of the light of its other lines.
        is_loose |= std_px > LOOSE_PX
    saturated = peaks.saturated()
    loose = torch.nonzero(good & ~unusual & is_loose).ravel()
    if len(loose):
        scale, by_slopes = chi_square[loose].clip(min=1), q[loose]
        q[loose], std = loose_columns(peaks.some(loose), error[loose] * fit.amplitude[loose], scale)
        # Light that saturates lines may saturate the code as well, which is off by some columns then.
        std_px[loose] = torch.where(saturated[loose], torch.maximum(std, (q[loose] - by_slopes).abs()), std)
    std_px = torch.where(good, std_px, torch.full_like(q, 1 / math.sqrt(12)))
    uneven_px = UNEVEN * torch.sqrt(chi_square / fit.information)
    std_px = torch.where(unusual & single, torch.maximum(std_px, uneven_px.clip(max=MOST_UNEVEN_PX)), std_px)
    return Column(
        torch.where(good, q, coarse_px),
        std_px,
        torch.where(good, fit.amplitude, otherwise),
        torch.where(good | fit.measured, fit.amplitude_std, torch.inf),
        good,
        good & unusual,
        saturated,
    )


@dataclass(frozen=True)
class PeakFit:
    """Column (px) and amplitude of some peaks as they were fitted, each (pixels,).

    With the information on the column (1/px2), reduced chi-square, frames used, the brightest of them,
    whether all of them were measured, and by how many of its deviations the second brightest is lit.
    """

    column_px: Tensor
    amplitude: Tensor
    amplitude_std: Tensor
    information: Tensor
    chi_square: Tensor
    used: Tensor
    brightest: Tensor
    measured: Tensor
    beside: Tensor


def _is_unusual(fit: PeakFit) -> Tensor:
    """Which peaks do not have the shape that was fitted (pixels,), bool."""
    return (fit.chi_square > MAX_CHI_SQUARE) & (fit.used > 3) & (fit.amplitude > 0)


def _best_of(fit: PeakFit, poor: Tensor, again: Iterable[PeakFit]) -> PeakFit:
    """The fit with ``poor`` peaks, by their indices, taken from those fits of them that suit them best."""
    found = {field.name: getattr(fit, field.name).clone() for field in fields(PeakFit)}
    for other in again:
        better = other.chi_square < found["chi_square"][poor]
        for name, values in found.items():
            values[poor[better]] = getattr(other, name)[better]
    return PeakFit(**found)


def fit_peaks(peaks: LinePeaks, model_error: float, aside_px: float | None = None) -> PeakFit:
    """Fit column and amplitude, with the arguments of `refine`, and judge nothing.

    The fit starts ``aside_px`` from the decoded column, or where the spread asks for.
    """
    y, variance, centres = peaks.window()
    # Measured spreads may end sharply: from the middle between two frames no frame shows a slope.
    usual_px = 0.0 if peaks.response.spread is None else ASIDE_PX
    q = peaks.coarse_px + (usual_px if aside_px is None else aside_px)
    brightest = amplitude = y.amax(0)
    # No distance grows by more than the steps of all iterations.
    reach_px = float((q - centres).abs().max()) + ITERATIONS * STEP_PX
    table = peaks.table(q, reach_px)
    for _ in range(ITERATIONS):
        g, slope = table.at(q - centres)
        weight = 1 / (variance + (model_error * amplitude) ** 2)
        wg = weight * g
        gg = (wg * g).sum(0).clip(min=1e-30)
        amplitude = (wg * y).sum(0) / gg
        residual = y - amplitude * g
        along = slope - g * ((wg * slope).sum(0) / gg)
        information = (amplitude**2 * (weight * along * along).sum(0)).clip(min=1e-12)
        q = q + (amplitude * (weight * along * residual).sum(0) / information).clip(-STEP_PX, STEP_PX)
    used = (weight > 0).sum(0)
    # Halo reaches every place between the lines alike, and says nothing of where their edges are.
    half_px = peaks.lines.width_px / 2
    edges = g - halo_of_band(q - centres, -half_px, half_px, peaks.response)
    beside = (amplitude * edges * torch.sqrt(weight)).topk(2, 0).values[1]
    chi_square = (weight * residual**2).sum(0) / (used - 2).clip(min=1)
    measured = torch.isfinite(variance).all(0)
    if not peaks.lines.single:
        gg = (g**2 / (variance + (COMB_ERROR * amplitude) ** 2)).sum(0).clip(min=1e-30)
    return PeakFit(
        q, amplitude, 1 / torch.sqrt(gg), information, chi_square, used, brightest, measured, beside
    )
