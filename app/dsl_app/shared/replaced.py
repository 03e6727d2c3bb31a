"""Whether a result was replaced on disk after it had been read. No Qt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.shared.known_files import RESULT_NAME
from dsl_app.shared.paths import stamp_of
from dsl_core.errors import StoreError
from dsl_core.io.result.result_arrays import ResultArrays, load_arrays
from dsl_core.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

Stamp = tuple[int, int] | None


def result_stamp(result: Path) -> Stamp:
    """What `was_replaced` compares; taken before reading."""
    return stamp_of(result / RESULT_NAME)


def was_replaced(result: Path, stamp: Stamp) -> bool:
    """Whether another result has the path now; one that is gone, or was never read, was not replaced."""
    return stamp is not None and result_stamp(result) not in (None, stamp)


def read_stamped(path: Path, progress: Progress) -> ResultArrays:
    """A result, read whole, with its stamp; raises `StoreError`."""
    stamp = result_stamp(path)
    return replace(load_arrays(path, progress), stamp=stamp)


def load_as_read(result: ResultArrays) -> xr.Dataset:
    """The stored result that `read_stamped` has read; raises `StoreError` where another took its place."""
    from dsl_core.io.result.result_file import load_result

    if was_replaced(result.path, result.stamp):
        raise StoreError(
            f"{result.path} was replaced after it had been opened. Open it again and look at it first."
        )
    return load_result(result.path)
