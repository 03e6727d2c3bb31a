"""How much of a result is of which class: pixels, shares and areas."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.classify import ClassMap

#: Told apart by the common kinds of colour blindness (P. Tol, "Colour schemes", 2021, bright and muted).
_FIRST = (
    "#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#ee7733", "#332288",
    "#44aa99", "#999933", "#882255", "#117733",
)  # fmt: skip
NOT_JUDGED_COLOUR, NONE_COLOUR, UNSURE_COLOUR = "#000000", "#777777", "#c8c8c8"
#: Each further hue lies as far as possible from those before it.
_GOLDEN = 0.61803398875


@dataclass(frozen=True)
class ClassRow:
    """One line of the table: a label, its colour, its pixels, their share of those judged, their area.

    ``area_mm2`` is of the pixels with a point; None where the result has none.
    """

    label: str
    colour: str
    pixels: int
    share: float
    area_mm2: float | None


def class_colours(count: int) -> tuple[str, ...]:
    """A colour for every value of a map with so many classes: not judged, the classes, none, undecided."""
    more = (_hue(index) for index in range(count - len(_FIRST)))
    return (NOT_JUDGED_COLOUR, *_FIRST[:count], *more, NONE_COLOUR, UNSURE_COLOUR)


def _hue(index: int) -> str:
    red, green, blue = colorsys.hsv_to_rgb(index * _GOLDEN % 1, 0.75, (0.95, 0.6, 0.78)[index % 3])
    return f"#{round(red * 255):02x}{round(green * 255):02x}{round(blue * 255):02x}"


def class_table(shown: ClassMap, areas_mm2: NDArray[np.floating] | None = None) -> tuple[ClassRow, ...]:
    """A row for each class, also without pixels, then none of these, undecided and not judged."""
    size = len(shown.labels)
    pixels = np.bincount(shown.values.ravel(), minlength=size)
    judged = max(int(pixels[1:].sum()), 1)
    areas: NDArray[np.float64] | None = None
    if areas_mm2 is not None:
        areas = np.bincount(shown.values.ravel(), np.nan_to_num(areas_mm2.ravel()), size).astype(np.float64)
    colours = class_colours(len(shown.names))
    return tuple(
        ClassRow(
            shown.labels[value],
            colours[value],
            int(pixels[value]),
            float(pixels[value] / judged) if value else 0.0,
            None if areas is None else float(areas[value]),
        )
        for value in (*range(1, size), 0)
    )
