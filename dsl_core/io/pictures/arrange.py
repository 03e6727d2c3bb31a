"""Which picture of a folder is which frame, by a mapping."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path, PurePosixPath

from pydantic import ValidationError

from dsl_core.errors import StoreError
from dsl_core.io.pictures.array_file import ARCHIVES
from dsl_core.io.pictures.camera_raw import SUFFIXES as CAMERA_RAWS
from dsl_core.io.pictures.mapping import (
    MOST_PICTURES,
    BlackPicture,
    Mapping,
    Part,
    PhasePictures,
    Skipped,
    StripePictures,
    WhitePicture,
)
from dsl_core.io.pictures.picture_file import ARRAYS, PICTURES, RAWS, Picture, pictures_in
from dsl_core.model.base import problems_in_words
from dsl_core.model.captured_code import Axis, CapturedCode, Phases, Stripes
from dsl_core.model.plan import CodeSet, GrayCode, XorCode
from dsl_core.words import natural

#: A folder with more entries than this was chosen by mistake.
MOST_ENTRIES = 100_000


@dataclass(frozen=True)
class Slot:
    """What a picture shows: a frame of one of the mapping's ``parts``, by its place in the set, in words."""

    part: int
    frame: int
    words: str


@dataclass(frozen=True)
class Arrangement:
    """The pictures of a folder and what they show; ``frames`` are those of the code in its order.

    ``listed`` are all pictures in the order of the mapping, ``pairs`` those of patterns with their inverses.
    """

    code: CodeSet
    frames: tuple[Picture, ...]
    white: Picture | None
    black: Picture | None
    table: tuple[tuple[str, str], ...]
    listed: tuple[Picture, ...]
    pairs: tuple[tuple[Axis, Picture, Picture], ...]


def arrange(folder: Path, mapping: Mapping) -> Arrangement:
    """Find every picture of a mapping; raises `StoreError` that names what is missing or too many."""
    slots = list(_slots(mapping))
    own, rest = _pictures_of(folder, mapping)
    shared = [slot for slot in slots if slot.part not in own]
    if any(not 0 <= place < len(shared) for place in mapping.missing):
        raise StoreError(
            f"missing of the mapping must name places 0 to {len(shared) - 1}, given {list(mapping.missing)}."
        )
    shared = [slot for place, slot in enumerate(shared) if place not in mapping.missing]
    found = _matched(folder, shared, rest)
    for index, pictures in own.items():
        found |= _matched(folder, [slot for slot in slots if slot.part == index], pictures)
    return _arrangement(folder, mapping, slots, found)


def draft_table(folder: Path, mapping: Mapping) -> tuple[tuple[str, str], ...]:
    """The table of a mapping that does not fit yet: pictures that it leaves over, and those that it lacks.

    Raises `StoreError` when the pictures cannot be listed.
    """
    slots = list(_slots(mapping))
    own, rest = _pictures_of(folder, mapping)
    shared = [slot for slot in slots if slot.part not in own]
    shared = [slot for place, slot in enumerate(shared) if place not in mapping.missing]
    pairs = list(zip_longest(rest, shared))
    for index, pictures in own.items():
        pairs += zip_longest(pictures, [slot for slot in slots if slot.part == index])
    return tuple(
        (
            "-" if picture is None else _shown(picture, folder),
            "not in the mapping"
            if slot is None
            else f"{slot.words}{': no picture' if picture is None else ''}",
        )
        for picture, slot in pairs
    )


def _pictures_of(folder: Path, mapping: Mapping) -> tuple[dict[int, list[Picture]], list[Picture]]:
    """The pictures of parts with files of their own, and those that the other parts share."""
    own = {i: _listed(folder, part.files, mapping) for i, part in enumerate(mapping.parts) if part.files}
    taken = {picture for pictures in own.values() for picture in pictures}
    return own, [p for p in _listed(folder, mapping.files, mapping) if p not in taken]


def picture_files(folder: Path, patterns: Iterable[str], with_raw: bool = False) -> list[Path]:
    """Files with pictures in a folder, pattern by pattern in natural order; raises `StoreError`."""
    if not folder.is_dir():
        raise StoreError(f"{folder} is not a folder. Give the folder that contains the pictures.")
    known, found = PICTURES | ARRAYS | (RAWS if with_raw else set()), []
    for pattern in patterns:
        matches: list[Path] = []
        for count, path in enumerate(folder.glob(pattern)):
            if count >= MOST_ENTRIES:
                raise StoreError(
                    f"{folder} has more than {MOST_ENTRIES} files. Give the folder of one capture."
                )
            if path.suffix.lower() in known and not path.name.startswith(".") and not path.is_dir():
                matches.append(path)
        matches = _without_copies(matches)
        matches.sort(key=lambda path: natural(path.relative_to(folder).as_posix()))
        found += [path for path in matches if path not in found]
    # Next to pictures, an archive is something else, such as a calibration.
    return [path for path in found if path.suffix.lower() not in ARCHIVES] or found


def _without_copies(paths: Sequence[Path]) -> list[Path]:
    """Files without the pictures that a camera keeps next to its raw ones, of the same name."""
    raw = {path.with_suffix("") for path in paths if path.suffix.lower() in CAMERA_RAWS}
    return [path for path in paths if path.suffix.lower() in CAMERA_RAWS or path.with_suffix("") not in raw]


def _listed(folder: Path, patterns: Iterable[str], mapping: Mapping) -> list[Picture]:
    files = picture_files(folder, patterns, mapping.raw is not None)
    if mapping.number:
        files.sort(key=lambda path: _number(path.relative_to(folder), mapping.number))
    if len(files) > MOST_PICTURES:
        raise StoreError(f"{folder} has {len(files)} pictures; a capture has at most {MOST_PICTURES}.")
    return [picture for path in files for picture in pictures_in(path)]


def _number(path: Path, expression: str) -> int:
    try:
        found = re.search(expression, path.as_posix())
        return int(found.group(1)) if found else -1
    except (re.error, ValueError, IndexError) as error:
        raise StoreError(
            f"number of the mapping is {expression!r}, which gives no number for {path}. Write a regular"
            " expression with one group around the digits, like im(\\d+)."
        ) from error


def _slots(mapping: Mapping) -> Iterator[Slot]:
    for index, part in enumerate(mapping.parts):
        for frame, words in _frames_of(part):
            yield Slot(index, frame, words)


def _frames_of(part: Part) -> Iterator[tuple[int, str]]:
    """The frames of a part in the order of its pictures, by their place in its set."""
    match part:
        case WhitePicture() | BlackPicture():
            yield 0, part.kind
        case Skipped():
            yield from ((k, "not used") for k in range(part.count))
        case StripePictures():
            yield from _stripes_of(part)
        case PhasePictures():
            sets, steps = range(len(part.fringes)), range(part.steps)
            pairs = [(s, k) for s in sets for k in steps]
            if part.order == "step":
                pairs = [(s, k) for k in steps for s in sets]
            for s, k in pairs:
                yield s * part.steps + k, f"{part.axis}, {part.fringes[s]:g} fringes, step {k + 1}"


def _stripes_of(part: StripePictures) -> Iterator[tuple[int, str]]:
    bits = list(range(part.bits)) if part.first == "most" else list(range(part.bits))[::-1]
    sides = [True, False] if part.inverse_first else [False, True]
    if part.inverse == "none":
        # A set of inverses alone is one whose only picture of each digit is the inverse.
        order = [(bit, part.inverse_first) for bit in bits]
    elif part.inverse == "interleaved":
        order = [(bit, side) for bit in bits for side in sides]
    else:
        order = [(bit, side) for side in sides for bit in bits]
    doubled = part.inverse != "none" or part.inverse_first
    for bit, inverse in order:
        words = f"{part.axis}, {part.code} bit {part.bits - 1 - bit}{' inverse' if inverse else ''}"
        yield (2 * bit + inverse if doubled else bit), words


def _matched(folder: Path, slots: list[Slot], pictures: list[Picture]) -> dict[Slot, Picture]:
    if len(slots) != len(pictures):
        last = f" The last that was found is {pictures[-1]}." if pictures else ""
        raise StoreError(
            f"{folder} has {len(pictures)} pictures where the mapping wants {len(slots)}: it begins with"
            f" {slots[0].words if slots else 'nothing'}.{last} Correct files and parts of the mapping, name"
            " absent pictures in missing, or guess again."
        )
    return dict(zip(slots, pictures, strict=True))


def _arrangement(
    folder: Path, mapping: Mapping, slots: list[Slot], found: dict[Slot, Picture]
) -> Arrangement:
    sets: dict[Axis, list[Stripes | Phases]] = {"columns": [], "rows": []}
    pictures: dict[Axis, list[Picture]] = {"columns": [], "rows": []}
    lights: dict[str, Picture] = {}
    # Stripes come before the sinusoids that they count.
    order = sorted(range(len(mapping.parts)), key=lambda i: isinstance(mapping.parts[i], PhasePictures))
    for index in order:
        part = mapping.parts[index]
        own = sorted((s for s in slots if s.part == index), key=lambda slot: slot.frame)
        if isinstance(part, WhitePicture | BlackPicture) and own[0] in found:
            lights.setdefault(part.kind, found[own[0]])
        if isinstance(part, StripePictures | PhasePictures):
            lacking = tuple(slot.frame for slot in own if slot not in found)
            sets[part.axis].append(_set_of(folder, part, lacking, mapping.projector_size_px))
            pictures[part.axis] += [found[slot] for slot in own if slot in found]
    code = CapturedCode(column_sets=tuple(sets["columns"]), row_sets=tuple(sets["rows"]))
    words = {picture: slot.words for slot, picture in found.items()}
    table = [(_shown(picture, folder), said) for picture, said in words.items()]
    table += [("-", f"{slot.words}: missing") for slot in slots if slot not in found]
    return Arrangement(
        _own_code(code, mapping.projector_size_px),
        (*pictures["columns"], *pictures["rows"]),
        lights.get("white"),
        lights.get("black"),
        tuple(table),
        tuple(found.values()),
        tuple(_pairs_of(mapping, slots, found)),
    )


def _pairs_of(
    mapping: Mapping, slots: list[Slot], found: dict[Slot, Picture]
) -> Iterator[tuple[Axis, Picture, Picture]]:
    """Patterns and their inverses, of digits of which both are there."""
    for index, part in enumerate(mapping.parts):
        if not isinstance(part, StripePictures) or part.inverse == "none":
            continue
        own = sorted((s for s in slots if s.part == index), key=lambda slot: slot.frame)
        for one, other in zip(own[0::2], own[1::2], strict=True):
            if one in found and other in found:
                yield part.axis, found[one], found[other]


def _shown(picture: Picture, folder: Path) -> str:
    name = PurePosixPath(picture.path.relative_to(folder)).as_posix()
    return name if picture.index is None else f"{name}[{picture.index}]"


def _set_of(
    folder: Path, part: StripePictures | PhasePictures, lacking: tuple[int, ...], size_px: tuple[int, int]
) -> Stripes | Phases:
    try:
        if isinstance(part, StripePictures):
            doubled = part.inverse != "none" or part.inverse_first
            if part.inverse == "none" and part.inverse_first:
                lacking = (*lacking, *(2 * bit for bit in range(part.bits)))
            return Stripes(
                code=part.code,
                bits=part.bits,
                inverse=doubled,
                unit_px=part.unit_px,
                offset=part.offset,
                base_bit=part.base_bit,
                lacking=lacking,
            )
        if lacking:
            raise StoreError(
                f"{folder} lacks {len(lacking)} pictures of its sinusoids; each step is needed. Add them, or"
                " leave that set out of the mapping."
            )
        length = size_px[0] if part.axis == "columns" else size_px[1]
        return Phases(
            periods_px=tuple(length / fringes for fringes in part.fringes),
            steps=part.steps,
            start_deg=part.start_deg,
            direction=part.direction,
        )
    except (ValidationError, ZeroDivisionError) as error:
        words = problems_in_words(error) if isinstance(error, ValidationError) else "fringes of 0 are none"
        raise StoreError(f"The {part.axis} of the mapping are not possible: {words}. Correct it.") from error


def _own_code(code: CapturedCode, size_px: tuple[int, int]) -> CodeSet:
    """The same as one of our own codes where it is one."""
    sets = [*code.column_sets, *code.row_sets]
    if len(code.column_sets) != 1 or len(code.row_sets) > 1:
        return code
    for each, length in zip(sets, size_px, strict=False):
        if not isinstance(each, Stripes) or not each.inverse or each.lacking or each.offset:
            return code
        if each.unit_px != 1 or each.bits != (length - 1).bit_length():
            return code
    kinds = {
        (each.code, each.base_bit if each.code == "xor" else 0) for each in sets if isinstance(each, Stripes)
    }
    rows = bool(code.row_sets)
    if kinds == {("gray", 0)}:
        return GrayCode(rows=rows)
    if len(kinds) == 1 and kinds <= {("xor", 0), ("xor", 1)}:
        return XorCode(rows=rows, base_px=2 if ("xor", 0) in kinds else 4)
    return code
