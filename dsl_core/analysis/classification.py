"""Class maps of results: classes from a library or from what is marked, limits, areas, and words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.analysis.area_deviation import class_deviations, not_judged
from dsl_core.analysis.areas import Cube, Places, depth_relative_std, pixel_areas_mm2
from dsl_core.analysis.class_table import ClassRow, class_table
from dsl_core.analysis.classes import FEWEST_BANDS, SpectralClass, class_of_pixels, without_missing
from dsl_core.analysis.classify import Brightness, ClassMap, Limits, Measure, Scores, score
from dsl_core.analysis.places import Mask, require_spectra
from dsl_core.errors import DecodeError
from dsl_core.io.export.class_map import (
    Classified,
    export_class_envi,
    export_class_ply,
)
from dsl_core.io.export.common import require_suffix
from dsl_core.io.export.table import export_table
from dsl_core.model.result_order import columns_and_rows_px, known_bands
from dsl_core.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

#: Why no pixel has an area.
NO_AREAS = (
    "Areas are not known: the pixels that have a point are none, or lie on one line, which does not say how"
    " far apart lines of sight are. Classify a part that is at least two pixels wide and high."
)
#: Share of pixels that were not judged which is told, and how.
MANY_UNJUDGED = 0.05
UNJUDGED = "{:.0%} of the pixels were not judged (poor fit, saturated or too dark): classes may be larger."
#: The endings that a class map is written with, and what is written.
ENDINGS = {".hdr": "ENVI classification", ".ply": "points with their class", ".csv": "table of areas"}


@dataclass(frozen=True)
class PixelAreas:
    """Area of each pixel, mm2, and the deviation of its depth as a share of it, (rows, columns)."""

    mm2: NDArray[np.float64]
    depth_relative_std: NDArray[np.float64] | None = None

    @classmethod
    def of(
        cls,
        points_mm: Cube | None,
        normals: Cube | None = None,
        depth_std_mm: Cube | None = None,
        places_px: Places = (None, None),
    ) -> PixelAreas | None:
        """The areas of points (3, rows, columns), as by `pixel_areas_mm2`; None without points."""
        if points_mm is None:
            return None
        mm2 = pixel_areas_mm2(points_mm, normals, places_px)
        return cls(mm2, depth_relative_std(points_mm, depth_std_mm))


@dataclass(frozen=True)
class Classification:
    """Scores, the map under limits, and its table."""

    scores: Scores
    limits: Limits
    shown: ClassMap
    rows: tuple[ClassRow, ...]
    brightness: Brightness
    areas: PixelAreas | None = None

    @classmethod
    def of(
        cls,
        scores: Scores,
        limits: Limits | None = None,
        brightness: Brightness = "stated",
        areas: PixelAreas | None = None,
    ) -> Classification:
        """The map of scores under limits, with the areas of its pixels."""
        limits = limits or Limits.usual(scores.measure)
        shown = ClassMap.of(scores, limits)
        mm2, by_depth = (None, None) if areas is None else (areas.mm2, areas.depth_relative_std)
        table = class_table(shown, mm2, class_deviations(scores, shown, mm2, by_depth))
        return cls(scores, limits, shown, table, brightness, areas)

    def under(self, limits: Limits) -> Classification:
        """The same scores under other limits, in milliseconds."""
        return Classification.of(self.scores, limits, self.brightness, self.areas)

    @property
    def method(self) -> str:
        """How the map came about, in a sentence."""
        return method_in_words(self.scores.measure, self.limits, self.brightness)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not known of the classes and their areas, and why; empty where all is."""
        mm2 = None if self.areas is None else self.areas.mm2
        if mm2 is not None and not np.isfinite(mm2).any():
            return (NO_AREAS,)
        all_pixels = self.shown.values.size if mm2 is None else int(np.isfinite(mm2).sum())
        share = np.count_nonzero(not_judged(self.shown, mm2)) / max(all_pixels, 1)
        return (UNJUDGED.format(share),) if share > MANY_UNJUDGED else ()


def method_in_words(measure: Measure, limits: Limits, brightness: Brightness) -> str:
    """How a map came about, in a sentence.

    >>> method_in_words(Measure.ANGLE, Limits(0.1, 0.1), "stated")
    'spectral angle: at most 0.1 rad, the second class at least 10 % worse'
    """
    if measure is Measure.PROBABILITY:
        level = "with any brightness" if brightness == "free" else "brightness as stated"
        return (
            f"probability by the stated deviations, {level}: at most {limits.worst:.3g} of the pixels of a"
            f" class are called none of these, probability of the class at least {limits.margin:.3g}"
        )
    name, unit = ("spectral angle", " rad") if measure is Measure.ANGLE else ("root mean square", "")
    return (
        f"{name}{' difference' * (not unit)}: at most {limits.worst:.3g}{unit}, the second class at least"
        f" {limits.margin * 100:.3g} % worse"
    )


def classify_result(
    result: xr.Dataset,
    classes: Sequence[SpectralClass],
    measure: Measure = Measure.PROBABILITY,
    limits: Limits | None = None,
    brightness: Brightness = "stated",
    progress: Progress | None = None,
) -> Classification:
    """The class map of a result; raises `DecodeError` for a result without spectra or unfitting classes."""
    require_spectra(result)
    names = ("reflectance", "reflectance_std", "data_share")
    values, std, share = (result[name].values if name in result else None for name in names)
    assert values is not None
    flags = result["flags"].values if "flags" in result else np.zeros(values.shape[1:], np.uint16)
    nm = result["wavelength_nm"].values
    scores = score(values, std, share, flags, classes, measure, brightness, progress, nm)
    return Classification.of(scores, limits, brightness, areas_of(result))


def within_nm(result: xr.Dataset, low_nm: float, high_nm: float) -> xr.Dataset:
    """The result with its bands between two wavelengths only; raises `DecodeError` where fewer than 3 are."""
    require_spectra(result)
    if high_nm < low_nm:
        raise DecodeError(f"The range goes from {low_nm:g} down to {high_nm:g} nm. Give its lower end first.")
    nm = result["wavelength_nm"].values
    kept = np.flatnonzero((nm >= low_nm) & (nm <= high_nm))
    if len(kept) < FEWEST_BANDS:
        raise DecodeError(
            f"Only {len(kept)} bands of the result are between {low_nm:g} and {high_nm:g} nm; its bands"
            f" reach from {nm[0]:g} to {nm[-1]:g} nm. Give a wider range."
        )
    return result.isel(wavelength_nm=kept)


def with_known_bands(result: xr.Dataset) -> tuple[xr.Dataset, tuple[str, ...]]:
    """The result with the bands that any pixel has, and a note on others; raises `DecodeError`."""
    require_spectra(result)
    known = known_bands(result["reflectance"].values)
    notes = without_missing(result["wavelength_nm"].values, known)
    return (result.isel(wavelength_nm=np.flatnonzero(known)) if notes else result), notes


def areas_of(result: xr.Dataset) -> PixelAreas | None:
    """Areas of the pixels; None for a result without points."""
    names = ("points_mm", "normals", "depth_std_mm")
    points_mm, normals, std_mm = (result[name].values if name in result else None for name in names)
    return PixelAreas.of(points_mm, normals, std_mm, columns_and_rows_px(result))


def classes_of_masks(result: xr.Dataset, masks: Mapping[str, Mask]) -> tuple[SpectralClass, ...]:
    """A class for each marked place by its name; raises `DecodeError`."""
    require_spectra(result)
    if "reflectance_std" not in result:
        raise DecodeError("The result states no deviations. Reconstruct the scan again.")
    reflectance, std = result["reflectance"].values, result["reflectance_std"].values
    flags = result["flags"].values if "flags" in result else None
    return tuple(class_of_pixels(name, reflectance, std, mask, flags) for name, mask in masks.items())


def write_classification(
    result: xr.Dataset, found: Classification, path: Path, *, overwrite: bool = False
) -> list[Path]:
    """Write the map as the ending of the path says, one of `ENDINGS`; raises `StoreError`."""
    require_suffix(path, *ENDINGS)
    shown = found.shown
    colours = shown.palette()
    if path.suffix.lower() == ".csv":
        figures = ("pixels", "share_of_judged", "area_mm2", "pixels_std", "area_std_mm2", "share_std")
        header = ("class", "colour", *figures)
        rows = [
            (
                *(r.label, colours[r.value], r.pixels, r.share, r.area_mm2),
                *(r.pixels_std, r.area_std_mm2, r.share_std),
            )
            for r in found.rows
        ]
        return export_table(result, header, rows, {"method": found.method}, path, overwrite=overwrite)
    scores = found.scores
    made = Classified(shown.values, shown.labels, colours, scores.fit, scores.margin, found.method)
    if path.suffix.lower() == ".ply":
        return export_class_ply(result, made, path, overwrite=overwrite)
    return export_class_envi(result, made, path, overwrite=overwrite)
