"""A library of spectra: every reflectance in files and folders, in groups, with what was found odd told."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dsl_core.errors import CalibrationError
from dsl_core.io.reading import read_bounded
from dsl_core.io.spectra.catalogue import format_of, suffixes
from dsl_core.io.spectra.formats.one_column import describes_others
from dsl_core.io.spectra.formats.own_table import BY_PLACE
from dsl_core.io.spectra.reference_file import as_references, shares_of
from dsl_core.model.spectral import SpectralCurve
from dsl_core.progress import NoProgress, Progress
from dsl_core.words import readable

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

    ``grouping`` is one of `GROUPINGS`; "auto" takes the subfolder, and for what is in none the name, so
    that entries of one name are one class. A ``table`` (CSV with the columns ``name`` and ``group``)
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
    group_of = _grouped(grouping, paths, [file for _, _, file in found], table)
    entries = tuple(Entry(name, group_of(name, file), curve, file) for name, curve, file in found)
    if grouping in ("auto", "none"):
        notes += _of_several_files(entries)
    return SpectralLibrary(entries, tuple(notes))


def _of_several_files(entries: Sequence[Entry]) -> list[str]:
    """A note on groups that only a name has brought together from several files."""
    files_of: dict[str, set[Path]] = {}
    for entry in entries:
        if entry.group == _REPEATED.sub("", entry.name) != entry.file.parent.name:
            files_of.setdefault(entry.group, set()).add(entry.file)
    met = [f"{group} ({len(files)} files)" for group, files in files_of.items() if len(files) > 1]
    listed = ", ".join(met[:5]) + (" and more" if len(met) > 5 else "")
    return [f"Each is one class, since the names are the same: {listed}. Group by file if not."] * bool(met)


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
    is_note = file.suffix.lower() == ".hdr" or file.name.lower() in ("groups.csv", "readme.txt")
    return is_note or describes_others(file)


def _entries(file: Path, note: Callable[[str], None]) -> list[tuple[str, SpectralCurve]]:
    kind = format_of(file)
    spectra, as_percent, notes = shares_of(file, kind.read(file))
    for each in notes:
        note(f"{file.name}: {each}")
    if as_percent is not None:
        note(f"{file.name}: values up to {as_percent:.3g} are read as percent.")
    if len(spectra) == 1 and (not kind.is_named or BY_PLACE.fullmatch(spectra[0].name)):
        # The title over a single column is mostly "reflectance".
        spectra = [replace(spectra[0], name=readable(file.stem))]
    content = as_references(file, spectra)
    if content.empty:
        note(f"{file.name}: without values and left out: {', '.join(content.empty[:5])}.")
    return [(reference.name or readable(file.stem), reference.curve) for reference in content.references]


def _grouped(
    grouping: str, paths: Sequence[Path], files: list[Path], table: Path | None
) -> Callable[[str, Path], str]:
    named = {} if table is None else read_groups(table)
    has_folders = len({file.parent for file in files}) > 1
    # Files next to the subfolders of a library are not a class of their own.
    tops = {path for path in paths if path.is_dir()}

    def group_of(name: str, file: Path) -> str:
        if name in named:
            return named[name]
        match grouping:
            case "auto" if not has_folders or (file.parent in tops and len(tops) == 1):
                return _REPEATED.sub("", name) or name
            case "auto" | "folder":
                return readable(file.parent.name)
            case "file":
                return readable(file.stem)
            case "none":
                return name
        return _NUMBER.sub("", name) or name

    return group_of


def read_groups(table: Path) -> dict[str, str]:
    """Groups by the names of entries, from a CSV file; raises `CalibrationError`."""
    import csv

    try:
        lines = read_bounded(table).decode("utf-8-sig").splitlines()
        # Where a comma is the decimal point, tables have semicolons.
        separator = next((each for each in ";\t" if lines and each in lines[0]), ",")
        rows = list(csv.DictReader(lines, delimiter=separator))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise CalibrationError(f"The table of groups {table} cannot be read ({error}).") from error
    if not rows or not {"name", "group"} <= set(rows[0]):
        raise CalibrationError(
            f"{table.name} needs the columns 'name' and 'group' and at least one line. Add them."
        )
    return {row["name"]: row["group"] for row in rows if row["name"] and row["group"]}
