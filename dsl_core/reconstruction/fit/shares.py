"""Findings from how many pixels are limited, and from bands that do not suit the data."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.fit import FitFinding, Part
from dsl_core.model.result import DEPTH_INVALID, Flag, Reach

#: Shares of pixels above which a scan is not what the twin's scenes lead to expect.
MOST_POOR, MOST_AT_BOUND, MOST_LOST, MOST_UNDECIDED = 0.4, 0.1, 0.1, 0.5
#: Bands wider than this many lines leave structure in the data that straight pieces cannot follow.
WIDEST_BAND = 1.25
#: Fewer pixels say nothing.
FEWEST = 50


def share_findings(flags: NDArray[np.integer], has_spectra: bool) -> Iterator[FitFinding]:
    """Findings from the flags (rows, columns) of a result."""
    bits = flags.astype(np.int64)
    lit = (bits & int(Flag.NO_LIGHT)) == 0
    measured = lit & ((bits & int(DEPTH_INVALID)) == 0)
    if np.count_nonzero(lit) >= FEWEST:
        yield _share(
            "coverage",
            "lit pixels without a depth",
            lit,
            ~measured,
            MOST_LOST,
            "Light reaches {0} of the pixels that have no depth.",
            "See the flags: codes that disagree or a depth out of range tell of motion, of surfaces that"
            " light each other, or of another rig's calibration.",
        )
    if not has_spectra or np.count_nonzero(measured) < FEWEST:
        return
    yield _share(
        "mixed pixels",
        "poor fit",
        measured,
        (bits & int(Flag.POOR_FIT)) != 0,
        MOST_POOR,
        "No spectrum explains the line frames of {0} of the pixels.",
        "Look at a picture of the flags: along edges a pixel sees two materials, and more pixels help.",
    )
    yield _share(
        "light",
        "at a bound",
        measured,
        (bits & int(Flag.AT_BOUND)) != 0,
        MOST_AT_BOUND,
        "The spectra of {0} of the pixels touch 0 or 1.5.",
        "Look for highlights and for light that the scan's black frames do not have.",
    )


def _share(
    part: Part,
    name: str,
    among: NDArray[np.bool_],
    where: NDArray[np.bool_],
    limit: float,
    sentence: str,
    advice: str,
) -> FitFinding:
    share = float(np.mean(where[among]))
    return FitFinding(
        part=part,
        name=name,
        value=share,
        unit="share",
        limit=limit,
        significant=share > limit,
        sentence=sentence.format(f"{share:.0%}"),
        advice=advice,
    )


def band_findings(
    step_nm: float, line_nm: float, data_share: NDArray[np.floating], reach: NDArray[np.integer]
) -> Iterator[FitFinding]:
    """Whether bands of ``step_nm`` suit lines that are ``line_nm`` wide, and what data there are.

    ``data_share`` and ``reach`` (bands, rows, columns) are those of a result, NaN and 0 where there is none.
    """
    wide = step_nm / line_nm
    yield FitFinding(
        part="bands",
        name="width of a band in lines",
        value=wide,
        unit="1",
        limit=WIDEST_BAND,
        significant=wide > WIDEST_BAND,
        sentence=f"Bands of {step_nm:g} nm are coarse for lines that are {line_nm:.0f} nm wide.",
        advice=f"Reconstruct with bands of at most {line_nm:.0f} nm.",
    )
    reached = (reach & int(Reach.PLUS_ONE | Reach.MINUS_ONE) != 0) & np.isfinite(data_share)
    if np.count_nonzero(reached) < FEWEST:
        return
    undecided = float(np.mean(data_share[reached] < 0.5))
    yield FitFinding(
        part="bands",
        name="bands that lines reach and the prior decides",
        value=undecided,
        unit="share",
        limit=MOST_UNDECIDED,
        significant=undecided > MOST_UNDECIDED,
        sentence=f"Bands of {step_nm:g} nm are too fine for the data, which leave {undecided:.0%} open.",
        advice="Reconstruct with wider bands, or expose longer.",
    )
