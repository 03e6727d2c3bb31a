"""Everything that is found about the fit of a result."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dsl_core.model.fit import Fit, FitFinding
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.line_set import LineSet
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.fit.causes import cause_findings
from dsl_core.reconstruction.fit.shares import band_findings, share_findings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dsl_core.reconstruction.spectral.spectra import SpectralMaps


def fit_of(
    rig: Rig,
    plan: CapturePlan,
    grid: WavelengthGrid,
    depth_mm: NDArray[np.floating],
    flags: NDArray[np.integer],
    spectra: SpectralMaps | None,
) -> Fit:
    """The verdict on a result with these depths and flags (rows, columns)."""
    findings: list[FitFinding] = list(share_findings(flags, spectra is not None))
    width_nm = line_width_nm(rig, plan, grid, depth_mm)
    if spectra is not None and width_nm is not None:
        findings += band_findings(grid.step_nm, width_nm, spectra.data_share, spectra.reach)
    if spectra is not None and spectra.followed is not None:
        followed = spectra.followed
        findings += cause_findings(followed.probe, followed.balanced, followed.motion)
    error = None if spectra is None else spectra.error
    return Fit.of(findings, () if error is None else np.round(error.relative, 4).tolist())


def line_width_nm(
    rig: Rig, plan: CapturePlan, grid: WavelengthGrid, depth_mm: NDArray[np.floating]
) -> float | None:
    """Width of a projected line over wavelength at the median depth of the picture's middle.

    None where patterns are no lines or no order reaches the middle.
    """
    import torch

    lines = LineSet.of(plan)
    known = depth_mm[np.isfinite(depth_mm)]
    if lines is None or known.size == 0:
        return None
    height, width = depth_mm.shape
    pixel = torch.tensor([height // 2 * width + width // 2])
    depth = torch.tensor([float(np.median(known))], dtype=torch.float64)
    ends = np.array([grid.start_nm, grid.stop_nm], np.float64)
    slopes = []
    for order in ORDERS:
        columns = GratingModel(rig).trace(pixel, depth, order, ends).columns
        slopes.append(float((columns[1] - columns[0]).abs().max()) / float(ends[1] - ends[0]))
    dispersion = max((slope for slope in slopes if np.isfinite(slope)), default=0.0)
    return lines.width_px / dispersion if dispersion > 0 else None
