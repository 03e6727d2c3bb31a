"""Whether a result was replaced on disk after it had been read. No Qt."""

from __future__ import annotations

from pathlib import Path

from dsl_app.shared.known_files import RESULT_NAME
from dsl_app.shared.paths import stamp_of

Stamp = tuple[int, int] | None


def result_stamp(result: Path) -> Stamp:
    """What `was_replaced` compares; taken before reading."""
    return stamp_of(result / RESULT_NAME)


def was_replaced(result: Path, stamp: Stamp) -> bool:
    """Whether another result has the path now; one that is gone, or was never read, was not replaced."""
    return stamp is not None and result_stamp(result) not in (None, stamp)
