"""Hard cases of columns below a pixel, correspondence and triangulation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from dsl_core.model.geometry import Pose
from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.correspondence import GratingModel, triangulate, zero_order
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.reconstruction.columns.column import refine
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.simulation.published_rig import published_rig
from tests.stability.case import Case, Outcome, is_honest, spread

LINES = LineSet(width_px=5, step_px=2, first_px=2.0, lines=318, frames=318)
RESPONSE = ProjectorResponse(blur_px=0.6, halo_peak_per_px=1e-3, halo_decay_px=31.0)
#: Depth errors that arithmetic may make, mm.
ALLOWED_MM = {torch.float32: 0.05, torch.float64: 1e-6}


def _triangulated(
    rig: Rig, depths_mm: tuple[float, float], count: int = 2000
) -> Callable[[torch.dtype], Outcome]:
    """Columns of known depths, back to depth; in a poor geometry the error may be that of the column."""

    def run(dtype: torch.dtype) -> Outcome:
        rng = np.random.default_rng(3)
        pixels = torch.as_tensor(rng.integers(0, rig.camera.width_px * rig.camera.height_px, count))
        depth = torch.as_tensor(rng.uniform(*depths_mm, count)).to(dtype)
        column = zero_order(rig, pixels, depth)[0]
        seen = (column > 0) & (column < rig.projector.width_px)
        found, slope = triangulate(rig, pixels, column)
        error, worth = (found - depth).abs()[seen].double(), slope[seen].double()
        # Without depth is a flag; more than a few would be a failure all the same.
        lost = torch.isnan(error)
        error, worth = error[~lost], worth[~lost]
        # Half a thousandth of a column is what single precision knows of it.
        allowed = ALLOWED_MM[dtype] + 5e-4 * (dtype == torch.float32) * worth
        worst = float(error.max())
        if not bool((error < allowed).all()) or float(lost.double().mean()) > 0.04:
            return Outcome("wrong", f"{worst:.1g} mm off, {int(lost.sum())} lost")
        return Outcome("right", f"{worst:.0e} mm at most, {float(worth.median()):.3g} mm a px")

    return run


def _lost(dtype: torch.dtype) -> Outcome:
    """Columns that no ray of the pixel meets."""
    rig = published_rig()
    column = torch.tensor([3000.0, -4000.0, torch.nan, torch.inf], dtype=dtype)
    found, _ = triangulate(rig, torch.tensor([0, 1000, 2000, 3000]), column)
    given = torch.isfinite(found)
    return Outcome("wrong" if bool(given.any()) else "flagged", f"{int((~given).sum())} of 4 without depth")


def _posed(translation_mm: tuple[float, float, float]) -> Rig:
    rig = published_rig()
    pose = Pose(rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), translation_mm=translation_mm)
    return rig.model_copy(update={"pose": pose})


def _refined(scale: float, noise: float) -> Callable[[torch.dtype], Outcome]:
    """Peaks of a brightness and relative noise, in any unit."""

    def run(dtype: torch.dtype) -> Outcome:
        generator = torch.Generator().manual_seed(4)
        column = 100 + 400 * torch.rand(600, generator=generator, dtype=torch.float64)
        centre = LINES.centre_px(torch.arange(LINES.lines))[:, None]
        clean = zero_order_profile(column - centre, -2.5, 2.5, RESPONSE)
        dirt = noise * torch.randn(clean.shape, generator=generator, dtype=torch.float64)
        radiance = ((clean + dirt) * scale).to(dtype)
        std = torch.full_like(radiance, noise * scale)
        found = refine(LinePeaks(column.round().to(dtype), radiance, std, LINES, RESPONSE))
        if float(found.refined.double().mean()) < 0.5:
            return Outcome("flagged", "NOT_REFINED")
        sigmas = ((found.column_px.double() - column) / found.std_px)[found.refined].numpy()
        return Outcome("right" if is_honest(sigmas) else "wrong", spread(sigmas))

    return run


def _order(nm: float, order: int) -> Callable[[torch.dtype], Outcome]:
    """Single against double, pixel by pixel, at an extreme wavelength; never what is no number."""

    def run(dtype: torch.dtype) -> Outcome:
        rig, pixels = published_rig(), torch.arange(0, 890 * 580, 997)
        depth = torch.linspace(100.0, 5000.0, len(pixels), dtype=torch.float64)
        model, at = GratingModel(rig), np.array([nm])
        exact = model.exact(pixels, depth, order, at)
        found = model.exact(pixels, depth.to(dtype), order, at)
        if not all(bool(torch.isfinite(part).all()) for part in found):
            return Outcome("wrong", "a column is no finite number")
        inside = exact.inside(640, 360)
        off = (found.columns.double() - exact.columns).abs()[inside]
        worst = float(off.max()) if off.numel() else 0.0
        said = f"{worst:.0e} px from double, {int(inside.sum())} of {len(pixels)} pixels reached"
        return Outcome("right" if worst < 2e-3 else "wrong", said)

    return run


_RIG = published_rig()
CASES = (
    Case("depth over the range", "500 to 1000 mm", _triangulated(_RIG, (500, 1000)), "right"),
    Case("depth beyond the range", "300 to 2500 mm", _triangulated(_RIG, (300, 2500)), "right"),
    Case(
        "a million pixels of depth",
        "500 to 1000 mm",
        _triangulated(_RIG, (500, 1000), 1_000_000),
        "right",
    ),
    Case("one pixel of depth", "700 mm", _triangulated(_RIG, (699, 701), 1), "right"),
    Case(
        "parallel axes",
        "both along z, 60 mm apart",
        _triangulated(_posed((-60.0, 0.0, 0.0)), (500, 1000)),
        "right",
    ),
    Case(
        "almost one centre",
        "0.5 mm apart, half a metre of depth a column",
        _triangulated(_posed((-0.5, 0.0, 0.0)), (600, 800)),
        "right",
    ),
    Case("rays that miss", "columns far outside, NaN, infinite", _lost, "flagged", "4 of 4"),
    Case("peaks, scale 1e-6", "a millionth of the light", _refined(1e-6, 0.02), "right"),
    Case("peaks, scale 1e6", "a million times the light", _refined(1e6, 0.02), "right"),
    Case("peaks in noise", "noise a seventh of the peak", _refined(1.0, 0.15), "right"),
    Case("no peaks", "noise three times the peak", _refined(1.0, 3.0), "flagged", "NOT_REFINED"),
    Case("longest wavelength", "order +1 at 1200 nm", _order(1200.0, 1), "right"),
    Case("evanescent order", "order -2 at 1900 nm", _order(1900.0, -2), "right"),
)
