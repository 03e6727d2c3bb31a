"""Colour maps for images, and levels that hold nearly all of their values."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray

#: Perceptually uniform maps of pyqtgraph: grey for a band, colours for quantities that are not light.
GREY, DEPTH, SHARE = "CET-L1", "viridis", "cividis"


def spread_of(values: NDArray[np.floating[Any]], low: float = 0.5, high: float = 99.5) -> tuple[float, float]:
    """Levels that hold nearly all values, from a thinned copy."""
    step = max(values.shape[-1] // 200, 1)
    known = values[..., ::step, ::step]
    known = known[np.isfinite(known)]
    if known.size == 0:
        return 0.0, 1.0
    bottom, top = (float(v) for v in np.percentile(known, (low, high)))
    return bottom, max(top, bottom + 1e-6 * max(abs(bottom), 1.0))


def colour_map(name: str) -> Any:
    """A colour map of pyqtgraph."""
    return pg.colormap.get(name)
