"""How far the modelled peak of a line is off what a scan's own frames show.

Noise is known, so whatever the fitted peaks leave beyond it is an error of the model: of the spread, the
halo, what neighbouring pixels add. It is the same share of every peak; as part of each variance it makes
brighter frames count less and deviations wider, so that it is taken no larger than the frames ask for.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spread.field import widths_at
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.reconstruction.columns.column import MODEL_ERROR, fit_peaks
from dsl_core.reconstruction.columns.line_spread import Pickable, spread_pixels
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.solve.threads import one_kernel_thread

#: Beyond this share of a peak pixels are judged one by one.
LARGEST = 0.03
#: Halvings of what is left between nothing and the largest: to 1e-5 of the peak.
STEPS = 12


def own_peak_error(
    rig: Rig, lines: LineSet | None, code: DecodedCode, white: MergedFrame, stack: Pickable
) -> float:
    """Relative error of the modelled peak; the usual one where single lines do not cover the picture."""
    pixels = spread_pixels(lines, code, white)
    if lines is None or pixels.size == 0:
        return MODEL_ERROR
    seen = stack.pick(pixels)
    with one_kernel_thread():
        column = torch.as_tensor(code.likely_column.ravel()[pixels].astype(np.float64))
        widths = widths_at(rig, torch.as_tensor(pixels), column)
        y, std = (torch.as_tensor(values.astype(np.float64)) for values in (seen.radiance, seen.std))
        return peak_error(column, y, std, lines, rig.projector_response, widths)


def peak_error(
    coarse_px: Tensor,
    radiance: Tensor,
    std: Tensor,
    lines: LineSet,
    response: ProjectorResponse,
    widths: Tensor | None = None,
) -> float:
    """The smallest relative error that leaves no more of the peaks than noise does, at most `LARGEST`.

    Arguments are those of `dsl_core.reconstruction.columns.column.refine`.
    """

    def excess(error: float) -> float:
        fit = fit_peaks(coarse_px, radiance, std, lines, response, widths, error)
        return _excess(fit.chi_square.numpy(), fit.used.numpy())

    if excess(0.0) <= 0:
        return 0.0
    low, high = 0.0, LARGEST
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return high


def _excess(chi_square: NDArray[np.float64], used: NDArray[np.int64]) -> float:
    """Median of the reduced chi-squares of peaks over that of noise alone, less one.

    The median of a chi-square of ``n`` degrees of freedom is ``n (1 - 2 / (9 n))**3`` (Wilson and Hilferty,
    1931).
    """
    freedom = used - 2
    known = (freedom > 1) & np.isfinite(chi_square)
    if not known.any():
        return 0.0
    usual = (1 - 2 / (9 * freedom[known])) ** 3
    return float(np.median(chi_square[known] / usual)) - 1
