"""How far noise in depth tilts a surface, and with it shading."""

from __future__ import annotations

from torch import Tensor


def tilt_std(depth_rel: Tensor, column_std_px: Tensor, fx_px: float, window_px: int) -> Tensor:
    """Deviation of a surface's slope (tangent) from plane fits over a window, (samples, 1).

    ``depth_rel`` (samples, spectra) are relative errors of depth; fits weigh pixels by the stated deviation
    of their columns (samples, spectra), as `surface` does.
    """
    weight = column_std_px.double() ** -2
    square = ((weight * depth_rel) ** 2).mean(1, keepdim=True) / weight.mean(1, keepdim=True) ** 2
    found: Tensor = square.sqrt() * fx_px * (12 / (window_px * window_px - 1)) ** 0.5 / window_px
    return found
