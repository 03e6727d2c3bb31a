"""Which share of the bands the first orders of a rig reach: what film and projector make of it."""

from __future__ import annotations

import torch

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence, zero_order
from dsl_core.optics.spectra import ORDERS

#: More of the bands of lit pixels without a first order than this is not what a film is chosen for.
MOST_UNREACHED = 0.3
#: About so many pixels are asked.
MOST_PIXELS = 500


def unreached_words(share: float) -> tuple[str, str]:
    """What is said of that share of the bands, and what to do."""
    return (
        f"No first order reaches {share:.0%} of the bands of lit pixels: the film sends their light beyond"
        " the projector's frame, and the prior decides about them.",
        "Use a film of fewer lines per mm or a projector with a wider field, or move the object to the middle"
        " of the projector's frame; then calibrate again if the rig has changed.",
    )


def unreached_share(rig: Rig, grid: WavelengthGrid | None = None) -> float:
    """Share of the bands that no first order reaches, over pixels that the projector lights; NaN for none.

    At a surface that faces the camera at the rig's usual depth.
    """
    lens, size = rig.projector, rig.camera.width_px * rig.camera.height_px
    pixels = torch.arange(0, size, size // MOST_PIXELS | 1)
    depth = torch.full(pixels.shape, rig.usual_depth_mm, dtype=torch.float64)
    column, row = zero_order(rig, pixels, depth)
    lit = (column > -0.5) & (column < lens.width_px - 0.5) & (row > -0.5) & (row < lens.height_px - 0.5)
    if not bool(lit.any()):
        return float("nan")
    nm, trace = (grid or WavelengthGrid()).centres_nm, correspondence(rig).trace
    some = [trace(pixels[lit], depth[lit], m, nm).inside(lens.width_px, lens.height_px) for m in ORDERS]
    return float(1 - torch.stack(some).any(0).double().mean())
