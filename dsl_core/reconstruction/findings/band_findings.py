"""Whether the bands of a result suit its lines, and what data there are for them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.reach import MOST_UNREACHED, unreached_words
from dsl_core.optics.spectra import ORDERS
from dsl_core.reconstruction.findings.flag_findings import FEWEST, SpectralCounts

#: Share of the bands that lines reach above which the prior decides about too many.
MOST_UNDECIDED = 0.5
#: Bands wider than this many lines leave structure in the data that straight pieces cannot follow.
WIDEST_BAND = 1.25
#: Name of what is found of their width.
WIDE_BANDS = "width of a band in lines"


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


def band_findings(step_nm: float, line_nm: float, spectra: SpectralCounts) -> Iterator[FitFinding]:
    """Whether bands of ``step_nm`` suit lines that are ``line_nm`` wide, and what data there are."""
    wide = step_nm / line_nm
    yield FitFinding.judged(
        "bands",
        WIDE_BANDS,
        wide,
        "1",
        WIDEST_BAND,
        f"Bands of {step_nm:g} nm are coarse for lines that are {line_nm:.0f} nm wide.",
        f"Reconstruct with bands of at most {line_nm:.0f} nm. Until then, nothing shows whether colours and"
        " surfaces are as the model has them.",
    )
    bands = spectra.reached + spectra.unreached
    if bands >= FEWEST:
        unreached = spectra.unreached / bands
        yield FitFinding.judged(
            "bands",
            "bands that no first order reaches",
            unreached,
            "share",
            MOST_UNREACHED,
            *unreached_words(unreached),
        )
    if spectra.reached < FEWEST:
        return
    undecided = spectra.undecided / spectra.reached
    yield FitFinding.judged(
        "bands",
        "bands that lines reach and the prior decides",
        undecided,
        "share",
        MOST_UNDECIDED,
        f"Bands of {step_nm:g} nm are too fine for the data, which leave {undecided:.0%} open.",
        "Reconstruct with wider bands, or expose longer.",
    )
