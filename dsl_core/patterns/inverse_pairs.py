"""Which frames of a code are a pattern and its inverse, and which patterns of stripes have none."""

from __future__ import annotations

from collections.abc import Iterator

from dsl_core.model.captured_code import CapturedCode, Stripes
from dsl_core.model.plan import CodeSet, NoCode
from dsl_core.patterns.gray_code import bit_counts

Pair = tuple[int, int]


def inverse_pairs(code: CodeSet, size_px: tuple[int, int]) -> tuple[tuple[Pair, ...], ...]:
    """Pairs of frame numbers, for each set of stripes from its widest to its finest.

    ``size_px`` is the projector's (width, height). Empty for a code without inverses.
    """
    if isinstance(code, NoCode):
        return ()
    if isinstance(code, CapturedCode):
        return tuple(pairs for pairs in _captured(code) if pairs)
    columns, rows = bit_counts(code, size_px)
    pairs = tuple((2 * k, 2 * k + 1) for k in range(columns + rows))
    return tuple(each for each in (pairs[:columns], pairs[columns:]) if each)


def lone_stripes(code: CodeSet) -> tuple[tuple[int, ...], ...]:
    """Numbers of frames of stripes whose inverse is not there, for each set from its widest to its finest.

    Only codes of other programs have any.
    """
    if not isinstance(code, CapturedCode):
        return ()
    found, at = list[tuple[int, ...]](), 0
    for each in (*code.column_sets, *code.row_sets):
        if isinstance(each, Stripes):
            numbers = list[int]()
            first = at
            for bit in range(each.bits):
                frames = each.frames_of(bit)
                numbers += [first] if len(frames) == 1 else []
                first += len(frames)
            found.append(tuple(numbers))
        at += each.frame_count
    return tuple(each for each in found if each)


def _captured(code: CapturedCode) -> Iterator[tuple[Pair, ...]]:
    first = 0
    for each in (*code.column_sets, *code.row_sets):
        if isinstance(each, Stripes):
            found, at = list[Pair](), first
            for bit in range(each.bits):
                frames = each.frames_of(bit)
                if frames == (False, True):
                    found.append((at, at + 1))
                at += len(frames)
            yield tuple(found)
        first += each.frame_count
