"""Seconds that a reconstruction takes, from a model whose constants were measured."""

from __future__ import annotations

from dsl_core.model.plan import CapturePlan
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.line_set import LineSet

#: Core seconds a million pixels at `BANDS` bands, least squares over 68 reconstructions of small pieces of
#: the twin: single lines, fixed and an exposure (scatter 24 %); all other sets, fixed and a pattern (11 %).
#: Pieces pay the start of every tile, so that whole pictures take less.
LINES_S, EXPOSURE_S = 41.0, 0.042
DENSE_S, PATTERN_S = 229.0, 9.9
BANDS = 47


def computing_seconds(plan: CapturePlan, grid: WavelengthGrid, cores: int = 2) -> float:
    """Expected seconds of a reconstruction on a machine like the one that was measured."""
    megapixels = plan.camera_size_px[0] * plan.camera_size_px[1] / 1e6
    return megapixels * core_seconds_per_megapixel(plan, grid) / cores


def core_seconds_per_megapixel(plan: CapturePlan, grid: WavelengthGrid) -> float:
    """Core seconds a million pixels.

    The number of bands was not varied: time is taken as proportional to it for lines, whose matrices are
    banded, and to its square elsewhere, where building full matrices takes most of the time.
    """
    share = grid.count / BANDS
    lines = LineSet.of(plan)
    if lines is not None and lines.lines == lines.frames:
        return LINES_S * share + EXPOSURE_S * plan.shot_count
    return (DENSE_S + PATTERN_S * plan.spectral_count) * share**2
