"""How far the modelled peak of a line is off what a scan's own frames show.

Noise is known, so whatever the fitted peaks leave beyond it is an error of the model: of the spread, the
halo, what neighbouring pixels add; of combs also of the first orders of other lines under the peak. It is the
same share of every peak; as part of each variance it makes brighter frames count less and deviations wider,
so that it is taken no larger than the frames ask for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.reconstruction.columns.column import COMB_ERROR, fit_peaks
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.solve.threads import one_kernel_thread

#: Beyond this share of a peak of single lines, and `COMB_ERROR` of combs, pixels are judged one by one.
LARGEST = 0.03
#: Halvings of what is left between nothing and the largest: to 1e-5 of the peak.
STEPS = 12


@one_kernel_thread()
def peak_error(peaks: LinePeaks) -> float:
    """The smallest relative error that leaves no more of the peaks than noise does, at most `LARGEST`."""

    def excess(error: float) -> float:
        fit = fit_peaks(peaks, error)
        return _excess(fit.chi_square.numpy(), fit.used.numpy())

    if excess(0.0) <= 0:
        return 0.0
    low, high = 0.0, LARGEST if peaks.lines.single else COMB_ERROR
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
