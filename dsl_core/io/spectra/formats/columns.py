"""Text with wavelengths in a column or in a line, whatever surrounds it: the format of last resort."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import WAVELENGTHS_NM, Floats, Format, Quantity, Spectrum, content_of, rising
from dsl_core.io.spectra.text import MIN_ROWS, Table, cells_of, decoded, is_text, number_of, tables_of
from dsl_core.io.spectra.titles import counts_rows, is_beside, signs_beside
from dsl_core.io.spectra.units import quantity_of, says_micrometres, to_nanometres

#: Corrects what a format knows better than its titles say: column's title to quantity.
Known = Callable[[str], Quantity | None]
_WAVELENGTH = re.compile(
    r"wave ?l|wvl|\bwl\b|\bwave\b|wellenl|(?<![a-zρτΔδ(])(?<!\b[a-zρτ][ _])(?:lambda|λ)"
    r"|^\W?(?:nm|um|µm|μm)\W?$",
    re.IGNORECASE,
)
#: Lines in which the wavelengths of a table of lines are looked for.
MOST_HEADER = 300
#: How wavelengths are written over columns, in nm and in micrometres; what is before the number is the same.
_PREFIX = r"(?P<prefix>(?:[A-Za-z]{1,12}[_ ]?)?)"
_LABEL = re.compile(_PREFIX + r"(?P<number>\d{3,5}(?:\.\d+)?)(?: ?nm)?", re.IGNORECASE)
_LABEL_UM = re.compile(
    _PREFIX + r"(?P<number>\d{1,2}(?:\.\d*)?|\.\d+)(?P<unit> ?(?:um|µm|μm))?", re.IGNORECASE
)


def read_columns(path: Path) -> list[Spectrum]:
    """Every spectrum in a text; raises `CalibrationError`."""
    text = decoded(content_of(path))
    found = _in_lines(path, text) or [s for table in tables_of(path, text) for s in spectra_of(path, table)]
    if not found:
        raise CalibrationError(
            f"{path.name} contains no table of wavelengths and values with {MIN_ROWS} rows or more. Export"
            " the spectrum as text in two columns."
        )
    return found


def spectra_of(path: Path, table: Table, known: Known | None = None) -> list[Spectrum]:
    """The spectra of a table with wavelengths in one column or in several; raises `CalibrationError`.

    The values of a column belong to the nearest wavelengths before it, or behind it where these are last.
    """
    titles = table.titles
    columns = [i for i in range(len(titles)) if np.isfinite(table.cells[:, i]).any()]
    if len(columns) > 2:
        columns = [i for i in columns if not counts_rows(titles[i], table.cells[:, i])] or columns
    axes = [i for i in columns if _is_axis(titles[i])]
    if not axes:
        # Of "X, Y, X, Y", every X.
        axes = [i for i in columns if i == columns[0] or titles[i] == titles[columns[0]] != ""]
    values_of = [i for i in columns if i not in axes and not is_beside(titles[i])]
    signs = signs_beside([titles[i] for i in values_of], table.cells[:, values_of])
    values_of = [i for i, is_sign in zip(values_of, signs, strict=True) if not is_sign]
    # Of wavelengths in several units side by side, the first ones count.
    firsts = [i for i in axes if i - 1 not in axes]
    are_last = bool(values_of) and values_of[0] < firsts[0] and values_of[-1] < firsts[-1]
    spectra = []
    for first in firsts:
        own = [i for i in values_of if _axis_of(i, firsts, are_last) == first]
        # What the whole header says is of one column only where it is the only one.
        spectra += _over_axis(path, table, first, own, "" if len(values_of) > 1 else table.above, known)
    return spectra


def _axis_of(column: int, firsts: Sequence[int], are_last: bool) -> int:
    """The column of the wavelengths of a column of values; what is before all of them has the first ones."""
    if are_last:
        return next(each for each in firsts if each > column)
    return max((each for each in firsts if each < column), default=firsts[0])


def _is_axis(title: str) -> bool:
    """Whether a title is of wavelengths, and not of their deviations."""
    return bool(_WAVELENGTH.search(title)) and not is_beside(_WAVELENGTH.sub("", title))


def _over_axis(
    path: Path, table: Table, first: int, own: Sequence[int], above: str, known: Known | None
) -> list[Spectrum]:
    """The spectra in the columns ``own`` over the wavelengths in column ``first``."""
    titles, given = table.titles, table.cells[:, first]
    kept = np.isfinite(given)
    if not own or np.count_nonzero(kept) < MIN_ROWS:
        return []
    _require_no_lines(path, titles, titles[first], given[kept])
    nm = to_nanometres(path, given[kept], titles[first], table.header)
    spectra = []
    for i in own:
        values = table.cells[kept, i]
        if np.isfinite(values).any():
            around = above if titles[i] else table.header
            spectra.append(_spectrum(path, table.names[i], titles[i], around, nm, values, known))
    return spectra


def _spectrum(
    path: Path, name: str, title: str, around: str, nm: np.ndarray, values: np.ndarray, known: Known | None
) -> Spectrum:
    nm, values = rising(path, nm, values)
    own = known(title) if known is not None else None
    if own is not None:
        return Spectrum(name, nm, values, own)
    quantity, factor, is_scaled = quantity_of(title, around)
    return Spectrum(name, nm, values * factor, quantity, is_scaled)


@dataclass(frozen=True)
class _Labels:
    """Cells of a line, from ``start`` to before ``end``, that are wavelengths; ``nm`` has shape (cells,)."""

    start: int
    end: int
    nm: Floats

    @property
    def is_spectrum(self) -> bool:
        """Whether light can have the wavelengths, and they rise or fall."""
        steps, (low, high) = np.diff(self.nm), WAVELENGTHS_NM
        within = low <= self.nm.min() and self.nm.max() <= high
        return bool(within and (np.all(steps > 0) or np.all(steps < 0)))


def _in_lines(path: Path, text: str) -> list[Spectrum]:
    """Spectra of a text whose wavelengths stand over its columns, one spectrum a line."""
    lines = text.splitlines()
    for at, line in enumerate(lines[:MOST_HEADER]):
        cells = cells_of(line)
        found = _labels(cells, _LABEL)
        if found is None:
            found = _labels(cells, _LABEL_UM)
            # A row of values looks the same, where nothing says micrometres.
            if found is None or not _states_micrometres(cells, found):
                continue
        before = cells[: found.start]
        if not before or any(np.isfinite(number_of(cell)) for cell in before) or not found.is_spectrum:
            continue
        if _is_narrower(found, before, lines[at + 1 :]):
            continue
        header = "\n".join([*lines[:at], " ".join(before)])
        return [s for row in lines[at + 1 :] for s in _line(path, row, found, len(cells), header)]
    return []


def _is_narrower(found: _Labels, before: Sequence[str], rows: Sequence[str]) -> bool:
    """Whether a column before the labels is said to hold wavelengths, and its numbers span more than they do.

    Then the labels are numbers of samples, such as "S1001" to "S1008".
    """
    at = next((i for i, title in enumerate(before) if _WAVELENGTH.search(title)), None)
    if at is None:
        return False
    numbers = np.array([number_of(cells[at]) for cells in map(cells_of, rows) if len(cells) > at])
    given = _Labels(at, at + 1, numbers[np.isfinite(numbers)])
    return given.nm.size >= MIN_ROWS and given.is_spectrum and bool(np.ptp(given.nm) > np.ptp(found.nm))


def _labels(cells: Sequence[str], form: re.Pattern[str]) -> _Labels | None:
    """The longest run of cells of one form; None where it is no spectrum's."""
    best, start = (0, 0), 0
    found = [form.fullmatch(cell) for cell in cells]
    for i, label in enumerate(found):
        before = found[i - 1] if i else None
        if label is None or before is None or label["prefix"] != before["prefix"]:
            start = i
        if label is not None and i + 1 - start > best[1] - best[0]:
            best = start, i + 1
    if best[1] - best[0] < MIN_ROWS:
        return None
    numbers = np.array([float(label["number"]) for label in found[slice(*best)] if label is not None])
    return _Labels(*best, numbers * (1e3 if form is _LABEL_UM else 1.0))


def _states_micrometres(cells: Sequence[str], found: _Labels) -> bool:
    labels = [_LABEL_UM.fullmatch(cell) for cell in cells[found.start : found.end]]
    in_labels = all(label is not None and label["unit"] for label in labels)
    return in_labels or says_micrometres(" ".join(cells[: found.start]))


def _line(path: Path, row: str, labels: _Labels, width: int, header: str) -> list[Spectrum]:
    cells = cells_of(row)
    values = np.array([number_of(cell) for cell in cells[labels.start : labels.end]])
    if len(cells) > width or np.count_nonzero(np.isfinite(values)) < MIN_ROWS:
        return []
    values = np.concatenate([values, np.full(len(labels.nm) - len(values), np.nan)])
    before = cells[: labels.start]
    name = next((cell for cell in before if cell), "")
    return [_spectrum(path, name, " ".join(before), header, labels.nm, values, None)]


def _require_no_lines(path: Path, titles: Sequence[str], title: str, given: Floats) -> None:
    """Raise `CalibrationError` where titles look like wavelengths, and ``given`` like numbers of samples.

    They would pass for wavelengths, of as many spectra as there are bands.
    """
    found = _labels(titles, _LABEL) or _labels(titles, _LABEL_UM)
    if found is None or _WAVELENGTH.search(title):
        return
    # "1, 2, 3" over columns are numbers of samples.
    is_labelled = title and found.is_spectrum and any("." in each for each in titles[found.start : found.end])
    counts = given[0] < WAVELENGTHS_NM[0] and np.all(np.diff(given) == 1)
    if is_beside(title) or counts or is_labelled:
        raise CalibrationError(
            f"{path.name} seems to have wavelengths over its columns, from {titles[found.start]!r} to"
            f" {titles[found.end - 1]!r}, but not in nm, or not in order. Write them in nm over the values,"
            " or 'nm' over a column of wavelengths."
        )


FORMAT = Format(
    "text or CSV",
    (".csv", ".txt", ".tsv", ".dat", ".asc"),
    lambda path, head: is_text(head),
    read_columns,
)
