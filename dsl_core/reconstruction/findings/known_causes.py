"""Findings that follow from others: what a person can act on is said alone."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dsl_core.model.fit import FitFinding
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.findings.band_findings import WIDE_BANDS
from dsl_core.reconstruction.findings.flag_findings import POOR_AREAS, POOR_FIT
from dsl_core.reconstruction.findings.model_findings import (
    COLOUR_GAINS,
    COLOURS_DISAGREE,
    DRIFT_LEFT,
    EVENNESS,
    GAIN_OF_BOTH,
    MISFIT,
    ORDERS_APART,
)
from dsl_core.reconstruction.light.told import BLACK_AGAIN, COLOUR, DRIFT, STEP
from dsl_core.reconstruction.spectral.colour_sites import MOSAIC
from dsl_core.reconstruction.spectral.order_balance import BALANCE

#: What may be left of a drift in frames that follow the light: so much, and so many deviations of it.
MOST_LEFT, SIGMAS = 0.05, 4.5
#: What bands that are too wide for the lines look like: straight pieces follow no spectrum then.
BY_WIDE_BANDS = frozenset({POOR_AREAS, POOR_FIT, COLOUR_GAINS, COLOURS_DISAGREE, MISFIT})
#: What orders that share the light otherwise than spectra can follow look like: no spectrum suits both.
BY_BALANCE = frozenset({POOR_AREAS, POOR_FIT, MISFIT})
#: What else follows from each cause; where pixels have other colours than stated, the model says nothing.
EFFECTS = {WIDE_BANDS: BY_WIDE_BANDS, MOSAIC: BY_WIDE_BANDS | {BALANCE}, BALANCE: BY_BALANCE}


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
    """The same findings, where too wide bands, a wrong mosaic or a turned film may be all that does not fit.

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
        " spectra."
    )
    names = BY_WIDE_BANDS | {GAIN_OF_BOTH, ORDERS_APART}
    # Without a film there is no light in any band.
    return [_after(first, each) if each.name in names and each.part != "film" else each for each in findings]


def with_changes_known(findings: Iterable[FitFinding], earlier: Iterable[FitFinding]) -> list[FitFinding]:
    """The same findings on the model, where white, black and sums of lines, ``earlier``, say what changed.

    A pixel is lit by one order early and by the other late, by lines that run over the frame. So frames that
    follow a drift may seem to ask for more of it on surfaces of few colours; a black that changes, which is
    much of faint orders, looks like a drift or another response; and light that changes looks uneven over the
    frame.
    """
    known = list(earlier)
    told = {each.name for each in known if each.significant}
    course = next((each for each in known if each.name == DRIFT and each.std is not None), None)
    most = np.inf if course is None or course.std is None else max(MOST_LEFT, SIGMAS * course.std)

    def is_explained(each: FitFinding) -> bool:
        if each.name == DRIFT_LEFT:
            return BLACK_AGAIN in told or abs(each.value) > most
        return each.name == EVENNESS and not told.isdisjoint((DRIFT, STEP, COLOUR))

    found = [
        each.model_copy(update={"significant": False}) if is_explained(each) else each for each in findings
    ]
    black = "Scan again with steady black and light first: what black has changed by may be all of it."
    by_black = {GAIN_OF_BOTH, ORDERS_APART} if BLACK_AGAIN in told else set()
    return [_after(black, each) if each.name in by_black else each for each in found]


def _after(first: str, finding: FitFinding) -> FitFinding:
    """A finding that matters, with advice on what to do before that."""
    if not finding.significant:
        return finding
    advice = f"{first} If it stays: {finding.advice[0].lower()}{finding.advice[1:]}"
    return finding.model_copy(update={"advice": advice})
