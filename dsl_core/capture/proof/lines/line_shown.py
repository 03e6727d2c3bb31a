"""Which line it is that a picture shows, where it does not show its own."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts, Floats
from dsl_core.capture.proof.usual_light import LEAST_LIGHT
from dsl_core.model.plan import Shot

#: A picture is like a line if their correlation over columns and LEDs is above this.
LEAST_CORRELATION = 0.5
#: Shares of full light above this are noise or a highlight.
MOST_SHARE = 1.2
#: Pixels of a column from which on more make its mean no more certain, as surfaces differ.
MOST_PIXELS = 10


def line_shown(seen: Counts, lit: Lit, lines: Iterable[tuple[Shot, Floats]], width_px: int) -> Shot | None:
    """The shot among ``lines`` whose pattern a picture is most like; None if it is like none, or dark.

    ``seen`` are the flat counts of the raster; each line comes with its `line_profile`, (3 ``width_px``,).
    """
    share = (seen[lit.index].astype(np.float32) - lit.black) / lit.contrast
    count = np.bincount(lit.key, minlength=3 * width_px)
    mean = np.bincount(lit.key, np.clip(share, 0, MOST_SHARE), 3 * width_px) / np.maximum(count, 1)
    weight = np.minimum(count, MOST_PIXELS).astype(np.float64)
    best, found = LEAST_CORRELATION, None
    for shot, profile in lines:
        norm = float(np.sqrt((weight * profile**2).sum() * (weight * mean**2).sum()))
        score = float((weight * profile * mean).sum()) / norm if norm > 0 else 0.0
        if score > best:
            best, found = score, (shot, profile)
    if found is None:
        return None
    shot, profile = found
    light = mean[(profile > 0.5) & (count > 0)]
    return shot if light.size and float(light.mean()) > LEAST_LIGHT else None
