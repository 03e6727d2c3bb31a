"""Everything found about the fit of a result: by its flags, its bands and its scan's probed pixels."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import Fit, FitFinding
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.parallax import parallax_of
from dsl_core.reconstruction.calibration_age import CHANGED_REL_STD
from dsl_core.reconstruction.findings.band_findings import band_findings, line_width_nm
from dsl_core.reconstruction.findings.flag_findings import SpectralCounts, share_findings
from dsl_core.reconstruction.findings.known_causes import (
    with_changes_known,
    with_finer_bands_first,
    without_effects,
)
from dsl_core.reconstruction.findings.line_edges import edge_findings
from dsl_core.reconstruction.findings.model_findings import MOVED, cause_findings
from dsl_core.reconstruction.spectral.colour_sites import MOSAIC
from dsl_core.reconstruction.spectral.film_motion import orders_off_px
from dsl_core.reconstruction.spectral.model_error import ModelError
from dsl_core.reconstruction.spectral.self_correction import Followed


def fit_of(
    rig: Rig,
    plan: CapturePlan,
    grid: WavelengthGrid,
    depth_mm: NDArray[np.floating],
    flags: NDArray[np.integer],
    spectra: SpectralCounts | None,
    followed: Followed | None = None,
    error: ModelError | None = None,
    earlier: Iterable[FitFinding] = (),
) -> Fit:
    """The verdict on a result with these depths and flags (rows, columns), and what was found on the way.

    ``followed`` is what its scan says of the model, where it can say anything, and ``error`` what is left.
    """
    findings = [*earlier]
    blurred = any(finding.significant and finding.part == "focus" for finding in findings)
    findings += share_findings(flags, spectra, blurred)
    findings += edge_findings(plan, flags, rig.projector_response.blur_px)
    findings.append(_of_parallax(rig, depth_mm))
    width_nm = line_width_nm(rig, plan, grid, depth_mm)
    if spectra is not None and width_nm is not None:
        findings += band_findings(grid.step_nm, width_nm, spectra)
    is_coloured = all(each.name != MOSAIC or not each.significant for each in findings)
    if followed is not None and is_coloured:
        off_px = orders_off_px(rig)
        of_model = cause_findings(followed.probe, followed.balanced, followed.motion, off_px, followed.turn)
        findings += with_changes_known(of_model, [*findings])
    turn = None if followed is None else followed.turn
    common = [rig.white_scale_rel_std, rig.reference_rel_std, 0.0 if turn is None else turn.level_rel_std]
    findings = with_finer_bands_first(without_effects(findings), grid.step_nm)
    fit = Fit.of(findings, () if error is None else np.round(error.relative, 4).tolist())
    fit = fit.model_copy(update={"common_rel_std": float(np.linalg.norm(common))})
    if followed is None or not followed.has_changed:
        return fit
    doubts = [found.sentence for found in findings if found.name == MOVED and not found.significant]
    return fit.model_copy(update={"level_rel_std": CHANGED_REL_STD, "unseen": " ".join(doubts)})


def _of_parallax(rig: Rig, depth_mm: NDArray[np.floating]) -> FitFinding:
    """What a column stands for at the depths (rows, columns) that were found."""
    found = parallax_of(rig, depth_mm)
    return FitFinding.judged(
        "geometry",
        "depth for a column",
        found.mm_per_column,
        "mm per column",
        found.most_mm,
        found.sentence if found.is_small else f"A column stands for {found.mm_per_column:.1f} mm of depth.",
        found.advice,
    )
