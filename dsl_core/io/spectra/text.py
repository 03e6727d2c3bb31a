"""Text of instruments: its encoding, and the tables of numbers in it with the words over their columns."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.records import MOST_NUMBER, Floats

#: Fewer rows of numbers are part of a header.
MIN_ROWS = 8
#: More cells are no spectra; they would fill the memory.
MOST_CELLS = 20_000_000
#: Rows that go on behind a remark do so within so many steps; farther on, another table begins.
MOST_GAP = 50
#: Empty lines and remarks, which may stand between rows.
_BETWEEN = re.compile(r"\W*|\s*(?:[#!%*]|//).*")
_NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)\b", re.IGNORECASE)
#: What programs write where there is no value.
_MISSING = re.compile(r"[-+]?nan|n/?a|n\. ?a\.?|#n/a|null|[-–—]+", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?")
_SEPARATOR = re.compile(r"[;\t|]")
_UNIT = re.compile(r"[\[(].*[\])]|nm|um|µm|μm|%|counts?|1|[nmµuk]?W[/·* ].*", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """Rows of numbers: ``cells`` (rows, columns) with NaN where there is none.

    ``titles`` has what stands over each column, units included, and ``names`` the same without a separate
    line of units; ``header`` is all text before the table, ``above`` what of it is above the titles, and
    ``lines`` has the number of each row's line.
    """

    header: str
    titles: tuple[str, ...]
    names: tuple[str, ...]
    cells: Floats
    lines: tuple[int, ...]
    above: str = ""


def decoded(content: bytes) -> str:
    """Text in UTF-8 or UTF-16, and in the alphabet of Western Windows where it is neither."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def is_text(content: bytes) -> bool:
    """Whether the beginning of a file can be text."""
    return content[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" not in content[:4096]


def cells_of(line: str) -> list[str]:
    """The cells of a line: by tabs, semicolons or bars, else by commas, else by spaces; quotes are taken off.

    With tabs, semicolons, bars, and between spaces where no other reading makes sense, a decimal comma
    becomes a point.
    """
    line = line.strip(" \r\n|")
    if _SEPARATOR.search(line):
        cells = [_pointed(cell) for cell in _SEPARATOR.split(line)]
    elif '"' in line and "," in line:
        cells = [_pointed(cell) for cell in _quoted(line)]
    else:
        words = line.split()
        if len(words) > 1 and "," in line and all(map(_is_pointed, words)):
            cells = [_pointed(word) for word in words]
        elif "," in line:
            cells = [cell.strip().strip('"') for cell in line.split(",")]
            apart = line.replace(",", " ").split()
            if any(" " in cell for cell in cells) and all(map(_NUMBER.fullmatch, apart)):
                cells = apart
        else:
            cells = [word.strip('"') for word in words]
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


def _pointed(cell: str) -> str:
    cell = cell.strip().strip('"').strip()
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell


def _is_pointed(word: str) -> bool:
    """Whether a word between spaces can be a number with a decimal comma, or says that there is none."""
    return bool(_DECIMAL_COMMA.fullmatch(word) or _MISSING.fullmatch(word))


def _quoted(line: str) -> list[str]:
    try:
        return next(csv.reader([line], skipinitialspace=True), [])
    except csv.Error:
        return line.split(",")


def tables_of(path: Path, text: str) -> list[Table]:
    """All tables of a text; raises `CalibrationError` for a number that is infinite."""
    tables: list[Table] = []
    header: list[str] = []
    rows: list[list[str]] = []
    numbers: list[int] = []
    sources: list[str] = []
    between: list[str] = []

    def end() -> None:
        nonlocal header, rows, numbers, sources, between
        if len(rows) >= MIN_ROWS:
            tables.append(_table(path, header, rows, numbers, sources[0]))
            header = between
        else:
            header += sources + between
        rows, numbers, sources, between = [], [], [], []

    for number, line in _lines(text):
        cells = cells_of(line)
        leading = _leading(cells)
        is_missing = (
            bool(rows) and len(cells) == leading + 1 and line.strip(" \r\n")[-1:] in (";", "\t", ",", "|")
        )
        if is_row(cells[leading:]) or (is_missing and _NUMBER.fullmatch(cells[-1])):
            # Numbers over the columns of values are titles, with nothing over the wavelengths.
            if (between and not _goes_on(rows, cells)) or (len(rows) == 1 and leading < _leading(rows[0])):
                end()
            between = []
            rows.append(cells)
            numbers.append(number)
            sources.append(line)
        elif rows and _BETWEEN.fullmatch(line):
            between.append(line)
        else:
            end()
            header.append(line)
    end()
    return tables


def _lines(text: str) -> list[tuple[int, str]]:
    """The lines with their numbers, without empty ones where these stand between all others."""
    lines = list(enumerate(text.rstrip().splitlines(), 1))
    given = [(number, line) for number, line in lines if line.strip()]
    return given if 3 * len(given) < 2 * len(lines) else lines


def _leading(cells: list[str]) -> int:
    """How many cells before the first one with anything in it are empty."""
    return next((i for i, cell in enumerate(cells) if cell), 0)


def _goes_on(rows: list[list[str]], cells: list[str]) -> bool:
    """Whether a row behind a remark belongs to the rows before it: its wavelength goes on as theirs do."""
    last = [*rows[-2:], cells]
    if len({len(row) for row in last}) > 1 or len(last) < 3:
        return False
    step, gap = np.diff([number_of(row[_leading(row)]) for row in last])
    return bool(0 < gap * step <= MOST_GAP * step**2)


def is_row(cells: list[str]) -> bool:
    """Whether a line is a row of a table: a number first, and another behind it or only missing ones."""
    if len(cells) < 2 or not _NUMBER.fullmatch(cells[0]):
        return False
    rest = cells[1:]
    return any(map(_NUMBER.fullmatch, rest)) or all(not cell or _MISSING.fullmatch(cell) for cell in rest)


def number_of(cell: str) -> float:
    """The number in a cell, NaN where there is none, or one that marks what was deleted."""
    number = float(cell) if _NUMBER.fullmatch(cell) else float("nan")
    return number if abs(number) < MOST_NUMBER else float("nan")


def _table(path: Path, header: list[str], rows: list[list[str]], numbers: list[int], first: str) -> Table:
    width = max(len(row) for row in rows)
    if width * len(rows) > MOST_CELLS:
        raise CalibrationError(
            f"{path.name} has a table of {len(rows)} rows and {width} columns; at most {MOST_CELLS} cells are"
            " read. Split the file."
        )
    cells = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        values = [number_of(cell) for cell in row]
        cells[i, : len(row)] = values
        if any(_NUMBER.fullmatch(cell) and math.isinf(float(cell)) for cell in row):
            raise CalibrationError(
                f"{path.name}, line {numbers[i]}: a value is infinite. Measure this spectrum"
                " again, or leave out the range that the instrument does not cover."
            )
    separator = ";" if _SEPARATOR.search(first.strip(" |")) else "," if "," in first else " "
    titles, names, above = _over(header, width, separator)
    return Table("\n".join(header), titles, names, cells, tuple(numbers), "\n".join(header[:above]))


def _over(header: list[str], width: int, separator: str) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """What stands over the columns, and how many lines above that.

    It is titles with units, and names; empty words where nothing stands there.
    """
    begins = max(len(header) - 6, 0)
    places = [i for i in range(begins, len(header)) if header[i].strip(" \t;,\r#|:=-")][::-1]
    found = [_fitting(header[i], width, separator) for i in places]
    nearest = found[0] if found else None
    if nearest is None:
        return ("",) * width, ("",) * width, len(header)
    above = found[1] if len(found) > 1 else None
    if above is not None and all(_UNIT.fullmatch(cell) for cell in nearest if cell):
        titles = tuple(f"{a} {b}".strip() for a, b in zip(above, nearest, strict=True))
        return titles, tuple(above), places[1]
    if above is not None and len(set(nearest)) < width and "" in above[:-1]:
        # One name over the two columns of each spectrum: its wavelengths and its values.
        return (
            tuple(nearest),
            tuple(cell or before for before, cell in zip(["", *above], above, strict=False)),
            places[1],
        )
    return tuple(nearest), tuple(nearest), places[0]


def _fitting(line: str, width: int, separator: str) -> list[str] | None:
    """The cells of a header's line if there is one for each column, but for an empty last one."""
    line = line.strip("# \r|")
    if separator == ";":
        readings = [_SEPARATOR.split(line)]
    elif separator == ",":
        readings = [_quoted(line)]
    else:
        readings = [re.split(r"\s{2,}|\t", line), re.findall(r'"[^"]*"|\S+', line)]
    for reading in readings:
        cells = [cell.strip().strip('"').strip() for cell in reading]
        while cells and not cells[-1]:
            cells.pop()
        if len(cells) > 1 and width - 1 <= len(cells) <= width and not is_row(cells):
            return cells + [""] * (width - len(cells))
    return None
