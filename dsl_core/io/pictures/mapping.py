"""How a folder of pictures is a structured-light capture: stated once as JSON, used for many folders."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from dsl_core.model.base import Record
from dsl_core.model.captured_code import MOST_BITS, MOST_SETS, MOST_STEPS, Axis
from dsl_core.model.plan import MOST_PX
from dsl_core.model.rig import BayerPattern

#: More pictures than any code has.
MOST_PICTURES = 4096
#: File names relative to the folder, with the usual ``*`` and ``?``; a plain name is one too.
Globs = tuple[str, ...]
#: How values stand for light: proportional to it, or as pictures for screens store it.
Encoding = Literal["linear", "srgb"]


class WhitePicture(Record):
    """The scene under full light."""

    kind: Literal["white"] = "white"
    files: Globs = ()


class BlackPicture(Record):
    """The scene while the projector shows black."""

    kind: Literal["black"] = "black"
    files: Globs = ()


class Skipped(Record):
    """Pictures that are not part of the code."""

    kind: Literal["skip"] = "skip"
    count: int = Field(default=1, ge=1, le=MOST_PICTURES)
    files: Globs = ()


class StripePictures(Record):
    """Numbered stripes, by digits; see `dsl_core.model.captured_code.Stripes` for what the numbers are.

    ``first`` is the digit that comes first. Inverses follow each picture (``interleaved``) or all of them
    (``after``), or precede them when ``inverse_first``.
    """

    kind: Literal["stripes"] = "stripes"
    axis: Axis = "columns"
    code: Literal["gray", "binary", "xor"] = "gray"
    bits: int = Field(ge=1, le=MOST_BITS)
    first: Literal["most", "least"] = "most"
    inverse: Literal["none", "interleaved", "after"] = "interleaved"
    inverse_first: bool = False
    unit_px: int = Field(default=1, ge=1)
    offset: int = Field(default=0, ge=0)
    base_bit: int = Field(default=0, ge=0)
    files: Globs = ()


class PhasePictures(Record):
    """Shifted sinusoids; see `dsl_core.model.captured_code.Phases` for start and direction.

    ``fringes`` says how many periods of each set the projector's width or height holds. All steps of a set
    follow each other, or with ``order`` "step" all sets of a step.
    """

    kind: Literal["phases"] = "phases"
    axis: Axis = "columns"
    fringes: tuple[float, ...] = Field(min_length=1, max_length=MOST_SETS)
    steps: int = Field(ge=3, le=MOST_STEPS)
    order: Literal["set", "step"] = "set"
    start_deg: float = 0.0
    direction: Literal[1, -1] = 1
    files: Globs = ()


Part = Annotated[
    WhitePicture | BlackPicture | Skipped | StripePictures | PhasePictures, Field(discriminator="kind")
]


class RawLayout(Record):
    """Pixels of a file without a header of its own, row by row."""

    width_px: int = Field(ge=1, le=MOST_PX)
    height_px: int = Field(ge=1, le=MOST_PX)
    bits: Literal[8, 16] = 16
    header_bytes: int = Field(default=0, ge=0, le=1 << 20)
    big_endian: bool = False


def untold_direction(axis: Axis, assumed: str) -> str:
    """What is unsure of sinusoids whose direction nobody states."""
    return (
        f"sinusoids do not say which way {axis} rise: {assumed} is assumed; where positions run the other"
        " way, give direction of the mapping the other sign"
    )


class Mapping(Record):
    """Which pictures there are, in natural order of their names, and what they show one after the other.

    ``files`` are taken glob by glob; with ``number``, a regular expression with one group, they are sorted by
    that number. A part with ``files`` of its own takes those, the others share the rest in their order.
    ``missing`` are places (from 0) in that order of which there is no picture. Colour pictures become
    ``grey``, the mean of their channels, or one channel; a ``bayer`` mosaic stays as it is. Values have
    ``bit_depth`` bits, at the upper end of 16 where ``left_aligned``; ``full_scale`` is the white of
    floating-point arrays, and of whole numbers of more than 16 bits, and the value as stored at which others
    end if that is not the largest of their bits. Values with ``encoding`` "srgb" are made
    linear in light, channel by channel.
    """

    schema_version: Literal[1] = 1
    name: str = ""
    files: Globs = ("*",)
    number: str = ""
    parts: tuple[Part, ...] = Field(min_length=1, max_length=64)
    missing: tuple[int, ...] = ()
    projector_size_px: tuple[int, int]
    channel: Literal["grey", "red", "green", "blue"] = "grey"
    bayer: BayerPattern | None = None
    bit_depth: int | None = Field(default=None, ge=8, le=16)
    left_aligned: bool = False
    full_scale: float | None = Field(default=None, gt=0)
    encoding: Encoding = "linear"
    raw: RawLayout | None = None
    unsure: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        for pattern in (*self.files, *(name for part in self.parts for name in part.files)):
            path = PurePosixPath(pattern.replace("\\", "/"))
            if not pattern or path.is_absolute() or ".." in path.parts or ":" in pattern:
                raise ValueError(f"files must be names inside the folder, not {pattern!r}")
        if not all(0 < size <= MOST_PX for size in self.projector_size_px):
            raise ValueError(f"projector_size_px must be 1 to {MOST_PX} pixels a side")
        if not any(isinstance(part, StripePictures | PhasePictures) for part in self.parts):
            raise ValueError("no part is of stripes or phases, so nothing is coded")
        return self
