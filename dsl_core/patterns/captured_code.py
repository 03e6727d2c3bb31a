"""Codes of other programs: what their frames show, and what they say of each pixel."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import DecodeError, PlanError
from dsl_core.model.captured_code import CapturedCode, Phases, Stripes
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.patterns.phases import phase_levels, read_phases
from dsl_core.patterns.reading import AxisReading, Measured
from dsl_core.patterns.stripes import read_stripes, stripe_levels


def captured_levels(spec: CapturedCode, size_px: tuple[int, int], index: int) -> NDArray[np.float64]:
    """Frame ``index`` of a code on a projector of (width, height) px, shape (height, width), 0..1.

    Raises `PlanError` for an index outside the code.
    """
    left = index
    for axis, sets in enumerate((spec.column_sets, spec.row_sets)):
        for each in sets:
            if 0 <= left < each.frame_count:
                line = (
                    stripe_levels(each, size_px[axis], left)
                    if isinstance(each, Stripes)
                    else phase_levels(each, size_px[axis], left)
                )
                shape = (size_px[1], size_px[0])
                return np.array(np.broadcast_to(line if axis == 0 else line[:, None], shape))
            left -= each.frame_count
    raise PlanError(f"The code has frames 0 to {spec.frame_count - 1}, not {index}.")


def decode_captured(
    spec: CapturedCode, size_px: tuple[int, int], frames: Iterable[Measured], white: Measured
) -> DecodedCode:
    """Columns and rows of all pixels from the frames of a code in its order, and white, all above black.

    Each frame is a pair of values and their variances, (rows, columns). Pixels for which columns are not
    coded are all undecided. Raises `DecodeError` when there are too few frames, or they do not say which
    period of a sinusoid a pixel is in.
    """
    sequence = _counted(frames, spec.frame_count)
    columns = _read_axis(spec.column_sets, size_px[0], sequence, white)
    rows = _read_axis(spec.row_sets, size_px[1], sequence, white)
    first = columns if columns is not None else rows
    assert first is not None
    undecided = columns.undecided if columns else np.ones(first.undecided.shape, bool)
    likely = _whole(columns, size_px[0]) if columns else np.zeros(undecided.shape, np.int32)
    row = None
    if rows is not None:
        row = np.where(rows.undecided, np.int32(-1), _whole(rows, size_px[1]))
    return DecodedCode(
        column=np.where(undecided, np.int32(-1), likely),
        likely_column=likely,
        row=row,
        margin=first.margin,
        margin_sigmas=first.margin_sigmas,
        undecided=undecided,
        fine_column_px=None if columns is None else columns.position_px,
        fine_std_px=None if columns is None else columns.std_px,
    )


def _read_axis(
    sets: Sequence[Stripes | Phases], count: int, frames: Iterator[Measured], white: Measured
) -> AxisReading | None:
    """What all sets of an axis say together; stripes come before the sinusoids that they count."""
    found: AxisReading | None = None
    for each in sets:
        if isinstance(each, Stripes):
            found = read_stripes(each, count, frames, white)
        else:
            found = read_phases(each, count, frames, found)
    return found


def _counted(frames: Iterable[Measured], wanted: int) -> Iterator[Measured]:
    for index, (value, variance) in enumerate(chain(frames, [(None, None)])):
        if value is None or variance is None:
            raise DecodeError(
                f"The code has {wanted} frames, given {index}. Import the folder again with all of them."
            )
        # A saturated value is a lower bound, which is as good as known.
        bounded = np.where(np.isfinite(variance), variance, np.square(value) * np.float32(4e-4))
        yield np.asarray(value, np.float32), np.asarray(bounded, np.float32)


def _whole(reading: AxisReading, count: int) -> NDArray[np.int32]:
    # Stripes of an even number of columns have their middle between two.
    nearest = np.floor(reading.position_px + np.float32(0.5))
    return np.asarray(nearest.clip(0, count - 1), np.int32)
