"""What a sequence of pictures is: white, black, and runs that code columns and rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.captured_code import Axis
from dsl_core.patterns.recognition.odd_pictures import odd_pairs
from dsl_core.patterns.recognition.phase_sets import (
    MOST_OFF_RAD,
    PhaseReading,
    read_phase_sets,
    sinusoid_runs,
    steps_of_strided,
    turn_nowhere,
)
from dsl_core.patterns.recognition.probes import Lines, Probes
from dsl_core.patterns.recognition.stripe_sets import ROUGH, StripeReading, read_set

#: A picture that is nearly everywhere at the brightest or darkest of its pixels.
BRIGHT, DARK = 0.9, 0.1
#: Where noise or room light spreads values, the brightest or darkest picture still reaches this.
BRIGHTEST, DARKEST = 0.75, 0.25
#: What speaks against numbers that fall, and against white or black in the middle of digits: both are rare,
#: and a camera that sees part of a projector may take its coarsest digit for white and black.
UNLIKELY = 0.02
#: What speaks against white or black that was taken twice, less than against numbers that fall: taken for the
#: coarsest digit of a Gray code, white and then black turn its numbers round.
REPEATED = 0.01
#: White, or black, that was taken twice differs by no more than this share of the range: lamps drift.
SAME_LIGHT = 0.02
#: White and black stand at most this far from an end of a sequence, or from each other.
FROM_END = 2
#: Splits that are tried, and the share of pictures that must speak for one; what speaking against it costs.
MOST_SPLITS, LEAST_SUPPORT, AXIS_DOUBT = 5, 0.4, 0.5
#: Runs of sinusoids that are tried.
MOST_RUNS = 3
#: What speaks against stripes for each of their pairs that is no pattern and its inverse: steps of sinusoids
#: after a code with inverses pass for its finest digits.
ODD_PAIR = 0.25
#: Sinusoids of one period agree with nothing, so that any steps fit them.
UNTESTED = 0.3
Slots = tuple[int | None, ...]
Places = tuple[int, ...]


@dataclass(frozen=True)
class Block:
    """Pictures that belong together, in order (None: absent), what they show and how they are to be read."""

    kind: Literal["white", "black", "stripes", "phases", "skip"]
    slots: Slots
    axis: Axis = "columns"
    reading: StripeReading | PhaseReading | None = None


BlocksOf = Callable[[Axis, Slots], tuple[list[Block], float]]


@dataclass(frozen=True)
class Recognised:
    """Blocks in the order of the pictures; ``misfit`` is 0 for a capture that makes sense as a whole.

    ``probes`` are the pictures in which the blocks were seen.
    """

    blocks: tuple[Block, ...]
    misfit: float
    probes: Probes

    @property
    def misfit_upright(self) -> float:
        """The misfit but for what speaks against numbers that fall, which tells nothing of the values."""
        readings = [block.reading for block in self.blocks]
        falling = sum(isinstance(each, StripeReading) and not each.rises for each in readings)
        return self.misfit - UNLIKELY * falling

    @property
    def digits(self) -> frozenset[tuple[Axis, int]]:
        """What is coded: for each axis its digits, or its periods."""
        return frozenset(
            (
                block.axis,
                block.reading.bits
                if isinstance(block.reading, StripeReading)
                else len(block.reading.fringes),
            )
            for block in self.blocks
            if block.reading is not None
        )

    @property
    def content(self) -> tuple[tuple[str, Axis, int], ...]:
        """The kinds of blocks and how many pictures each has, in order."""
        return tuple((block.kind, block.axis, len(block.slots)) for block in self.blocks)

    @property
    def has_inverses(self) -> bool:
        """Whether stripes are followed by their inverses."""
        readings = [block.reading for block in self.blocks]
        return any(isinstance(each, StripeReading) and each.inverse != "none" for each in readings)

    @property
    def has_spare(self) -> bool:
        """Whether pictures show neither a pattern nor the one white and the one black that are used."""
        return any(block.kind == "skip" for block in self.blocks)

    @property
    def has_odd_pair(self) -> bool:
        """Whether a clear pattern and its inverse do not go against each other."""
        return any(
            odd_pairs(
                self.probes.across if block.axis == "columns" else self.probes.down,
                block.slots,
                block.reading,
            )
            for block in self.blocks
            if isinstance(block.reading, StripeReading)
        )


def recognise(probes: Probes, slots: Slots, most_bits: Mapping[Axis, int] | None = None) -> Recognised | None:
    """The reading of a sequence of pictures that makes most sense, or None when none does.

    ``most_bits`` are the digits that the columns and rows of the projector need, where its size is known.
    """
    # Many guesses of where white and black are leave the same runs.
    blocks_of: BlocksOf = cache(lambda axis, run: _axis_blocks(probes, axis, run, most_bits or {}))
    level = {i: float(probes.across.of(p).mean()) for i, p in enumerate(slots) if p is not None}
    best: Recognised | None = None
    for white, black in _lights(level, len(slots)):
        for repeated in dict.fromkeys(((), _repeated(level, white, black))):
            found = _without_lights(probes, slots, white, black, repeated, blocks_of)
            if found is not None and (best is None or found.misfit < best.misfit - 1e-6):
                best = found
    return best


def _repeated(level: Mapping[int, float], white: int | None, black: int | None) -> Places:
    """Places of pictures that show white or black once more, as before and after a code, or for each axis."""
    lights = [i for i in (white, black) if i is not None]
    return tuple(
        i for i in level if i not in lights and any(is_same_light(level[i], level[k]) for k in lights)
    )


def is_same_light(one: float, other: float) -> bool:
    """Whether two mean levels may be those of one white, or of one black, that was taken twice."""
    both_bright, both_dark = min(one, other) > BRIGHT, max(one, other) < DARK
    return (both_bright or both_dark) and abs(one - other) <= SAME_LIGHT


def _lights(level: Mapping[int, float], count: int) -> Iterator[tuple[int | None, int | None]]:
    """Places where white and black may stand, the likeliest first: each is one picture or there is none."""
    near = [i for i in level if min(i, count - 1 - i) < FROM_END]
    whites = sorted((i for i in near if level[i] > BRIGHT), key=lambda i: -level[i])
    blacks = sorted((i for i in near if level[i] < DARK), key=lambda i: level[i])
    whites = whites or [i for i in near if level[i] == max(level.values()) and level[i] > BRIGHTEST]
    blacks = blacks or [i for i in near if level[i] == min(level.values()) and level[i] < DARKEST]
    # White or black alone in the middle, as between columns and rows.
    whites += [i for i in level if level[i] > BRIGHT and i not in near]
    blacks += [i for i in level if level[i] < DARK and i not in near]
    yield from product([*whites[:4], None], [*blacks[:4], None])


def _without_lights(
    probes: Probes, slots: Slots, white: int | None, black: int | None, repeated: Places, blocks_of: BlocksOf
) -> Recognised | None:
    lights = {i for i in (white, black) if i is not None}
    places = [i for i in range(len(slots)) if i not in lights and i not in repeated]
    if not places:
        return None
    # Taking white or black for a digit costs more than finding neither.
    misfit = 0.02 * (2 - len(lights)) + REPEATED * bool(repeated)
    best: Recognised | None = None
    for runs, doubt in _splits(probes, slots, places):
        coded: list[tuple[int, Block]] = []
        total = misfit + AXIS_DOUBT * doubt
        for axis, run in runs:
            found, cost = blocks_of(axis, tuple(slots[i] for i in run))
            if not found:
                total = np.inf
                break
            start = 0
            for block in found:
                own = run[start : start + len(block.slots)]
                coded.append((own[0], block))
                start += len(block.slots)
                if isinstance(block.reading, StripeReading):
                    total += UNLIKELY * (not block.reading.rises) + UNLIKELY * (len(_joined(own)) > 1)
            total += cost
        if not np.isfinite(total) or (best is not None and total >= best.misfit):
            continue
        blocks = coded
        if white is not None:
            blocks = [*blocks, (white, Block("white", (slots[white],)))]
        if black is not None:
            blocks = [*blocks, (black, Block("black", (slots[black],)))]
        for run in _runs(repeated):
            blocks = [*blocks, (run[0], Block("skip", tuple(slots[i] for i in run)))]
        in_order = tuple(block for _, block in sorted(blocks, key=lambda each: each[0]))
        best = Recognised(in_order, total, probes)
    return best


def _splits(
    probes: Probes, slots: Slots, places: Sequence[int]
) -> Iterator[tuple[tuple[tuple[Axis, Sequence[int]], ...], float]]:
    """Columns and rows as runs of places, one axis or both in either order, and what speaks against them."""
    votes = _axis_votes(probes, [slots[i] for i in places])
    total = float(np.abs(votes).sum()) or 1.0
    # Places of a split: how much speaks against columns before it and rows after it.
    before = np.r_[0.0, np.cumsum(votes)]
    for sign, order in ((1, ("columns", "rows")), (-1, ("rows", "columns"))):
        support = sign * (2 * before - before[-1]) / total
        ranked = sorted(range(len(places) + 1), key=lambda k: -support[k])
        for k in ranked[:MOST_SPLITS]:
            if support[k] < LEAST_SUPPORT:
                break
            first: tuple[Axis, Sequence[int]] = (order[0], places[:k])  # type: ignore[assignment]
            second: tuple[Axis, Sequence[int]] = (order[1], places[k:])  # type: ignore[assignment]
            runs = tuple(run for run in (first, second) if run[1])
            if all(len(_joined(run[1])) == 1 or len(runs) == 1 for run in runs):
                yield runs, 1 - float(support[k])


def _joined(places: Sequence[int]) -> list[Sequence[int]]:
    """Runs of places without white or black between them; two of those are no one run of digits."""
    return _runs(places) or [places]


def _runs(places: Sequence[int]) -> list[Sequence[int]]:
    """Places in runs of those that follow each other."""
    cuts = [k for k in range(1, len(places)) if places[k] != places[k - 1] + 1]
    return [places[a:b] for a, b in zip([0, *cuts], [*cuts, len(places)], strict=True) if b > a]


def _axis_votes(probes: Probes, pictures: Sequence[int | None]) -> NDArray[np.float64]:
    """For each picture above zero when it varies across more than down, below when less; 0 when untold."""
    votes = []
    for picture in pictures:
        if picture is None:
            votes.append(0.0)
            continue
        across, down = probes.across.steps(picture), probes.down.steps(picture)
        votes.append((across - down) / max(across + down, 0.01))
    return np.array(votes)


def _axis_blocks(
    probes: Probes, axis: Axis, slots: Sequence[int | None], most_bits: Mapping[Axis, int]
) -> tuple[list[Block], float]:
    """Blocks of a run of pictures that code one axis, none if they do not, and what speaks against them."""
    lines = probes.across if axis == "columns" else probes.down
    present = [p for p in slots if p is not None]
    stripes = read_set(lines, slots)
    if stripes is not None:
        odd = odd_pairs(lines, slots, stripes)
        found, cost = [Block("stripes", tuple(slots), axis, stripes)], _cost(stripes) + ODD_PAIR * len(odd)
        # No projector needs such a digit: it is white and black that were taken once more.
        cost += UNLIKELY * (stripes.bits > most_bits.get(axis, stripes.bits))
    else:
        found, cost = [], np.inf
    if len(present) < len(slots):
        return found, cost
    others = [_with_phases(lines, axis, present, run) for run in sinusoid_runs(lines, present)[:MOST_RUNS]]
    strided = steps_of_strided(lines, present)
    if strided is not None:
        reading = read_phase_sets(lines, present, strided, "step")
        if reading is not None:
            others.append(([Block("phases", tuple(present), axis, reading)], _phase_cost(reading)))
    return min([(found, cost), *others], key=lambda each: each[1])


def _with_phases(
    lines: Lines, axis: Axis, present: Sequence[int], run: tuple[int, int, int]
) -> tuple[list[Block], float]:
    steps, start, end = run
    rest = [present[:start], present[end:]]
    if all(rest):
        return [], np.inf
    others = rest[0] or rest[1]
    reading = read_phase_sets(lines, present[start:end], steps, "set")
    if reading is None:
        return [], np.inf
    run_of_phases = tuple(present[start:end])
    phases = Block("phases", run_of_phases, axis, reading)
    if not others:
        return [phases], _phase_cost(reading)
    stripes = read_set(lines, others)
    if stripes is None:
        return [], np.inf
    block = Block("stripes", tuple(others), axis, stripes)
    off = reading.off_rad / MOST_OFF_RAD
    levels = [float(lines.of(picture).mean()) for picture in run_of_phases]
    if turn_nowhere(lines, run_of_phases[:steps]) and not any(DARK < level < BRIGHT for level in levels):
        # More lights than white and black, such as a picture with the lens covered; blurred digits are grey.
        phases = Block("skip", run_of_phases, axis)
    return ([block, phases] if rest[0] else [phases, block]), _cost(stripes) + off


def _cost(stripes: StripeReading) -> float:
    return stripes.roughness / ROUGH


def _phase_cost(phases: PhaseReading) -> float:
    return phases.off_rad / MOST_OFF_RAD + (UNTESTED if len(phases.fringes) == 1 else 0.0)
