"""Seconds that a reconstruction takes, from a model whose constants were measured."""

from __future__ import annotations

from dsl_core.model.plan import CapturePlan
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.line_set import LineSet

#: Core seconds a million pixels, fitted to measured reconstructions: fixed; an exposure; banded per band and
#: unit of line overlap; dense per pattern and band; dense per cube of bands.
FIXED_S, EXPOSURE_S, BANDED_S, DENSE_S, CUBE_S = 3.0, 0.045, 1.0, 0.05, 2e-4


def computing_seconds(plan: CapturePlan, grid: WavelengthGrid, cores: int = 2) -> float:
    """Expected seconds of a reconstruction on a machine like the one that was measured."""
    megapixels = plan.camera_size_px[0] * plan.camera_size_px[1] / 1e6
    return megapixels * core_seconds_per_megapixel(plan, grid) / cores


def core_seconds_per_megapixel(plan: CapturePlan, grid: WavelengthGrid) -> float:
    """Core seconds a million pixels."""
    total = FIXED_S + EXPOSURE_S * plan.shot_count
    lines = LineSet.of(plan)
    if lines is not None and lines.lines == lines.frames:
        return total + BANDED_S * grid.count * (1 + lines.width_px / lines.step_px)
    return total + DENSE_S * plan.spectral_count * grid.count + CUBE_S * grid.count**3
