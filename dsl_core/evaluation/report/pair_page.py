"""One self-contained page about two results: where they differ, and by how much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.evaluation.report.pages import render_page
from dsl_core.evaluation.report.pictures import ReportPicture, value_picture
from dsl_core.evaluation.report.series_page import Table
from dsl_core.evaluation.verdict import Verdict

_NOTE = "Two results pixel by pixel; differences are A minus B. A and B are in one scale."
#: What is said of each result, and the attribute that knows it.
_ORIGIN = (
    ("Captured", "captured"),
    ("Rig", "rig"),
    ("Plan", "plan"),
    ("Calibration", "calibration_digest"),
    ("Verdict on its fit", "verdict"),
    ("Reconstructed by version", "version"),
)


@dataclass(frozen=True)
class PairMap:
    """A quantity of A and B, both of shape (rows, columns), with NaN where there is none."""

    name: str
    unit: str
    first: NDArray[np.floating[Any]]
    second: NDArray[np.floating[Any]]


def pair_page(
    names: tuple[str, str],
    attributes: tuple[Mapping[str, Any], Mapping[str, Any]],
    figures: Sequence[Verdict],
    maps: Sequence[PairMap],
) -> str:
    """Figures, origin and maps of A, B and A minus B; raises `StoreError` without the page's template."""
    rows = [
        (title, *(str(each.get(key, "–")) for each in attributes))
        for title, key in _ORIGIN
        if any(key in each for each in attributes)
    ]
    return render_page(
        "series.html.j2",
        title=f"{names[0]} compared with {names[1]}",
        note=_NOTE,
        verdicts=figures,
        plots=(),
        table=Table(("", f"A: {names[0]}", f"B: {names[1]}"), tuple(rows)),
        pictures_title="Where they differ",
        pictures=[picture for each in maps for picture in _pictures(each, names)],
    )


def _pictures(shown: PairMap, names: tuple[str, str]) -> list[ReportPicture]:
    # Side by side, so that both have the scale of all their values together.
    both = value_picture(
        np.hstack((shown.first, shown.second)), f"{shown.name} of A | B", " | ".join(names), shown.unit
    )
    difference = value_picture(
        shown.first - shown.second, f"{shown.name}, A − B", "", shown.unit, "RdBu_r", symmetric=True
    )
    return [both, difference]
