"""The fields of a mapping that a person can change, in the words of the mapping's file. No Qt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from pydantic import ValidationError

from dsl_core.errors import StoreError
from dsl_core.io.linearity import LINEAR_WORDS
from dsl_core.io.pictures.mapping import (
    MOST_PICTURES,
    BlackPicture,
    Mapping,
    Part,
    PhasePictures,
    RawLayout,
    Skipped,
    StripePictures,
    WhitePicture,
)
from dsl_core.model.base import Record, problems_in_words
from dsl_core.model.captured_code import MOST_BITS, MOST_STEPS
from dsl_core.model.plan import MOST_PX

R = TypeVar("R", bound=Record)
#: Kinds of parts, in the order in which they are offered.
KINDS = ("white", "black", "stripes", "phases", "skip")
Choices = tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Field:
    """One field to change: how it is called, what it is, its value and what is possible.

    A text is a list with commas between its entries; ``low`` and ``high`` bound a number.
    """

    key: str
    title: str
    kind: Literal["choice", "whole", "number", "flag", "text"]
    value: Any
    tip: str
    choices: Choices = ()
    low: float = 0
    high: float = 0
    unit: str = ""


def _words(*words: str) -> Choices:
    return tuple((word, word) for word in words)


def part_fields(part: Part) -> tuple[Field, ...]:
    """What can be changed of a part; which fields there are depends on its kind."""
    fields = [
        Field("kind", "Shows", "choice", part.kind, "What the pictures of this part show", _words(*KINDS))
    ]
    if isinstance(part, StripePictures | PhasePictures):
        fields.append(
            Field("axis", "Axis", "choice", part.axis, "Whether they tell columns or rows of the projector",
                  _words("columns", "rows"))
        )  # fmt: skip
    if isinstance(part, StripePictures):
        fields += _stripe_fields(part)
    elif isinstance(part, PhasePictures):
        fields += _phase_fields(part)
    elif isinstance(part, Skipped):
        fields.append(
            Field("count", "Pictures", "whole", part.count, "How many pictures are not used",
                  low=1, high=MOST_PICTURES)
        )  # fmt: skip
    tip = "Names or patterns of its files, with commas; empty: the next of the pictures that all parts share"
    return (*fields, Field("files", "Own files", "text", ", ".join(part.files), tip))


def _stripe_fields(part: StripePictures) -> list[Field]:
    return [
        Field("code", "Code", "choice", part.code, "How a number becomes digits",
              _words("gray", "binary", "xor")),
        Field("bits", "Bits", "whole", part.bits, "How many digits a number has", low=1, high=MOST_BITS),
        Field("first", "First digit", "choice", part.first,
              "The digit that comes first: the most significant has the widest stripes",
              _words("most", "least")),
        Field("inverse", "Inverse", "choice", part.inverse,
              "Where the pictures with black and white exchanged are: none, after each picture, after all",
              _words("none", "interleaved", "after")),
        Field("inverse_first", "Inverse first", "flag", part.inverse_first,
              "The inverse comes before its picture; without other pictures, there are inverses alone"),
        Field("unit_px", "Unit", "whole", part.unit_px, "Width of the stripe of one number",
              low=1, high=MOST_PX, unit="px"),
        Field("offset", "Offset", "whole", part.offset, "Number at the first column or row of the projector",
              low=0, high=MOST_PX),
        Field("base_bit", "Base bit", "whole", part.base_bit,
              "Digit that all others of an XOR code are combined with, from 0 for the least",
              low=0, high=MOST_BITS - 1),
    ]  # fmt: skip


def _phase_fields(part: PhasePictures) -> list[Field]:
    fringes = ", ".join(f"{each:g}" for each in part.fringes)
    return [
        Field("fringes", "Fringes", "text", fringes,
              "Periods across the projector, for each set of sinusoids, with commas"),
        Field("steps", "Steps", "whole", part.steps, "Pictures of each set", low=3, high=MOST_STEPS),
        Field("order", "Order", "choice", part.order,
              "set: all steps of a set, then the next set; step: that step of all sets, then the next step",
              _words("set", "step")),
        Field("start_deg", "Start", "number", part.start_deg,
              "Phase of the first step at the first column or row", low=-360, high=360, unit="°"),
        Field("direction", "Direction", "choice", part.direction,
              "Whether steps add to the phase or take from it", (("+1", 1), ("-1", -1))),
    ]  # fmt: skip


def picture_fields(mapping: Mapping) -> tuple[Field, ...]:
    """What can be changed of how the files of a mapping are found and read."""
    raw = mapping.raw or RawLayout(width_px=1, height_px=1)
    depths: Choices = (("as in the file", None), *((f"{bits} bits", bits) for bits in (8, 10, 12, 14, 16)))
    mosaics: Choices = (("none", None), *_words("RGGB", "GRBG", "GBRG", "BGGR"))
    fields = [
        Field("files", "Files", "text", ", ".join(mapping.files),
              "Names or patterns with * and ?, with commas; taken one after the other"),
        Field("number", "Number", "text", mapping.number,
              "Regular expression with one group, such as im(\\d+): files are sorted by that number"),
        Field("missing", "Missing", "text", ", ".join(map(str, mapping.missing)),
              "Places, from 0, in the order of the parts of which there is no picture"),
        Field("channel", "Colour", "choice", mapping.channel,
              "What of a colour picture is used; grey is the mean", _words("grey", "red", "green", "blue")),
        Field("bayer", "Mosaic", "choice", mapping.bayer, "Colours of neighbouring pixels", mosaics),
        Field("bit_depth", "Bit depth", "choice", mapping.bit_depth, "Bits that values really have", depths),
        Field("left_aligned", "Left aligned", "flag", mapping.left_aligned,
              "Values are at the upper end of 16 bits"),
        Field("encoding", "Encoding", "choice", mapping.encoding,
              "linear: values are proportional to light; srgb: pictures for screens, made linear when read",
              _words("linear", "srgb")),
        Field("full_scale", "Full scale", "number", mapping.full_scale or 0.0,
              "The white of floating-point arrays; 0: they hold whole numbers", low=0, high=1e6),
        Field("raw", "Raw files", "flag", mapping.raw is not None,
              "Import .raw and .bin files too, which hold pixels without their size"),
    ]  # fmt: skip
    if mapping.raw is not None:
        fields += [
            Field("raw.width_px", "Raw width", "whole", raw.width_px, "Columns of a raw file",
                  low=1, high=MOST_PX, unit="px"),
            Field("raw.height_px", "Raw height", "whole", raw.height_px, "Rows of a raw file",
                  low=1, high=MOST_PX, unit="px"),
            Field("raw.bits", "Raw bits", "choice", raw.bits, "Bits of a pixel", (("8", 8), ("16", 16))),
            Field("raw.header_bytes", "Raw header", "whole", raw.header_bytes,
                  "Bytes before the first pixel", low=0, high=1 << 20, unit="bytes"),
            Field("raw.big_endian", "Big endian", "flag", raw.big_endian,
                  "The first byte of a pixel is the more significant one"),
        ]  # fmt: skip
    return tuple(fields)


def part_words(part: Part) -> str:
    """A part in a line.

    >>> part_words(StripePictures(bits=7))
    'columns, gray, 7 bits, most first, inverse interleaved'
    """
    match part:
        case StripePictures():
            inverse = f"inverse {part.inverse}" if part.inverse != "none" else "no inverse"
            return f"{part.axis}, {part.code}, {part.bits} bits, {part.first} first, {inverse}"
        case PhasePictures():
            fringes = ", ".join(f"{each:g}" for each in part.fringes)
            return f"{part.axis}, {fringes} fringes, {part.steps} steps"
        case Skipped():
            return f"skip {part.count}"
        case _:
            return part.kind


# Change --------------------------------------------------------------------------------------------


def with_part_field(mapping: Mapping, place: int, key: str, value: Any) -> Mapping:
    """The mapping with a field of one part changed; raises `StoreError` when that is not possible."""
    part = mapping.parts[place]
    if key == "kind":
        changed = new_part(value, mapping.projector_size_px, getattr(part, "axis", "columns"))
        changed = changed.model_copy(update={"files": part.files})
    else:
        changed = _validated(type(part), {**part.model_dump(), key: _parsed(key, value)})
    axis = getattr(part, "axis", None)
    parts = (*mapping.parts[:place], changed, *mapping.parts[place + 1 :])
    # What the guess was unsure of is settled by whoever changes it.
    unsure = tuple(each for each in mapping.unsure if axis is None or axis not in each)
    return _changed(mapping, parts=parts, unsure=unsure)


def with_field(mapping: Mapping, key: str, value: Any) -> Mapping:
    """The mapping with a field of its files changed; raises `StoreError` when that is not possible."""
    if key == "raw":
        return _changed(mapping, raw=RawLayout(width_px=640, height_px=480) if value else None)
    if key == "encoding":
        unsure = tuple(each for each in mapping.unsure if LINEAR_WORDS not in each)
        return _changed(mapping, encoding=value, unsure=unsure)
    head, _, inner = key.partition(".")
    if inner:
        assert mapping.raw is not None
        return _changed(mapping, raw={**mapping.raw.model_dump(), inner: value})
    return _changed(mapping, **{head: _parsed(key, value)})


def with_projector(mapping: Mapping, size_px: tuple[int, int]) -> Mapping:
    """The mapping for a projector of another size; raises `StoreError` when that is not possible."""
    unsure = tuple(each for each in mapping.unsure if "projector" not in each)
    return _changed(mapping, projector_size_px=size_px, unsure=unsure)


def with_part(mapping: Mapping, place: int, kind: str) -> Mapping:
    """The mapping with a new part at a place; raises `StoreError` when there are too many."""
    part = new_part(kind, mapping.projector_size_px)
    return _changed(mapping, parts=(*mapping.parts[:place], part, *mapping.parts[place:]))


def without_part(mapping: Mapping, place: int) -> Mapping:
    """The mapping without a part; raises `StoreError` when nothing coded would be left."""
    return _changed(mapping, parts=(*mapping.parts[:place], *mapping.parts[place + 1 :]))


def moved_part(mapping: Mapping, place: int, steps: int) -> Mapping:
    """The mapping with a part some places further down, or up for negative steps."""
    parts = list(mapping.parts)
    to = min(max(place + steps, 0), len(parts) - 1)
    parts.insert(to, parts.pop(place))
    return _changed(mapping, parts=tuple(parts))


def new_part(kind: str, projector_size_px: tuple[int, int], axis: str = "columns") -> Part:
    """A part of a kind, with what is common: as many digits as the projector has columns, three sinusoids."""
    length = projector_size_px[axis != "columns"]
    match kind:
        case "stripes":
            bits = max((length - 1).bit_length(), 1)
            return StripePictures.model_validate({"axis": axis, "bits": min(bits, MOST_BITS)})
        case "phases":
            return PhasePictures.model_validate({"axis": axis, "fringes": (1.0, 8.0, 64.0), "steps": 4})
        case "white":
            return WhitePicture()
        case "black":
            return BlackPicture()
        case _:
            return Skipped()


def first_mapping(pictures: int, projector_size_px: tuple[int, int]) -> Mapping:
    """What a person starts from when nothing could be guessed: white, black, and a Gray code of the rest."""
    size = projector_size_px if all(projector_size_px) else (1024, 768)
    bits = min(max((pictures - 2) // 2, 1), MOST_BITS)
    return Mapping(parts=(WhitePicture(), BlackPicture(), StripePictures(bits=bits)), projector_size_px=size)


def _parsed(key: str, value: Any) -> Any:
    """The value of a field from what its widget gives; raises `StoreError` for a text that is not one."""
    if key == "full_scale":
        return value or None
    if key not in ("files", "fringes", "missing"):
        return value
    entries = tuple(each.strip() for each in str(value).split(",") if each.strip())
    if key == "files":
        return entries
    try:
        return tuple(float(each) if key == "fringes" else int(each) for each in entries)
    except ValueError as error:
        what = "numbers, such as 1, 8, 64" if key == "fringes" else "places from 0, such as 3, 17"
        raise StoreError(f"{key} must be {what}, not {value!r}.") from error


def _changed(mapping: Mapping, **what: Any) -> Mapping:
    if what.get("files") == ():
        raise StoreError("files must name at least one file; * takes all pictures of the folder.")
    return _validated(Mapping, {**mapping.model_dump(), **what})


def _validated(kind: type[R], values: dict[str, Any]) -> R:
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise StoreError(f"This is not possible: {problems_in_words(error)}.") from error
