"""One self-contained page about one result: what was found, how good it is, what it cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dsl_core.evaluation.cost import COSTS_ATTRIBUTE, StageCost, costs_of
from dsl_core.evaluation.report.curves import (
    HEIGHT,
    WIDTH,
    Curve,
    calibration_curve,
    rainbow,
    share_curve,
    spectrum_curve,
)
from dsl_core.evaluation.report.pages import render_page
from dsl_core.evaluation.report.pictures import ReportPicture, colour_picture, flag_picture, value_picture
from dsl_core.evaluation.summary import Evaluation, PatchScore, Truth
from dsl_core.evaluation.verdict import Goal, Verdict, verdicts
from dsl_core.model.attributes import PLAN_ATTRIBUTE, plan_of
from dsl_core.model.calibration.accepted import MISSED_ATTRIBUTE, read_missed
from dsl_core.model.fit import ATTRIBUTE, Fit
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rendered_effects import RenderedEffects
from dsl_core.model.result_order import columns_and_rows_px, wavelengths_of, without_missing_bands
from dsl_core.optics.colour import hold_colour
from dsl_core.words import readable

if TYPE_CHECKING:
    import xarray as xr

#: Spectra shown when there is no truth and no pixel was chosen: a grid of this many columns and rows.
_SAMPLE_GRID = (4, 2)


@dataclass(frozen=True)
class ReportTable:
    """A table of texts with a title, headings and a note below; numbers stand right of the first column."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


@dataclass(frozen=True)
class ReportContent:
    """What a report is made of; everything but title and result may be absent.

    ``pixels`` are (row, column) whose spectra are shown; ``effects`` is what a twin rendered; ``provenance``
    lists facts by name, ``fit`` says how well the model fits, ``missed`` which limits the rig's calibrations
    missed. ``more`` pictures, ``curves`` and ``tables`` are shown as they are; ``places`` are (row, column)
    of what the curves are of, in their order. Without pixels, ``has_samples`` shows some of a grid.
    """

    title: str
    result: xr.Dataset
    summary: str = ""
    evaluation: Evaluation | None = None
    truth: Truth | None = None
    verdicts: Sequence[Verdict] = ()
    costs: Sequence[StageCost] = ()
    plan: CapturePlan | None = None
    effects: RenderedEffects | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)
    pixels: Sequence[tuple[int, int]] = ()
    fit: Fit | None = None
    missed: Sequence[str] = ()
    more: Sequence[ReportPicture] = ()
    curves: Sequence[Curve] = ()
    tables: Sequence[ReportTable] = ()
    places: Sequence[tuple[int, int]] = ()
    has_samples: bool = True


def pictures_of(content: ReportContent) -> list[ReportPicture]:
    """All pictures of a report."""
    return [*_pictures(content, _pixels(content) or content.places), *content.more]


def curves_of(content: ReportContent) -> list[Curve]:
    """All curves of spectra of a report."""
    return [*_spectra(content, _pixels(content)), *content.curves]


def render_report(content: ReportContent) -> str:
    """The report as one HTML page without references to other files.

    Raises `StoreError` when the page's template is not installed, ``IndexError`` for a chosen pixel outside
    the image.
    """
    evaluation = content.evaluation
    has_spectra = "reflectance" in content.result
    return render_page(
        "report.html.j2",
        title=content.title,
        summary=content.summary,
        fit=content.fit,
        missed=content.missed,
        verdicts=content.verdicts,
        pictures=pictures_of(content),
        spectra=curves_of(content),
        tables=content.tables,
        honesty=_honesty(content),
        rainbow=rainbow(_bands(content)) if has_spectra else [],
        width=WIDTH,
        height=HEIGHT,
        patches=() if evaluation is None else evaluation.patches,
        unmeasured=() if evaluation is None else evaluation.unmeasured,
        costs=content.costs,
        total_seconds=sum(cost.seconds for cost in content.costs),
        plan=_plan_facts(content.plan) if content.plan else {},
        effects=content.effects,
        provenance=content.provenance,
    )


def _bands(content: ReportContent) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.asarray(content.result["wavelength_nm"].values, np.float64)


def _pixels(content: ReportContent) -> list[tuple[int, int]]:
    """Pixels whose spectra are drawn: the chosen ones, or a grid where patches do not say more."""
    if content.pixels or "reflectance" not in content.result or not content.has_samples:
        return list(content.pixels)
    if content.evaluation is not None and content.evaluation.patches:
        return []
    _, rows, columns = content.result["reflectance"].shape
    across, down = _SAMPLE_GRID
    return [
        (int((j + 0.5) * rows / down), int((i + 0.5) * columns / across))
        for j in range(down)
        for i in range(across)
    ]


def _pictures(content: ReportContent, pixels: Sequence[tuple[int, int]]) -> list[ReportPicture]:
    """Every map that the result and its truth allow."""
    result = content.result
    found: list[ReportPicture] = []
    if "rgb" in result:
        picture = colour_picture(result["rgb"].values, "Colour", _colour_caption(content))
        rows, columns = result["rgb"].shape[1:]
        pins = tuple(
            (100 * (column + 0.5) / columns, 100 * (row + 0.5) / rows, str(number))
            for number, (row, column) in enumerate(pixels, start=1)
        )
        found.append(ReportPicture(picture.title, picture.caption, picture.uri, pins=pins))
    if "depth_mm" in result:
        depth = result["depth_mm"].values
        found.append(value_picture(depth, "Depth", "along the camera axis", "mm", "viridis_r"))
    if "depth_std_mm" in result:
        std = result["depth_std_mm"].values
        found.append(
            value_picture(std, "Uncertainty of depth", "standard deviation as stated", "mm", "magma")
        )
    truth = content.truth
    if truth is not None and truth.depth_mm is not None and "depth_mm" in result:
        error = result["depth_mm"].values - truth.depth_mm
        found.append(value_picture(error, "Error of depth", "measured minus true", "mm", "RdBu_r", True))
    if "reflectance_std" in result:
        spread = result["reflectance_std"].values.mean(axis=0)
        caption = "standard deviation as stated, mean over bands"
        found.append(value_picture(spread, "Uncertainty of reflectance", caption, "", "magma"))
    if "flags" in result:
        caption = "the most serious flag of each pixel; shares count every flag"
        found.append(flag_picture(result["flags"].values.astype(np.int64), "Flags", caption))
    return found


def _colour_caption(content: ReportContent) -> str:
    if "reflectance" in content.result and not hold_colour(_bands(content)):
        return "in sRGB as if spectra continued straight around the bands, which hold too little of a colour"
    return "as seen under daylight (D65), in sRGB"


def _spectra(content: ReportContent, pixels: Sequence[tuple[int, int]]) -> list[Curve]:
    """Curves of the patches with known spectra, then of single pixels."""
    if "reflectance" not in content.result:
        return []
    bands = _bands(content)
    columns_px, rows_px = columns_and_rows_px(content.result)
    patches = () if content.evaluation is None else content.evaluation.patches
    drawn = [spectrum_curve(p.name, _patch_note(p), bands, p.mean, p.posterior_std, p.truth) for p in patches]
    for number, (row, column) in enumerate(pixels, start=1):
        spectrum = content.result["reflectance"].values[:, row, column].astype(np.float64)
        if not np.isfinite(spectrum).all():
            continue
        std = None
        if "reflectance_std" in content.result:
            std = content.result["reflectance_std"].values[:, row, column].astype(np.float64)
        note = f"row {rows_px[row]}, column {columns_px[column]}"
        drawn.append(
            spectrum_curve(
                f"Pixel {number}", note, bands, spectrum, std, _true_spectrum(content, row, column)
            )
        )
    return drawn


def _patch_note(patch: PatchScore) -> str:
    if patch.peak is not None:
        return f"FWHM {patch.peak.fwhm_nm:.1f} nm"
    colour = "" if np.isnan(patch.delta_e) else f" · ΔE00 {patch.delta_e:.1f}"
    return f"RMSE {patch.rmse:.3f}{colour}"


def _true_spectrum(
    content: ReportContent, row: int, column: int
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
    truth = content.truth
    if truth is None or truth.material is None or truth.spectra is None or truth.material[row, column] < 0:
        return None
    return np.asarray(truth.spectra[truth.material[row, column]], np.float64)


def _honesty(content: ReportContent) -> list[Curve]:
    """Calibration of the uncertainties, and how much of each band the data decide."""
    drawn = []
    evaluation = content.evaluation
    if evaluation is not None and evaluation.depth_calibration is not None:
        drawn.append(calibration_curve("Uncertainty of depth", evaluation.depth_calibration))
    if evaluation is not None and evaluation.spectral_calibration is not None:
        drawn.append(calibration_curve("Uncertainty of reflectance", evaluation.spectral_calibration))
    if "data_share" in content.result:
        cube = content.result["data_share"].values
        # Band by band, because a mean that skips NaN copies what it is given.
        share = np.array(
            [float(band[np.isfinite(band)].mean()) if np.isfinite(band).any() else np.nan for band in cube]
        )
        drawn.append(share_curve(_bands(content), share))
    return drawn


def _plan_facts(plan: CapturePlan) -> dict[str, str]:
    settings = ", ".join(f"{s.exposure_ms:.4g} ms at level {s.level:g}" for s in plan.settings)
    repeats = f", {plan.sentinel_count} repeats" if plan.sentinel_count else ""
    return {
        "Plan": plan.name,
        "Frames": f"{plan.shot_count} ({plan.code_count} code, {plan.spectral_count} spectral"
        f" patterns{repeats})",
        "Settings": settings,
        "Exposure": f"{plan.duration_s() / 60:.1f} min without latency",
        "Raw data": f"{plan.raw_bytes / 1e6:.0f} MB before compression",
        "Camera": "{} × {} px".format(*plan.camera_size_px),
        "Projector": "{} × {} px".format(*plan.projector_size_px),
    }


def report_content(
    title: str,
    result: xr.Dataset,
    truth: Truth | None = None,
    evaluation: Evaluation | None = None,
    summary: str = "",
    goals: dict[str, Goal] | None = None,
) -> ReportContent:
    """What the report of a result says; plan and costs come from the result's attributes.

    Raises `StoreError` where it has a reflectance, but not a wavelength for each band.
    """
    if "reflectance" in result:
        wavelengths_of(result, title)
    attributes = dict(result.attrs)
    costs, plan = costs_of(attributes), plan_of(attributes)
    fit = Fit.read(attributes)
    missed = read_missed(attributes)
    for name in (ATTRIBUTE, MISSED_ATTRIBUTE, COSTS_ATTRIBUTE, PLAN_ATTRIBUTE):
        attributes.pop(name, None)
    effects = RenderedEffects.of_note(str(attributes.get("effects", "")))
    if effects is not None:
        del attributes["effects"]
    return ReportContent(
        readable(title),
        without_missing_bands(result),
        summary=summary,
        evaluation=evaluation,
        truth=truth,
        verdicts=() if evaluation is None else verdicts(evaluation, goals),
        costs=costs,
        plan=plan,
        effects=effects,
        fit=fit,
        missed=missed,
        provenance={str(key).replace("_", " "): str(value) for key, value in attributes.items()},
    )
