"""What all exporters share: names of bands, what must be there, and where the data come from."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.model.fit import ATTRIBUTE, Fit
from dsl_core.model.result_order import wavelengths_of, without_missing_bands
from dsl_core.optics.colour import reflectance_to_srgb
from dsl_core.version import __version__

if TYPE_CHECKING:
    import xarray as xr


def require(result: xr.Dataset, format_name: str, *names: str) -> None:
    """Raise `StoreError` when the result lacks a variable that a format cannot do without."""
    missing = [name for name in names if name not in result.variables]
    if missing:
        has = ", ".join(str(name) for name in result.data_vars) or "nothing"
        raise StoreError(
            f"{format_name} needs {' and '.join(missing)}, but the result contains only {has}."
            " Reconstruct the scan completely, or choose another format."
        )


def require_suffix(path: Path, *suffixes: str) -> None:
    """Raise `StoreError` when a path does not end as other programs expect of the format."""
    if path.suffix.lower() not in suffixes:
        raise StoreError(
            f"{path.name!r} does not end in {' or '.join(suffixes)}. Add the ending to the name."
        )


def plane(result: xr.Dataset, name: str) -> NDArray[np.float32]:
    """A variable as float32, dimensions as in the result; NaN where there is no answer."""
    return np.asarray(result[name].values, np.float32)


def colours(result: xr.Dataset) -> NDArray[np.float32] | None:
    """Colours in sRGB (3, rows, columns): those of the result, else of its spectra, as the window shows."""
    if "rgb" in result:
        return plane(result, "rgb")
    if "reflectance" in result:
        result = without_missing_bands(result)
        return reflectance_to_srgb(plane(result, "reflectance"), np.array(wavelengths_nm(result)))
    return None


def wavelengths_nm(result: xr.Dataset) -> list[float]:
    """Band centres of the result; raises `StoreError` where a band has none of its own."""
    return [float(nm) for nm in wavelengths_of(result)]


def provenance(result: xr.Dataset) -> dict[str, str]:
    """Where a result comes from, as `provenance_of` says it."""
    return provenance_of({str(key): value for key, value in result.attrs.items()})


def provenance_of(attributes: Mapping[str, Any]) -> dict[str, str]:
    """Every plain attribute of a result as text, and the version of the program that exports.

    What the result says about its model is there in words, not as the record that programs read.
    """
    plain = {
        key: " ".join(str(value).split())
        for key, value in attributes.items()
        if isinstance(value, str | int | float | np.number)
    }
    fit = Fit.read(plain)
    if fit is not None:
        del plain[ATTRIBUTE]
        plain["verdict"] = " ".join(fit.words.split())
    return {**plain, "exported_by": f"dsl-scan {__version__}"}


#: What letters without an accent to take off, and signs, are written as in ASCII.
_IN_ASCII = str.maketrans(
    {"ß": "ss", "æ": "ae", "ø": "o", "ł": "l", "−": "-", "–": "-", "×": "x", "±": "+-", "µ": "u", "μ": "u"}
)


def ascii_text(text: str) -> str:
    """Text for headers that know only ASCII, without accents; other characters become ``?``.

    >>> ascii_text("groß, Blätter, 5 × 3 µm, 葉")
    'gross, Blatter, 5 x 3 um, ?'
    """
    parts = unicodedata.normalize("NFKD", text.translate(_IN_ASCII))
    plain = "".join(each for each in parts if not unicodedata.combining(each))
    return plain.encode("ascii", "replace").decode("ascii")
