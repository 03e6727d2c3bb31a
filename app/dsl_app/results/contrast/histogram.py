"""What a histogram of the picture shown says: counts of each channel, and the levels on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.layers import Layer
from dsl_core.optics.levels import Levels

BINS = 160
#: Pixels that are counted, about; more would delay a band slider that is dragged.
COUNTED = 60_000
#: How far beyond its own levels a picture is counted, as a share of the way between them.
BEYOND = 0.3


@dataclass(frozen=True, eq=False)
class Histogram:
    """Bars of one channel or of red, green and blue.

    ``edges`` (bins + 1) are values of the picture in ``unit``, and ``heights`` (channels, bins) are between
    0 and 1. ``levels`` are those on the picture, which ``can_reset`` if a person set them.
    """

    key: str
    label: str
    unit: str
    edges: NDArray[np.float64]
    heights: NDArray[np.float64]
    levels: Levels
    can_reset: bool


def histogram_of(layer: Layer | None) -> Histogram | None:
    """The histogram of what is painted; None for a picture without levels, such as one of classes."""
    if layer is None or layer.contrast is None:
        return None
    contrast = layer.contrast
    levels, own = contrast.levels, contrast.automatic
    room = BEYOND * (own[1] - own[0])
    low, high = (own[0], own[1]) if contrast.is_bounded else (own[0] - room, own[1] + room)
    low, high = min(low, levels[0]), max(high, levels[1])
    edges = np.linspace(low, high, BINS + 1)
    counts = np.stack([np.histogram(_thinned(values), edges)[0] for values in contrast.values])
    # Square roots: the bars of small objects stay visible next to those of the background.
    heights = np.sqrt(counts / max(int(counts.max()), 1))
    return Histogram(
        contrast.key, contrast.label, contrast.unit, edges, heights, levels, can_reset=contrast.is_chosen
    )


def _thinned(values: NDArray[Any]) -> NDArray[Any]:
    step = max(int(np.sqrt(values.size / COUNTED)), 1)
    known: NDArray[Any] = values[::step, ::step]
    known = known[np.isfinite(known)]
    return known
