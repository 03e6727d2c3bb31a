"""What titles say of columns that hold no spectrum of their own: deviations, counters, wavelengths."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from dsl_core.io.spectra.records import Floats
from dsl_core.io.spectra.units import quantity_of

#: Words for columns that hold no spectrum of their own, wherever they stand in a title.
_BESIDE = re.compile(
    r"deviation|abweichung|uncertain|unsicherheit|variance|(?<!\()λ|wave ?(?:len|num)|wvl|wellenl"
    r"|\b(?:std ?(?:dev)?|st\.? ?dev|errors?|incertitude|sd|sem|flags?|wave|(?<!\()lambda)\b",
    re.IGNORECASE,
)
#: Words that say so where they are all of the title: "pixel 3" and "No. 2 blue" are spectra.
_COUNTER = re.compile(
    r"\W*(?:pixels?|chan(?:nels?)?|index|n[or]|id|row|zeile|#|cv|quality|detector|snr|fwhm|band ?widths?)?"
    r"(?: ?(?:n[or]|number|index))?(?:(?<=\w) ?[\[(](?:%|nm|1|-|d ?B)[\])])?\W*",
    re.IGNORECASE,
)
#: Signs of uncertainties in certificates: "U (k=2)", "u(R)", "U_c", "±". A sample may be called "U (blue)".
_UNCERTAINTY = re.compile(
    r"\W*(?:(?:±|\+/-).*|(?i:(?:expanded )?unc|err)\.?|[0-9]?(?:σ|sigma|sd)|[ΔδdD]R|CI ?\d*"
    r"|[Uu](?: ?c(?: ?\(.*)?| ?[\[(]?(?:95|%|k ?=|[Rrρβ]\b|rho|reflect).*))\W*",
    re.DOTALL,
)
#: Titles that are those of uncertainties where their values are small, and may be names of samples otherwise.
_SHORT = re.compile(r"\W*(?:s|se|rms|tolerance|precision)\W*", re.IGNORECASE)
#: Titles of a column that are uncertainties behind one of these, and may be names of samples without.
_SIGN, _OF_SIGN = re.compile(r"\W*[Uu]\W*"), re.compile(r"\W*(?:[RrTρβ]|rho)(?: ?\(.*\))?\W*")
#: Beside a single spectrum, what is everywhere below this share of it is its uncertainty.
SMALL = 0.2
#: Where words of a title meet that are written together: "refl_std", "leafStd".
_MEETING = re.compile(r"_|(?<=[a-z])(?=[A-Z])")


def is_beside(title: str) -> bool:
    """Whether a column's title says that it is no spectrum: a deviation, a pixel number, wavelengths.

    >>> is_beside("leaf_std"), is_beside("CV (%)"), is_beside("camouflage"), is_beside("No. 1 red")
    (True, True, False, False)
    >>> is_beside("U (k=2)"), is_beside("u(R)"), is_beside("U (blue)")
    (True, True, False)
    """
    words = _MEETING.sub(" ", title)
    return bool(
        _BESIDE.search(words)
        or _UNCERTAINTY.fullmatch(words)
        or (words.strip() and _COUNTER.fullmatch(words))
    )


def is_sign_beside(title: str, columns: Mapping[str, Floats]) -> bool:
    """Whether "U" is the uncertainty of another one of the ``columns`` rather than a sample of this name.

    >>> r, u = np.full(9, 0.5), np.full(9, 0.005)
    >>> is_sign_beside("U", {"R": r, "U": r}), is_sign_beside("U", {"T1": r, "V": r, "U": u})
    (True, False)
    >>> is_sign_beside("U", {"tile 7": r, "U": u}), is_sign_beside("U", {"S": r, "U": r})
    (True, False)
    """
    others = {name: values for name, values in columns.items() if name != title}
    if not others:
        return False
    if _SHORT.fullmatch(title):
        least = min(float(np.nanmedian(np.abs(values))) for values in others.values())
        return bool(np.nanmax(columns[title]) < SMALL * least)
    if not _SIGN.fullmatch(title):
        return False
    if any(_OF_SIGN.fullmatch(name) or quantity_of(name)[0] != "unstated" for name in others):
        return True
    (first, *more) = others.values()
    return not more and bool(np.nanmax(columns[title]) < SMALL * np.nanmedian(np.abs(first)))


def counts_rows(title: str, values: Floats) -> bool:
    """Whether a column counts its rows without a title, as tables of data frames do, or readings as "n"."""
    if title.strip().lower() == "n":
        return bool(np.all(values[np.isfinite(values)] % 1 == 0))
    return not title.strip() and values.size > 1 and bool(np.all(np.diff(values) == 1))
