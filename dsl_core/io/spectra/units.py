"""What the words around a column say: the quantity, its unit, and the unit of the wavelengths."""

from __future__ import annotations

import re
from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import Floats, Quantity

_PREFIXES = (
    {"": 1.0, "p": 1e-12, "n": 1e-9, "m": 1e-3, "k": 1e3, "M": 1e6}
    | dict.fromkeys(("µ", "μ", "u", "micro"), 1e-6)
    | {"milli": 1e-3, "nano": 1e-9}
)
#: Power, then area and steradian somewhere behind it: "mW/m^2/sr/nm", "Wsr⁻¹m⁻²nm⁻¹", "W/(sr sqm nm)".
_POWER = re.compile(
    r"(?<![a-zA-Zµμ])(nano|micro|milli|[pnmµμukM]?)(?:W|[Ww]atts?)"
    r"(?:(?![a-zA-Z])|(?=(?:[cm]?m|sr)\^?\{?[-−⁻]))([^\n]{0,40})"
)
#: "m^2", "cm**2", "cm^{-2}", "sq cm", of an area in the unit that stands for ``{}``.
_AREA = r"(?<![a-zA-Z]){0}\s?(?:\^?\{{?[-−]?2\}}?|\*\*[-−]?2|²|⁻²)|sq ?{0}"
_SQUARE_CM, _SQUARE_MM = re.compile(_AREA.format("cm")), re.compile(_AREA.format("mm"))
_TEN = re.compile(r"(?:10\s?\^\s?\(?|10[eE]|1[eE])([-+−]?\d{1,2})\)?[ ·*×]{0,3}$")
_MICROMETRE = re.compile(
    r"(?<![a-zA-Z])(?:um|µm|μm|\\mu\s?m|micromet(?:er|re)s?|microns?)(?![a-zA-Z])", re.IGNORECASE
)
_NANOMETRE = re.compile(r"(?<![a-zA-Z])(?:nm|nanomet(?:er|re)s?)(?![a-zA-Z])", re.IGNORECASE)
_ANGSTROM = re.compile(r"(?<![a-zA-Z])(?:Å|angstr(?:o|ö)ms?)(?![a-zA-Z])", re.IGNORECASE)
#: The same in the title of the axis: "(A)" over another column names a sample.
_ANGSTROM_AXIS = re.compile(r"[(\[]A[)\]]")
_WAVENUMBER = re.compile(r"wave ?number|cm\s?(?:\^?-1|⁻¹)|1/cm", re.IGNORECASE)
#: What axes of spectra may count instead of wavelength, with the name of each.
_OTHER_AXES = (
    ("wavenumber", _WAVENUMBER),
    ("frequency", re.compile(r"frequency|\b[TPG]Hz\b", re.IGNORECASE)),
    ("energy", re.compile(r"\benergy\b|\beV\b", re.IGNORECASE)),
)
#: Percent as a unit: "99 % reflectance" names a white standard, "0-100 %" the values.
_PERCENT = re.compile(
    r"(?:(?<!\d)(?<!\d )|(?<![\d.])0 ?(?:-|–|\.\.+|…|to) ?100 ?)"
    r"(?:%|per ?cent(?!ile)|(?<![a-z])(?:pct|prozent|v\. ?h\.)(?![a-z]))"
    # Behind a quantity: a soil from 0 to 100 cm is called alike.
    r"|(?:\b[RTρ]|ance|grad|ivity|emission|factor|albedo) ?[\[(]0 ?(?:-|–|…|to) ?100[\])]",
    re.IGNORECASE,
)
#: The unit of spectrometers, which only a title has behind the number of a sample: "leaf 12 %R". A tile of
#: "12 % reflectance" or "20%reflectance" has that as its name.
_PERCENT_R = re.compile(r"(?<!\d)%(?: ?[RT]\b|refl|trans)", re.IGNORECASE)
_UNIT_LINE = re.compile(r"\W*(?:y[- ]?)?units?\b", re.IGNORECASE)
#: In the order in which they are tried; a unit of power decides before all of them.
_WORDS: tuple[tuple[Quantity, re.Pattern[str]], ...] = (
    ("irradiance", re.compile(r"irrad|\birr\b", re.IGNORECASE)),
    # As those of foods and soils are compared; they are steps between values, of whatever quantity.
    ("derivative", re.compile(r"derivativ|\bd ?[RA] ?/ ?d ?(?:λ|lambda|nm|wl)", re.IGNORECASE)),
    ("absorbance", re.compile(r"absorban[cz]|kubelka", re.IGNORECASE)),
    # "log(1/R)", "log10 (1 / R)", "A = -log10(R)".
    (
        "absorbance",
        re.compile(
            r"(?<![a-z])log(?:_?10|₁₀)? ?\(? ?1 ?/ ?[RT]\b|[-−–] ?log(?:_?10|₁₀)? ?\(? ?[RT]\b", re.IGNORECASE
        ),
    ),
    ("transmittance", re.compile(r"transmi", re.IGNORECASE)),
    ("reflectance", re.compile(r"reflect|reflekt|remission|albedo", re.IGNORECASE)),
    # Of reflectance, absorption may be said in passing, and samples are called "ABS" or "absorptive black":
    # these words say what is measured where they are all of a line but its label and unit.
    (
        "absorbance",
        re.compile(
            r"^\W*(?:(?:y\W?)?(?:axis|units?|label|quantity|mode|type)\W+)?"
            r"(?:Abs|OD|K/S|(?i:absorptions?|extin[ck]tion|optical density|optische dichte)"
            r"(?i: ?(?:coefficient|spectrum|a\.?u\.?))?)(?: ?[\[(][^\])\n]*[\])])?\W*$",
            re.MULTILINE,
        ),
    ),
    ("counts", re.compile(r"\bcounts?\b|\bDN\b|\bscope\b|digital number", re.IGNORECASE)),
    ("radiance", re.compile(r"radiance|strahldichte|\brad\b", re.IGNORECASE)),
)


def says_micrometres(words: str) -> bool:
    """Whether words name micrometres.

    >>> says_micrometres("wavelength (um)"), says_micrometres("humus")
    (True, False)
    """
    return bool(_MICROMETRE.search(words))


def quantity_of(title: str, around: str = "") -> tuple[Quantity, float, bool]:
    """The quantity of a column, the factor to shares or W/(sr m2 nm), and whether its unit is stated.

    ``title`` is what is written over the column, ``around`` the rest of the header, which decides where the
    title says nothing, and whose unit of the same quantity holds where the title has none.
    """
    found = _quantity(title, everywhere=True)
    if found[0] == "unstated":
        found = _quantity(around, everywhere=False)
    if found[2]:
        return found
    in_lines = (_of_line(line, found[0]) for line in around.split("\n"))
    # A date or a step may look like "0-1"; only what changes the values is taken from afar.
    return next((said for said in in_lines if said[0] == found[0] and said[1] != 1.0), found)


def _of_line(line: str, quantity: Quantity) -> tuple[Quantity, float, bool]:
    """The same of one line of a header, which may state the percentage of a quantity without its name."""
    said = _quantity(line, everywhere=False)
    is_share = quantity in ("reflectance", "transmittance")
    if is_share and said[0] == "unstated" and _UNIT_LINE.match(line) and _PERCENT.search(line):
        return quantity, 0.01, True
    return said


def _quantity(text: str, everywhere: bool) -> tuple[Quantity, float, bool]:
    unit = _POWER.search(text)
    if unit is not None and re.search(r"sr|ster", unit[2]):
        return "radiance", _to_radiance(text[: unit.start()], unit[1], unit[2]), True
    if unit is not None and re.search(r"/ ?\(?c?m|m\^?-?2|m²|m⁻²", unit[2]):
        return "irradiance", 1.0, True
    said_percent = everywhere and bool(_PERCENT.search(text) or _PERCENT_R.search(text))
    for quantity, words in _WORDS:
        found = words.search(text)
        # Headers of instruments say of a derivative that there is none.
        if found is None or (quantity == "derivative" and not everywhere):
            continue
        near = text if everywhere else text[found.start() : found.start() + 40].split("\n")[0]
        before = text[: found.start()].rpartition("\n")[2]
        is_share = quantity in ("reflectance", "transmittance")
        if is_share and (said_percent or _PERCENT.search(f"{before}{near}")):
            return quantity, 0.01, True
        return quantity, 1.0, is_share and bool(re.search(r"\[1(?:\.0)?\]|\(1\)|0 ?[-.…] ?1\b", near))
    if said_percent:
        return "reflectance", 0.01, True
    return "unstated", 1.0, False


def _to_radiance(before: str, prefix: str, behind: str) -> float:
    factor = _PREFIXES[prefix]
    factor *= 1e4 if _SQUARE_CM.search(behind) else 1e6 if _SQUARE_MM.search(behind) else 1.0
    if re.search(r"(?<![a-zA-Zµμn])m\s?(?:\^?-?3|³|⁻³)", behind):
        factor *= 1e-9
    elif _MICROMETRE.search(behind):
        factor *= 1e-3
    elif _ANGSTROM.search(behind):
        factor *= 10.0
    ten = _TEN.search(before)
    return factor * 10.0 ** int(ten[1].replace("−", "-")) if ten else factor


def to_nanometres(path: Path, given: Floats, title: str, around: str = "") -> Floats:
    """Wavelengths in nm; raises `CalibrationError` where the numbers contradict the stated unit."""
    least, most = float(given.min()), float(given.max())
    for axis, said in _OTHER_AXES:
        if said.search(title):
            raise CalibrationError(
                f"{path.name} is over {axis} ({least:g} to {most:g}); nanometres are needed. Export the"
                " spectrum over wavelength."
            )
    words = title if _NANOMETRE.search(title) or _MICROMETRE.search(title) else f"{title}\n{_spoken(around)}"
    if (_ANGSTROM.search(words) or _ANGSTROM_AXIS.search(title)) and most > 1500:
        return given / 10.0
    in_nm, in_um = bool(_NANOMETRE.search(words)), bool(_MICROMETRE.search(words))
    is_small = most < 50
    if (in_um and not is_small) or (in_nm and not in_um and is_small):
        raise CalibrationError(
            f"{path.name}: the wavelengths, {least:g} to {most:g}, are {'not ' if in_um else ''}micrometres,"
            f" but the header states {'micrometres' if in_um else 'nanometres'}. Export the spectrum in nm."
        )
    return given * 1e3 if is_small else given


def _spoken(around: str) -> str:
    """What a header says of the wavelengths, and not of anything else."""
    said = re.findall(r"(?:wavelength|lambda|λ|wvl)[^\n]{0,30}", around, re.IGNORECASE)
    return "\n".join(said)
