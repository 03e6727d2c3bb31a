"""How much of a result is of which class: pixels, shares and areas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.classify import ClassMap


@dataclass(frozen=True)
class ClassRow:
    """One line of the table: a label, its value in the map, its pixels, their share of those judged, area.

    ``share`` is None for pixels that were not judged. ``area_mm2`` is of the pixels with a point; None where
    the result has none.
    """

    label: str
    value: int
    pixels: int
    share: float | None
    area_mm2: float | None


def class_table(shown: ClassMap, areas_mm2: NDArray[np.floating] | None = None) -> tuple[ClassRow, ...]:
    """A row for each class, also without pixels, then none of these, undecided and not judged."""
    size = len(shown.labels)
    pixels = np.bincount(shown.values.ravel(), minlength=size)
    judged = max(int(pixels[1:].sum()), 1)
    areas: NDArray[np.float64] | None = None
    if areas_mm2 is not None:
        areas = np.bincount(shown.values.ravel(), np.nan_to_num(areas_mm2.ravel()), size).astype(np.float64)
    return tuple(
        ClassRow(
            shown.labels[value],
            value,
            int(pixels[value]),
            float(pixels[value] / judged) if value else None,
            None if areas is None else float(areas[value]),
        )
        for value in (*range(1, size), 0)
    )
