"""What titles say of columns that hold no spectrum of their own: deviations, counters, wavelengths."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from dsl_core.io.spectra.records import Floats
from dsl_core.io.spectra.units import quantity_of

#: Words for columns that hold no spectrum of their own, wherever they stand in a title; "L_λ" and "R(λ)" are
#: spectra, and "Δλ" is not.
_BESIDE = re.compile(
    r"deviation|abweichung|uncertain|unsicherheit|variance|wave ?(?:len|num)|wvl|wellenl"
    r"|(?<![(a-ce-zρτ])(?<!\b[a-zρτ] )λ|(?<!\()(?<!\b[a-zρτ] )\blambda\b"
    r"|\b(?:std ?(?:dev)?|st\.? ?dev|errors?|incertitude|sd|sem|flags?|wave)\b",
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
    r"\W*(?:(?:±|\+/-).*|(?i:(?:expanded )?unc|err)\.?|[0-9]?(?:σ|sigma|sd)|[Δδ]R|CI ?(?:80|9[059])"
    r"|[Uu](?: c(?: ?\(.*)?| ?c ?\(.*| ?[\[(](?:95|[Rrρβ]\b).*| ?[\[(]?(?:%|k ?=|[ρβ]\b|rho|reflect).*"
    r"| ?95 ?%.*))\W*",
    re.DOTALL,
)
#: Titles that are those of uncertainties where their values are small, and may be names of samples otherwise,
#: as of quarters ("SE", "UR" of upper right) and pigments.
_SHORT = re.compile(r"\W*(?:(?i:s|se|rms|tolerance|precision)|[dD]R|CI|[Uu](?:c|C| ?[Rr]| ?95)?)\W*")
#: Those of them that are uncertainties of any size where all others are quantities, such as these letters.
_SIGN = re.compile(r"\W*(?:[dD]R|[Uu](?:c|C| ?[Rr]| ?95)?)\W*")
_OF_SIGN = re.compile(r"\W*(?:[RrTρβ]|rho)(?: ?\(.*\))?\W*")
#: What is everywhere below this share of the spectrum before it is its uncertainty.
SMALL = 0.2
#: Where words of a title meet that are written together: "refl_std", "leafStd".
_MEETING = re.compile(r"_|(?<=[a-z])(?=[A-Z])")


def is_beside(title: str) -> bool:
    """Whether a column's title says that it is no spectrum: a deviation, a pixel number, wavelengths.

    >>> is_beside("leaf_std"), is_beside("CV (%)"), is_beside("camouflage"), is_beside("No. 1 red")
    (True, True, False, False)
    >>> is_beside("U (k=2)"), is_beside("u(R)"), is_beside("U (blue)"), is_beside("CI 77491")
    (True, True, False, False)
    """
    words = _MEETING.sub(" ", title)
    return bool(
        _BESIDE.search(words)
        or _UNCERTAINTY.fullmatch(words)
        or (words.strip() and _COUNTER.fullmatch(words))
    )


def signs_beside(titles: Sequence[str], cells: Floats) -> list[bool]:
    """Which columns are uncertainties of others, by a short title that may be the name of a sample as well.

    ``cells`` are (rows, columns). Each sample has its own uncertainty behind it: of a sample whose neighbour
    has none, neither is known of others, and all are samples. Behind all of them, in small letters, it is
    that of each.

    >>> r = np.full(9, 0.5)
    >>> signs_beside(["R", "U"], np.stack([r, r], 1)), signs_beside(["A", "s"], np.stack([r, r / 99], 1))
    ([False, True], [False, True])
    >>> signs_beside(["UL", "UR", "LL"], np.stack([r, r / 99, r], 1))
    [False, False, False]
    """
    shorts = [bool(_SHORT.fullmatch(title)) for title in titles]
    samples = [title for title, short in zip(titles, shorts, strict=True) if not short]
    if not samples:
        return [False] * len(titles)
    are_stated = all(_OF_SIGN.fullmatch(each) or quantity_of(each)[0] != "unstated" for each in samples)
    # The sample that each column belongs to.
    of = np.maximum.accumulate([-1 if short else i for i, short in enumerate(shorts)])
    places = np.flatnonzero(~np.array(shorts))
    each_has = not shorts[0] and all(np.count_nonzero(of == i) > 1 for i in places)

    def is_sign(i: int) -> bool:
        if are_stated and _SIGN.fullmatch(titles[i]):
            return True
        is_last = titles[i].islower() and of[i] == places[-1]
        own = [of[i]] if each_has else places if is_last else []
        return len(own) > 0 and all(_is_small(cells[:, i], cells[:, at]) for at in own)

    return [short and is_sign(i) for i, short in enumerate(shorts)]


def _is_small(values: Floats, beside: Floats) -> bool:
    return bool(np.nanmax(values) < SMALL * np.nanmedian(np.abs(beside)))


def counts_rows(title: str, values: Floats) -> bool:
    """Whether a column counts its rows without a title, as tables of data frames do, or readings as "n"."""
    if title.strip().lower() == "n":
        return bool(np.all(values[np.isfinite(values)] % 1 == 0))
    return not title.strip() and values.size > 1 and bool(np.all(np.diff(values) == 1))
