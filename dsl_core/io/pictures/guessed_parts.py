"""From what pictures show to the parts of a mapping, and to the size of the projector they may come from."""

from __future__ import annotations

from collections.abc import Sequence
from math import gcd

import numpy as np

from dsl_core.errors import StoreError
from dsl_core.io.pictures.mapping import (
    BlackPicture,
    Part,
    PhasePictures,
    Skipped,
    StripePictures,
    WhitePicture,
    untold_direction,
)
from dsl_core.model.captured_code import Axis
from dsl_core.patterns.recognition.phase_sets import PhaseReading, turns_per_number
from dsl_core.patterns.recognition.probes import Probes
from dsl_core.patterns.recognition.sequence import Block
from dsl_core.patterns.recognition.stripe_sets import StripeReading, numbers_of
from dsl_core.words import counted

#: Sizes of projectors, the commonest first.
COMMON_PX = (
    (1024, 768), (1280, 800), (1920, 1080), (1280, 720), (800, 600), (854, 480), (640, 360), (640, 480),
    (912, 1140), (608, 684), (1140, 912), (1400, 1050), (1600, 1200), (1920, 1200), (2560, 1600),
    (3840, 2160),
)  # fmt: skip
#: Phases disagree by so many times more with the next reading, or which one it is stays unsure.
CLEARLY_WORSE = 2.0
#: Phases off by this share of what chance gives do not agree.
BY_CHANCE = 0.65
#: The same, where one fringe over the projector makes the others' numbers known to about a tenth.
NO_BETTER = 0.8
#: Numbers may exceed the projector by so much, because a few pixels are read wrongly.
MOST_BEYOND = 1.02
#: Numbers of rougher readings are too often wrong to say which there are.
STEADY = 0.2
Size = tuple[int, int]


def guessed_size(blocks: Sequence[Block]) -> tuple[Size, str]:
    """A projector that has the digits that were seen, and a sentence of how sure that is."""
    need: dict[str, tuple[int, int]] = {}
    has_phases = {block.axis for block in blocks if block.kind == "phases"}
    for block in blocks:
        if isinstance(block.reading, StripeReading) and block.axis not in has_phases:
            need[block.axis] = (block.reading.bits, block.reading.numbers[1])
    wanted = [need.get("columns"), need.get("rows")]
    if not need:
        return COMMON_PX[
            0
        ], "phases do not say the size of the projector: 1024 x 768 is assumed; give --projector"
    for size in COMMON_PX:
        fits = [
            each is None or ((length - 1).bit_length() == each[0] and each[1] < length)
            for each, length in zip(wanted, size, strict=True)
        ]
        if all(fits):
            break
    else:
        first, second = (2 ** each[0] if each else None for each in wanted)
        size = first or (second or 768) * 4 // 3, second or (first or 1024) * 3 // 4
    seen = " and ".join(f"{bits} bits of {axis} up to {most}" for axis, (bits, most) in need.items())
    told = f"{seen} were seen: a projector of {size[0]} x {size[1]} px is assumed; give --projector"
    if size[1] > size[0] or "columns" not in need:
        told += ", also where the camera is turned by 90 degrees instead"
    return size, told


def is_turned(blocks: Sequence[Block], size_px: Size) -> bool:
    """Whether stripes fit a projector only where its columns run down the picture, turned by 90°."""
    spans = [
        (block.axis, block.reading.numbers[1] - block.reading.numbers[0])
        for block in blocks
        if isinstance(block.reading, StripeReading)
    ]
    fits = [span < (size_px[0] if axis == "columns" else size_px[1]) for axis, span in spans]
    turned = [span < (size_px[1] if axis == "columns" else size_px[0]) for axis, span in spans]
    return bool(spans) and all(turned) and not all(fits)


def part_of(
    block: Block, blocks: Sequence[Block], size_px: Size, probes: Probes, turned: bool = False
) -> tuple[Part, list[str]]:
    """The part of a mapping for a block, and sentences about what is unsure.

    Raises `StoreError` when there are more numbers than the projector has places, or when sinusoids have
    several periods and nothing counts them.
    """
    axis: Axis = block.axis
    if turned:
        axis = "rows" if block.axis == "columns" else "columns"
    if isinstance(block.reading, StripeReading):
        others = [b.reading for b in blocks if b is not block and isinstance(b.reading, StripeReading)]
        other_length = size_px[1] if axis == "columns" else size_px[0]
        centred = [_is_centred(each, other_length) for each in others if each is not block.reading]
        return _stripes(axis, block.reading, size_px, next((c for c in centred if c is not None), None))
    if isinstance(block.reading, PhaseReading):
        return _phases(axis, block, block.reading, blocks, size_px, probes)
    if block.kind == "skip":
        count = len(block.slots)
        show = counted(count, "picture next to the stripes shows", "pictures next to the stripes show")
        return Skipped(count=count), [f"{show} no pattern and {'is' if count == 1 else 'are'} not used"]
    return (WhitePicture() if block.kind == "white" else BlackPicture()), []


def _is_centred(reading: StripeReading, length: int) -> bool | None:
    """Whether the middle of the numbers is that of the projector, as in several programs; None: untold."""
    unit = _unit(reading, length)
    spare = 2**reading.bits - -(-length // unit)
    low, high = reading.numbers
    if spare < 2 or reading.roughness >= STEADY:
        return False
    if high * unit >= length:
        return True
    return False if low < spare // 2 else None


def _stripes(
    axis: Axis, reading: StripeReading, size_px: Size, other_is_centred: bool | None = None
) -> tuple[Part, list[str]]:
    length = size_px[0] if axis == "columns" else size_px[1]
    unit = _unit(reading, length)
    low, high = reading.numbers
    is_steady = reading.roughness < STEADY
    if is_steady and (high - low) * unit > MOST_BEYOND * length:
        raise StoreError(
            f"The pictures show numbers {low} to {high} of {axis}, more than the {length} of the projector."
            " Give its right size (--projector)."
        )
    middle, centred = (2**reading.bits - -(-length // unit)) // 2, _is_centred(reading, length)
    offset, doubts = 0, []
    if centred:
        offset = middle
        doubts.append(f"numbers of {axis} exceed {length}: they are taken to be centred on the projector")
    elif centred is None:
        offset = middle if other_is_centred else 0
        as_others = "centred, as those of the other axis" if offset else "counted from 0"
        doubts.append(
            f"numbers {low} to {high} of {axis} may be counted from 0 or be centred on the projector (offset"
            f" {middle}): they are taken to be {as_others}; if not, set offset of the mapping"
        )
    if unit > 1:
        least = _covering(reading, length)
        other = f", not {least} px, which just covers them: if not, set unit_px of the mapping"
        doubts.append(
            f"{reading.bits} bits of {axis} are fewer than {length} px need: stripes are taken to be"
            f" {unit} px wide{other if least != unit else ''}"
        )
    if not reading.is_sure:
        doubts.append(f"{axis}: another code or order of digits fits nearly as well")
    if not reading.rises:
        doubts.append(f"{axis} fall along the picture: camera or projector may be mirrored")
    if reading.code == "binary":
        doubts.append(
            f"binary digits of {axis} look the same where patterns are inverses and the picture is"
            " mirrored: if positions run the wrong way, set inverse_first of the mapping to"
            f" {'false' if reading.inverse_first else 'true'}"
        )
    part = StripePictures(
        axis=axis,
        code=reading.code,
        bits=reading.bits,
        first=reading.first,
        inverse=reading.inverse,
        inverse_first=reading.inverse_first,
        unit_px=unit,
        offset=offset,
        base_bit=reading.base_bit,
    )
    return part, doubts


def _unit(reading: StripeReading, length: int) -> int:
    """Width of a stripe of one number: as if the finest digits were left out, where numbers allow that."""
    finer = max((length - 1).bit_length() - reading.bits, 0)
    low, high = reading.numbers
    middle = (2**reading.bits - -(-length >> finer)) // 2
    from_0 = high << finer <= MOST_BEYOND * length
    centred = low >= middle and (high - low) << finer <= MOST_BEYOND * length
    return 1 << finer if from_0 or centred or reading.roughness >= STEADY else _covering(reading, length)


def _covering(reading: StripeReading, length: int) -> int:
    """Width with which all numbers together just cover the projector, the least that is possible."""
    return max(-(-length // (1 << reading.bits)), 1)


def untold_width(blocks: Sequence[Block], size_px: Size, turned: bool = False) -> str:
    """Why nothing tells the period of sinusoids that stripes count, which scales positions; else empty."""
    for block in blocks:
        beside = any(b.kind == "phases" and b.axis == block.axis for b in blocks)
        if not isinstance(block.reading, StripeReading) or not beside:
            continue
        length = size_px[(block.axis == "rows") != turned]
        unit, least = _unit(block.reading, length), _covering(block.reading, length)
        if unit != least:
            return (
                f"{block.reading.bits} bits of {block.axis} count periods of sinusoids, but not how wide they"
                f" are: stripes of {least} px just cover {length} px, those of {unit} px do as well, and"
                " others are possible. All positions grow with that width: it must be known"
            )
    return ""


def _phases(
    axis: Axis, block: Block, reading: PhaseReading, blocks: Sequence[Block], size_px: Size, probes: Probes
) -> tuple[Part, list[str]]:
    fringes, start, direction = reading.fringes, reading.start_deg, reading.direction
    stripes = next((b for b in blocks if b.axis == block.axis and isinstance(b.reading, StripeReading)), None)
    pictures = [p for p in block.slots if p is not None]
    doubts = _disagreement(axis, reading, len(pictures))
    if stripes is not None and isinstance(stripes.reading, StripeReading):
        lines = probes.across if block.axis == "columns" else probes.down
        number = numbers_of(lines, stripes.slots, stripes.reading)
        # The direction of phases is that along the picture, where numbers of a mirrored one fall.
        direction = direction if stripes.reading.rises else (-1 if direction == 1 else 1)
        turns, start = turns_per_number(lines, pictures[: reading.steps], direction, number)
        length = size_px[0] if axis == "columns" else size_px[1]
        fringes = (length / _unit(stripes.reading, length) * turns,)
        if len(reading.fringes) > 1:
            fringes = tuple(fringes[0] * each / reading.fringes[0] for each in reading.fringes)
    else:
        way = "to the right" if axis == "columns" else "downwards"
        doubts += [
            _counted_alone(axis, reading),
            untold_direction(axis, way),
        ]
        if reading.rival_rad < CLEARLY_WORSE * reading.off_rad:
            doubts.append(f"{axis}: where the sinusoids start ({start:g} degrees) is unsure")
    part = PhasePictures(
        axis=axis,
        fringes=fringes,
        steps=reading.steps,
        order=reading.order,
        start_deg=start,
        direction=direction,
    )
    return part, doubts


def _disagreement(axis: Axis, reading: PhaseReading, count: int) -> list[str]:
    """What is said where phases of several fringes do not agree; raises `StoreError` where they cannot."""
    fringes = reading.fringes
    if len(fringes) == 1 or reading.off_rad <= BY_CHANCE * reading.chance_rad:
        return []
    figures = (
        f"with {_shown(fringes)}, the best, they are off by {reading.off_rad:.2f} rad, and"
        f" {reading.chance_rad:.2f} would be chance"
    )
    if min(fringes) > 1 or reading.off_rad > NO_BETTER * reading.chance_rad:
        raise StoreError(
            f"The {count} pictures of {axis} are sinusoids whose phases agree with no numbers of"
            f" fringes: {figures}. The projector's gamma or noise may have changed them. State fringes"
            " and start_deg in a mapping."
        )
    return [
        f"phases of {axis} hardly agree with any numbers of fringes, as where a projector has a gamma:"
        f" {figures}"
    ]


def _counted_alone(axis: Axis, reading: PhaseReading) -> str:
    """How sinusoids without stripes count their fringes; raises `StoreError` where they cannot."""
    fringes = reading.fringes
    if fringes == (0.0,):
        raise StoreError(
            f"The {reading.steps} pictures of {axis} are sinusoids of one period, which the picture"
            " shows more than once, and nothing says which of them a pixel sees. Add pictures of a second"
            " period or of stripes."
        )
    if np.min(fringes) == 1.0:
        return f"the coarsest sinusoid of {axis} is taken to be one period over the projector"
    if (times := gcd(*map(int, fringes))) > 1:
        raise StoreError(
            f"Sinusoids of {_shown(fringes)} fringes over the {axis} of the projector look the same {times}"
            " times, and nothing says which of them a pixel sees. Add pictures of a single fringe or of"
            " stripes, or state other fringes in a mapping."
        )
    return f"{axis}: {_shown(fringes)} fringes over the projector fit best, multiples fit as well"


def _shown(fringes: Sequence[float]) -> str:
    return ", ".join(f"{each:g}" for each in fringes)
