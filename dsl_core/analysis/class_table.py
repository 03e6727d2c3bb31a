"""How much of a result is of which class: pixels, shares and areas, with deviations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.area_deviation import ClassDeviations
from dsl_core.analysis.classify import ClassMap
from dsl_core.words import in_groups

#: Areas and their deviations from here on are told in whole mm2.
_LARGE_MM2, _LARGE_STD_MM2 = 100.0, 10.0


@dataclass(frozen=True)
class ClassRow:
    """One line of the table: a label, its value in the map, its pixels, their share of those judged, area.

    ``share`` is None for pixels that were not judged. ``area_mm2`` is of the pixels with a point, and of a
    class also half of what is beside it without a class, where its edge runs; None where the result has no
    points, NaN where no pixel of the class has a known area. Deviations are as `area_deviation` derives them,
    None where they are not known.
    """

    label: str
    value: int
    pixels: int
    share: float | None
    area_mm2: float | None
    pixels_std: float | None = None
    area_std_mm2: float | None = None
    share_std: float | None = None

    @property
    def share_text(self) -> str:
        """The share with its deviation; empty where pixels were not judged.

        >>> ClassRow("red", 1, 1308, 0.5, 98.04, 41.7, 3.04, 0.016).share_text
        '50.0 ± 1.6 %'
        """
        if self.share is None:
            return ""
        spread = None if self.share_std is None else 100 * self.share_std
        return f"{100 * self.share:.1f}{_deviation(spread, 1)} %"

    @property
    def pixels_text(self) -> str:
        """The pixels with their deviation.

        >>> ClassRow("red", 1, 1308, 0.5, 98.04, 41.7, 3.04).pixels_text.replace(chr(0xA0), "")
        '1308 ± 42'
        """
        return f"{in_groups(self.pixels)}{_deviation(self.pixels_std, 0)}"

    @property
    def area_text(self) -> str:
        """The area with its deviation, mm2, without its unit; a dash where there is none.

        >>> ClassRow("red", 1, 1308, 0.5, 98.04, 41.7, 3.04).area_text
        '98.0 ± 3.0'
        """
        if self.area_mm2 is None or math.isnan(self.area_mm2):
            return "–"
        spread = self.area_std_mm2
        # Without a deviation, edges of a large area are known to no tenth.
        digits = int((self.area_mm2 < _LARGE_MM2) if spread is None else spread < _LARGE_STD_MM2)
        return f"{in_groups(self.area_mm2, digits)}{_deviation(spread, digits)}"


def _deviation(std: float | None, digits: int) -> str:
    # A deviation below the last digit is no zero.
    return "" if std is None else f" ± {in_groups(max(std, 10.0**-digits), digits)}"


def class_table(
    shown: ClassMap,
    areas_mm2: NDArray[np.floating] | None = None,
    deviations: ClassDeviations | None = None,
) -> tuple[ClassRow, ...]:
    """A row for each class, also without pixels, then none of these, undecided and not judged."""
    size = len(shown.labels)
    pixels = np.bincount(shown.values.ravel(), minlength=size)
    judged = max(int(pixels[1:].sum()), 1)
    areas: NDArray[np.float64] | None = None
    if areas_mm2 is not None:
        areas = np.bincount(shown.values.ravel(), np.nan_to_num(areas_mm2.ravel()), size).astype(np.float64)
        if deviations is not None and deviations.beside_mm2 is not None:
            areas += deviations.beside_mm2
        measured = np.bincount(shown.values.ravel(), np.isfinite(areas_mm2).ravel(), size)
        areas[(pixels > 0) & (measured == 0)] = np.nan
    pixels_std, areas_std = (None, None) if deviations is None else (deviations.pixels, deviations.areas_mm2)
    return tuple(
        ClassRow(
            shown.labels[value],
            value,
            int(pixels[value]),
            float(pixels[value] / judged) if value else None,
            None if areas is None else float(areas[value]),
            _known(pixels_std, value),
            None if areas is None or np.isnan(areas[value]) else _known(areas_std, value),
            None if pixels_std is None or not value else _known(pixels_std / judged, value),
        )
        for value in (*range(1, size), 0)
    )


def _known(values: NDArray[np.float64] | None, value: int) -> float | None:
    return None if values is None or not np.isfinite(values[value]) else float(values[value])
