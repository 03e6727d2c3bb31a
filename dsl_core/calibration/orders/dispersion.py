"""How many columns a nanometre of the first orders takes, by which windows in columns are scaled."""

from __future__ import annotations

import numpy as np

from dsl_core.model.rig import Rig

#: Focal length (columns) and film of the projector that windows in columns are stated for.
FOCAL_PX, LINES_PER_MM = 983.0, 500.0
#: Light of filters up to this width (nm) is inside such windows, with what single colours see of its flanks.
WIDTH_NM = 20.0
#: Where no wavelength is named, and the sine of the steepest angle that is asked.
MIDDLE_NM, STEEPEST = 550.0, 0.9


def columns_per_nm(focal_px: float, lines_per_mm: float, nm: float) -> float:
    """Columns that a nanometre of a first order takes, by the grating equation at normal incidence.

    >>> round(columns_per_nm(983.0, 500.0, 550.0), 3)
    0.553
    """
    sine = min(nm * lines_per_mm * 1e-6, STEEPEST)
    return float(focal_px * lines_per_mm * 1e-6 / np.sqrt(1 - sine**2) ** 3)


def widening(rig: Rig, nm: float = MIDDLE_NM, width_nm: float = 0.0) -> float:
    """How many times more columns an order at ``nm`` takes than those that windows are stated for.

    ``width_nm`` is the width of the filter it is seen through. At least 1: lines, their blur and bins take
    the same columns however little the film disperses.
    """
    stated = columns_per_nm(FOCAL_PX, LINES_PER_MM, nm)
    times = columns_per_nm(rig.projector.fx_px, rig.film.lines_per_mm, nm) / stated
    return max(1.0, times * max(1.0, width_nm / WIDTH_NM))
