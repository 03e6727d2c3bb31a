"""First answers from a result: which material, of which area, of which colour."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from dsl_core.api import FilePath, path_of
from dsl_core.api.places import Place, as_array, masks_of, require_picture
from dsl_core.errors import DecodeError
from dsl_core.model.attributes import stated_band_width_nm
from dsl_core.model.result_order import with_axes
from dsl_core.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

    from dsl_core.analysis.classes import SpectralClass


def classify(
    result: xr.Dataset,
    library: FilePath | Sequence[FilePath] | None = None,
    pins: Mapping[str, Place] | None = None,
    *,
    measure: Literal["probability", "angle", "rmse"] = "probability",
    worst: float | None = None,
    margin: float | None = None,
    brightness: Literal["stated", "free"] = "stated",
    grouping: str = "auto",
    library_error: float = 0.0,
    range_nm: tuple[float, float] | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Name the material of every pixel, with classes from a ``library``, from ``pins``, or from both.

    ``library`` is a file or folder of spectra (or several); ``pins`` says by name where known materials are:
    a mask, a pixel (x, y), or x, y, width and height. ``worst`` is, for the probability, the share of the
    pixels of a class that may be called "none of these" (0.01), else the largest angle (rad) or difference;
    ``margin`` the least probability of the class (0.95), else by which share the second must be worse.
    ``brightness`` "free" compares shapes alone. ``library_error`` is the standard deviation of the library's
    spectra as a share of reflectance, such as 0.02 where another instrument measured them.

    The dataset holds ``class`` (y, x), an index into the coordinate ``label``, ``fit`` and ``margin`` (y, x),
    and for each label ``pixels`` and ``area_mm2``, with ``pixels_std`` and ``area_std_mm2``; the attribute
    ``notes`` lists bands left out as no pixel has them, what was converted or left out of the library, and
    why areas are NaN. Raises `CalibrationError` for a library without usable spectra and `DecodeError` for
    places without spectra, a result that has none, or a measure or brightness that there is not.
    """
    import xarray as xr

    from dsl_core.analysis.classes import classes_of_library, known_classes
    from dsl_core.analysis.classification import (
        classes_of_masks,
        classify_result,
        with_known_bands,
        within_nm,
    )
    from dsl_core.analysis.classify import Brightness, Limits, Measure
    from dsl_core.analysis.library import read_library
    from dsl_core.analysis.places import require_spectra

    _require_choice("measure", measure, [each.value for each in Measure])
    _require_choice("brightness", brightness, get_args(Brightness))
    require_picture(result)
    require_spectra(result)
    result = with_axes(result)
    masks = {} if pins is None else masks_of(result, pins)
    if library is None and not masks:
        raise DecodeError("There is nothing to compare with. Give a library of spectra, pins, or both.")
    if range_nm is not None:
        result = within_nm(result, *_range(range_nm))
    result, missing = with_known_bands(result)
    classes: list[SpectralClass] = []
    notes: list[str] = list(missing)
    if library is not None:
        paths = [library] if not isinstance(library, Sequence) or isinstance(library, str) else library
        read = read_library([path_of(path) for path in paths], grouping, progress=progress)
        nm = result["wavelength_nm"].values
        width_nm = stated_band_width_nm(result.attrs, nm)
        found, left_out = classes_of_library(read, nm, library_error, width_nm)
        classes += found
        notes += [*read.notes, *left_out]
    if masks:
        classes += classes_of_masks(result, masks)
    chosen = Measure(measure)
    limits = Limits.chosen(chosen, worst, margin)
    known, doubts = known_classes(classes, result.get("reflectance_std"))
    notes = [*doubts, *notes]
    made = classify_result(result, known, chosen, limits, brightness, progress)
    over = ("y", "x")
    rows = {row.label: row for row in made.rows}
    labels = list(made.shown.labels)
    variables: dict[str, Any] = {
        "class": (over, made.shown.values),
        "fit": (over, made.scores.fit),
        "margin": (over, made.scores.margin),
        "pixels": ("label", [rows[label].pixels for label in labels]),
    }
    if made.rows[0].area_mm2 is not None:
        variables["area_mm2"] = ("label", [rows[label].area_mm2 for label in labels], {"units": "mm2"})
    if made.rows[0].pixels_std is not None:
        variables["pixels_std"] = ("label", [_or_nan(rows[label].pixels_std) for label in labels])
    if made.rows[0].area_std_mm2 is not None:
        stds = [_or_nan(rows[label].area_std_mm2) for label in labels]
        variables["area_std_mm2"] = ("label", stds, {"units": "mm2"})
    coords = {"label": labels, "y": result["y"], "x": result["x"]}
    return xr.Dataset(variables, coords=coords, attrs={"method": made.method, "notes": [*made.notes, *notes]})


def _require_choice(name: str, given: object, choices: Sequence[str]) -> None:
    if given not in choices:
        raise DecodeError(f"The {name} of a classification is {' or '.join(choices)}, not {given!r}.")


def _range(given: object) -> tuple[float, float]:
    values = as_array(given)
    if values.shape != (2,) or values.dtype.kind not in "iuf":
        raise DecodeError(f"range_nm is two wavelengths in nm, such as (450, 650); given {given!r}.")
    return float(values[0]), float(values[1])


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value


def colours(
    result: xr.Dataset,
    pins: Mapping[str, Place],
    lights: str | Sequence[str] = ("A", "D50", "D65", "FL11", "LED-B3"),
    reference: str | None = None,
) -> xr.Dataset:
    """CIELAB of places under CIE illuminants, and CIEDE2000 to one of them, each with its deviation.

    ``pins`` says by name where: a mask, a pixel (x, y), or x, y, width and height. The dataset holds ``lab``
    and ``lab_std`` (place, light, component) relative to the perfect diffuser, and, with a ``reference``,
    ``delta_e`` and ``delta_e_std`` (place, light). Raises `DecodeError` for unknown lights or names, and for
    places without spectra.
    """
    import xarray as xr

    from dsl_core.analysis.colours import colours_of
    from dsl_core.analysis.places import correlation_of_bands, spectra_of_masks

    require_picture(result)
    result, lights = with_axes(result), _names_of_lights(lights)
    spectra = spectra_of_masks(result, masks_of(result, pins))
    nm, together = result["wavelength_nm"].values, correlation_of_bands(result)
    found = colours_of(spectra, nm, lights, reference, together)
    shape = (len(lights), len(spectra))
    over = ("light", "place")
    variables: dict[str, Any] = {
        name: ((*over, "component"), np.array([getattr(c, name) for c in found]).reshape(*shape, 3))
        for name in ("lab", "lab_std")
    }
    if reference is not None:
        for name in ("delta_e", "delta_e_std"):
            values = [getattr(c, name) or 0.0 for c in found]
            variables[name] = (over, np.array(values).reshape(shape))
    coords = {"light": lights, "place": list(spectra), "component": ["L*", "a*", "b*"]}
    return xr.Dataset(variables, coords=coords).transpose("place", "light", ...)


def _names_of_lights(given: object) -> list[str]:
    found = [given] if isinstance(given, str) or not isinstance(given, Iterable) else list(given)
    names = [each for each in found if isinstance(each, str)]
    if not names or len(names) < len(found):
        raise DecodeError(f"Lights are given by names, one or several, such as 'D65'; given {given!r}.")
    return names
