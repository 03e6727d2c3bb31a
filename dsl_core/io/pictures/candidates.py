"""Which pictures of a folder may be one capture: all of them, or those of one camera, pose or name."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from glob import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures.arrange import picture_files
from dsl_core.io.pictures.picture_file import ARRAYS, NOT_READ, PAGED, Picture, pictures_in
from dsl_core.words import counted, natural, readable

#: Fewer pictures are no code, more are several captures.
FEWEST, MOST = 4, 512
#: So many numbers may be absent from a row of names.
MOST_ABSENT = 4
#: With more files whose names stand alone than these, none is tried as the only one that does not belong.
MOST_ALONE = 3
#: Patterns of files that are tried, from the folder itself to folders in its folders.
_EVERYTHING = (("*",), ("*", "*/*"), ("*", "*/*", "*/*/*"))
_LAST_NUMBER = re.compile(r"\d+(?!.*\d)")
#: An exposure in a name.
_EXPOSURE = re.compile(r"\d+(?:[.,]\d+)?[mu]s(?![a-z])", re.IGNORECASE)


@dataclass(frozen=True)
class Candidate:
    """Pictures that may be one capture, None where a number is absent; ``files`` are globs that find them.

    ``left_out`` counts pictures of the folder that belong to none or to another capture.
    """

    name: str
    pictures: tuple[Picture | None, ...]
    files: tuple[str, ...]
    left_out: int

    @property
    def absent(self) -> tuple[int, ...]:
        """Places of absent pictures."""
        return tuple(i for i, picture in enumerate(self.pictures) if picture is None)


def candidates(folder: Path) -> tuple[list[Candidate], list[Candidate]]:
    """Captures that a folder may hold: all pictures as one, and each group of names as its own.

    Raises `StoreError` when there are too few pictures.
    """
    files: list[Path] = []
    for patterns in _EVERYTHING:
        files = picture_files(folder, patterns)
        if len(files) >= FEWEST or any(path.suffix.lower() in ARRAYS | PAGED for path in files):
            break
    pictures = [picture for path in files for picture in pictures_in(path)]
    if len(pictures) < FEWEST:
        raise StoreError(
            f"{folder} contains {counted(len(pictures), 'picture')} (PNG, TIFF, JPEG, BMP, PGM, NPY, NPZ,"
            f" MAT, camera raw); a capture has at least {FEWEST}. {_advice(folder)}"
        )
    groups = _groups(folder, files)
    by_folder: dict[str, list[Path]] = {}
    for path in files:
        by_folder.setdefault(path.relative_to(folder).parent.as_posix(), []).append(path)
    parts = list(by_folder.values()) if len(by_folder) > 1 else []
    parts += [g for g in groups.values() if len(groups) > 1 and g not in parts]
    name = readable(folder.absolute().name)
    whole = [] if len(pictures) > MOST else list(_variants(folder, files, files, name))
    for kept in _without_strays(files, groups.values()):
        whole += _variants(folder, kept, files, name)
    single = [
        candidate
        for group in sorted(parts, key=lambda g: natural(str(g[0])))
        if FEWEST <= len(group) <= MOST
        for candidate in _variants(folder, group, files, _name(folder, group))
    ]
    return whole, single


def _groups(folder: Path, files: Sequence[Path]) -> dict[str, list[Path]]:
    """Files whose names differ by their last number alone, or by all but an exposure at their end."""
    groups: dict[str, list[Path]] = {}
    by_exposure: dict[str, list[Path]] = {}
    for path in files:
        groups.setdefault(_key(folder, path), []).append(path)
        by_exposure.setdefault(f"{path.parent}/{_exposure(path)}", []).append(path)
    if max(map(len, groups.values()), default=0) < FEWEST <= min(map(len, by_exposure.values()), default=0):
        return by_exposure
    return groups


def _exposure(path: Path) -> str:
    """The exposure that ends a name; empty if none does."""
    found = [each for each in _EXPOSURE.finditer(path.stem) if each.end() == len(path.stem)]
    return found[0].group() if found else ""


def _without_strays(files: Sequence[Path], groups: Collection[Sequence[Path]]) -> Iterator[list[Path]]:
    """Files without one whose name stands alone, as white and black may, too, and without all of these."""
    alone = [group[0] for group in groups if len(group) == 1]
    if 1 < len(alone) <= MOST_ALONE and len(files) <= MOST:
        # A photograph of the set-up mostly has a name that comes after those of a code.
        yield from ([path for path in files if path != stray] for stray in reversed(alone))
    rest = [path for path in files if path not in alone]
    if alone and 0 < len(rest) <= MOST:
        yield rest


def _advice(folder: Path) -> str:
    """What to do about a folder without enough pictures, by what else there is in it."""
    for path in sorted(folder.iterdir()):
        known = NOT_READ.get(path.suffix.lower())
        if known is not None and path.is_file():
            what, advice = known
            return f"{path.name} is {what}, which is not read. {advice}."
    return "Give the folder of one capture; for pixels without a header, state raw in a mapping."


def _variants(folder: Path, group: Sequence[Path], files: Sequence[Path], name: str) -> Iterator[Candidate]:
    """The pictures as they are, and with absent ones where numbers lack."""
    globs, left_out = _globs(folder, group), len(files) - len(group)
    listed = [picture for path in group for picture in pictures_in(path)]
    yield Candidate(name, tuple(listed), globs, left_out)
    slots: list[Picture | None] = []
    before: dict[str, int] = {}
    for path in group:
        key, number = _key(folder, path), _number(path)
        if number is not None:
            gap = number - before.get(key, number - 1) - 1
            if not 0 <= gap <= MOST_ABSENT:
                return
            slots += [None] * gap
            before[key] = number
        slots.append(Picture(path))
    absent = slots.count(None)
    if 0 < absent <= MOST_ABSENT and len(listed) == len(group):
        yield Candidate(name, tuple(slots), globs, left_out)


def jump_of(candidate: Candidate) -> str:
    """Where the numbers of names jump although nothing is taken to be absent, in words; else empty.

    >>> names = (Picture(Path(f"im{number}.png")) for number in (0, 1, 2, 5, 6))
    >>> jump_of(Candidate("im", tuple(names), ("*",), 0))
    'the numbers of the names jump from im2.png to im5.png'
    """
    paths = [picture.path for picture in candidate.pictures if picture is not None]
    if candidate.absent:
        return ""
    steps: dict[int, list[tuple[str, str]]] = {}
    for one, other in pairwise(paths):
        first, second = _number(one), _number(other)
        if (
            first is not None
            and second is not None
            and one.parent == other.parent
            and _key(one.parent, one) == _key(one.parent, other)
        ):
            steps.setdefault(second - first, []).append((one.name, other.name))
    usual = max(steps, key=lambda step: len(steps[step]), default=1)
    odd = [pair for step, pairs in steps.items() if step > usual for pair in pairs]
    return f"the numbers of the names jump from {odd[0][0]} to {odd[0][1]}" if odd else ""


def _globs(folder: Path, group: Sequence[Path]) -> tuple[str, ...]:
    """The shortest patterns that find just these files in this order, or their names."""
    # Names may have brackets, which would stand for other signs.
    names = [escape(path.relative_to(folder).as_posix()) for path in group]
    first = names[0]
    parent = first.rpartition("/")[0]
    within = f"{parent}/" if parent else ""
    key = _LAST_NUMBER.sub("*", first.rpartition("/")[2].rpartition(".")[0])
    ending = first.rpartition(".")[2]
    for patterns in (*_EVERYTHING, (f"{within}*",), (f"{within}{key}.{ending}",)):
        if picture_files(folder, patterns) == list(group):
            return patterns
    return tuple(names)


def _key(folder: Path, path: Path) -> str:
    name = path.relative_to(folder)
    return f"{name.parent.as_posix()}/{_LAST_NUMBER.sub('#', path.stem)}{path.suffix.lower()}"


def _number(path: Path) -> int | None:
    found = _LAST_NUMBER.search(path.stem)
    return int(found.group()) if found else None


def _name(folder: Path, group: Sequence[Path]) -> str:
    parents = {path.parent for path in group}
    if len({_exposure(path) for path in group}) == 1 and _exposure(group[0]):
        return group[0].with_name(_exposure(group[0])).relative_to(folder).as_posix()
    if len(parents) == 1 and group[0].parent != folder:
        return group[0].relative_to(folder).parent.as_posix()
    return _LAST_NUMBER.sub("", group[0].stem).strip(" _-.") or group[0].stem


def require_alike(picture: Picture, values: NDArray[Any], first: NDArray[Any]) -> None:
    """Raise `StoreError` unless the values of a picture have size and kind of those of the first one."""
    if values.shape[:2] != first.shape[:2]:
        raise StoreError(
            f"{picture} is {values.shape[1]} x {values.shape[0]} px, the first picture {first.shape[1]} x"
            f" {first.shape[0]} px. Keep pictures of one camera and size in a folder, or state a mapping."
        )
    if (values.dtype.kind, values.dtype.itemsize) != (first.dtype.kind, first.dtype.itemsize):
        raise StoreError(
            f"{picture} has values of {8 * values.dtype.itemsize} bits ({values.dtype}), the first picture of"
            f" {8 * first.dtype.itemsize} ({first.dtype}), whose white is another. Save all pictures of a"
            " capture alike."
        )
