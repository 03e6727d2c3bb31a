"""A library of spectra: every reflectance in files and folders, in groups, with what was found odd told."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import read_bounded
from dsl_core.io.spectra.catalogue import format_of, suffixes
from dsl_core.io.spectra.records import Spectrum
from dsl_core.io.spectra.reference_file import as_references
from dsl_core.io.spectra.spectrum_file import of_kind
from dsl_core.model.spectral import SpectralCurve
from dsl_core.progress import NoProgress, Progress

#: How entries become classes: by their name without a number at its end, their folder, their file, or each
#: its own.
GROUPINGS = ("auto", "name", "folder", "file", "none")
#: A number that only tells entries of one name apart: "(12)", "_03", " 7", "#2".
_NUMBER = re.compile(r"(?:\s*\(\d+\)|[\s_#-]+\d{1,4})$")
#: The number that reading a file adds where one name occurs twice.
_REPEATED = re.compile(r"\s*\(\d+\)$")
#: More files than this are no library but a disk.
MOST_FILES = 5_000


@dataclass(frozen=True)
class Entry:
    """A spectrum of a library, with its name, its group and its file."""

    name: str
    group: str
    curve: SpectralCurve
    file: Path


@dataclass(frozen=True)
class SpectralLibrary:
    """Entries in the order of their files; ``notes`` say what was converted, left out or is doubtful."""

    entries: tuple[Entry, ...]
    notes: tuple[str, ...] = ()

    @property
    def groups(self) -> tuple[str, ...]:
        """The names of the groups, each once."""
        return tuple(dict.fromkeys(entry.group for entry in self.entries))


def read_library(
    paths: Sequence[Path],
    grouping: str = "auto",
    table: Path | None = None,
    progress: Progress | None = None,
) -> SpectralLibrary:
    """Read all reflectances of files and of folders with everything below them.

    ``grouping`` is one of `GROUPINGS`; "auto" takes the folder where there are several, and else the name,
    so that entries of one name are one class. A ``table`` (CSV with the columns ``name`` and ``group``)
    decides for the entries that it names. A file that cannot be read is left out with a note. Raises
    `CalibrationError` when nothing is left.
    """
    if grouping not in GROUPINGS:
        raise CalibrationError(f"Entries are grouped by {', '.join(GROUPINGS)}, not by {grouping!r}.")
    progress, notes = progress or NoProgress(), list[str]()
    files = _files(paths)
    found: list[tuple[str, SpectralCurve, Path]] = []
    for done, file in enumerate(files):
        progress.report("read the library", done, len(files))
        try:
            found += [(name, curve, file) for name, curve in _entries(file, notes.append)]
        except CalibrationError as error:
            notes.append(f"Left out: {error}")
    if not found:
        listed = ", ".join(str(path) for path in paths)
        because = f" {notes[0]}" if notes else " There is no file of a format that is read here."
        raise CalibrationError(f"There is no reflectance spectrum in {listed}.{because}")
    group_of = _grouped(grouping, [file for _, _, file in found], table)
    entries = (Entry(name, group_of(name, file), curve, file) for name, curve, file in found)
    return SpectralLibrary(tuple(entries), tuple(notes))


def _files(paths: Sequence[Path]) -> list[Path]:
    """Files to read: those named, and in folders all of a known ending; an ENVI header goes with its data."""
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise CalibrationError(f"There is no library {path}. Correct its path.")
        if path.is_file():
            files.append(path)
            continue
        inside = (each for each in sorted(path.rglob("*")) if each.is_file() and not _is_hidden(each, path))
        files += [each for each in inside if each.suffix.lower() in suffixes() and not _is_beside(each)]
        if len(files) > MOST_FILES:
            raise CalibrationError(
                f"{path} contains more than {MOST_FILES} files. Choose the folder of the spectra."
            )
    return list(dict.fromkeys(files))


def _is_hidden(file: Path, root: Path) -> bool:
    return any(part.startswith(".") for part in file.relative_to(root).parts)


def _is_beside(file: Path) -> bool:
    """Whether a file only describes, or is described by, another that is read."""
    return file.suffix.lower() == ".hdr" or file.name.lower() in ("groups.csv", "readme.txt")


def _entries(file: Path, note: Callable[[str], None]) -> list[tuple[str, SpectralCurve]]:
    kind = format_of(file)
    spectra = of_kind(file, raw := kind.read(file), radiance=False, all_unstated=True)
    spectra = _of_one_scale(file, raw, spectra, note)
    if len(spectra) == 1 and not kind.is_library:
        # The title over a single column is mostly "reflectance".
        spectra = [replace(spectra[0], name=file.stem)]
    content = as_references(file, spectra)
    if content.empty:
        note(f"{file.name}: without values and left out: {', '.join(content.empty[:5])}.")
    return [(reference.name, reference.curve) for reference in content.references]


def _of_one_scale(
    file: Path, raw: list[Spectrum], spectra: list[Spectrum], note: Callable[[str], None]
) -> list[Spectrum]:
    """Percentages told, and given as shares where another spectrum of the file shows that they are."""
    as_read = {id(each) for each in raw}
    percent = [each for each in spectra if id(each) not in as_read]
    if not percent:
        return spectra
    most = 100 * max(float(np.nanmax(each.values, initial=0.0)) for each in percent)
    note(f"{file.name}: values up to {most:.3g} are read as percent.")
    # A dark spectrum in percent looks like a share; its neighbours tell.
    return [
        Spectrum(each.name, each.nm, each.values * 0.01, each.quantity, True)
        if id(each) in as_read and not each.scaled
        else each
        for each in spectra
    ]


def _grouped(grouping: str, files: list[Path], table: Path | None) -> Callable[[str, Path], str]:
    named = {} if table is None else read_groups(table)
    if grouping == "auto":
        grouping = "folder" if len({file.parent for file in files}) > 1 else "repeated"

    def group_of(name: str, file: Path) -> str:
        if name in named:
            return named[name]
        match grouping:
            case "folder":
                return file.parent.name
            case "file":
                return file.stem
            case "none":
                return name
            case "repeated":
                return _REPEATED.sub("", name) or name
        return _NUMBER.sub("", name) or name

    return group_of


def read_groups(table: Path) -> dict[str, str]:
    """Groups by the names of entries, from a CSV file; raises `CalibrationError`."""
    import csv

    try:
        rows = list(csv.DictReader(read_bounded(table).decode("utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CalibrationError(f"The table of groups {table} cannot be read ({error}).") from error
    if not rows or not {"name", "group"} <= set(rows[0]):
        raise CalibrationError(
            f"{table.name} needs the columns 'name' and 'group' and at least one line. Add them."
        )
    return {row["name"]: row["group"] for row in rows if row["name"] and row["group"]}
