"""Findings that follow from others: what a person can act on is said alone."""

from __future__ import annotations

from collections.abc import Iterable

from dsl_core.model.fit import FitFinding
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.findings.band_findings import WIDE_BANDS
from dsl_core.reconstruction.findings.flag_findings import POOR_AREAS, POOR_FIT
from dsl_core.reconstruction.findings.model_findings import (
    COLOUR_GAINS,
    COLOURS_DISAGREE,
    DRIFT_LEFT,
    GAIN_OF_BOTH,
    MISFIT,
    ORDERS_APART,
)
from dsl_core.reconstruction.light.told import BLACK_AGAIN, DRIFT
from dsl_core.reconstruction.spectral.colour_sites import MOSAIC
from dsl_core.reconstruction.spectral.order_balance import BALANCE

#: What may be left of a drift in frames that follow the light: so much, and so many deviations of it.
MOST_LEFT, SIGMAS = 0.05, 4.5
#: What bands that are too wide for the lines look like: straight pieces follow no spectrum then.
BY_WIDE_BANDS = frozenset({POOR_AREAS, POOR_FIT, COLOUR_GAINS, COLOURS_DISAGREE, MISFIT})
#: What else follows from each cause; where pixels have other colours than stated, the model says nothing.
EFFECTS = {WIDE_BANDS: BY_WIDE_BANDS, MOSAIC: BY_WIDE_BANDS | {BALANCE}}


def with_known_causes(findings: Iterable[FitFinding]) -> list[FitFinding]:
    """The same findings, where a changed black explains why the first orders share the light otherwise.

    They are a few numbers bright, and a pixel sees them early and late in a scan.
    """
    found = list(findings)
    if not any(each.significant and each.name == BLACK_AGAIN for each in found):
        return found
    return [_by_black(each) if each.name == BALANCE else each for each in found]


def _by_black(finding: FitFinding) -> FitFinding:
    """Of the orders: they are not the film's fault."""
    return finding.model_copy(
        update={
            "sentence": f"Order +1 is {1 + finding.value:.2f} times as bright against order -1 as calibrated:"
            " what black has changed by during the scan is much of their faint light.",
            "advice": "Scan again with steady black and light. If the orders still differ, look whether the"
            " film was turned over.",
        }
    )


def without_effects(findings: Iterable[FitFinding]) -> list[FitFinding]:
    """The same findings, where bands too wide for the lines, or a wrong mosaic, may be all that does not fit.

    Nobody should look for a fault of the film or the surface before that is mended.
    """
    found = list(findings)
    causes = {each.name for each in found if each.significant}
    hidden = frozenset[str]().union(*(names for cause, names in EFFECTS.items() if cause in causes))
    return [each.model_copy(update={"significant": False}) if each.name in hidden else each for each in found]


def with_finer_bands_first(findings: Iterable[FitFinding], step_nm: float) -> list[FitFinding]:
    """The same findings, where bands of ``step_nm`` are wider than usual and may be all that does not fit.

    Straight pieces that are too long for a spectrum look like a fault of the rig, which nobody should look
    for before.
    """
    usual_nm = WavelengthGrid().step_nm
    if step_nm <= usual_nm:
        return list(findings)
    first = (
        f"Reconstruct with bands of {usual_nm:g} nm first: ones of {step_nm:g} nm may be too wide for these"
        " spectra. If it stays: "
    )
    return [
        each.model_copy(update={"advice": first + each.advice[0].lower() + each.advice[1:]})
        if each.significant
        and each.part != "film"
        and each.name in BY_WIDE_BANDS | {GAIN_OF_BOTH, ORDERS_APART}
        else each
        for each in findings
    ]


def without_drift_that_is_none(
    findings: Iterable[FitFinding], earlier: Iterable[FitFinding]
) -> list[FitFinding]:
    """The same findings on the model, where white and sums of lines, ``earlier``, say how the light drifted.

    Frames follow it. Surfaces of few colours, seen by one order early and by the other late, may seem to ask
    for more.
    """
    course = next((each for each in earlier if each.name == DRIFT and each.std is not None), None)
    if course is None or course.std is None:
        return list(findings)
    most = max(MOST_LEFT, SIGMAS * course.std)
    return [
        each.model_copy(update={"significant": False})
        if each.name == DRIFT_LEFT and abs(each.value) > most
        else each
        for each in findings
    ]
