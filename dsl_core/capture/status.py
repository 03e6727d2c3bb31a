"""What a runner tells about itself."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from dsl_core.model.plan import Shot


class State(StrEnum):
    """Where a scan stands; the last three are final."""

    IDLE = "idle"
    CHECKING = "checking"
    RUNNING = "running"
    PAUSED = "paused"
    CANCELLING = "cancelling"
    FINISHED = "finished"
    CANCELLED = "cancelled"
    FAILED = "failed"

    @property
    def is_final(self) -> bool:
        """Whether nothing more will happen."""
        return self in (State.FINISHED, State.CANCELLED, State.FAILED)


@dataclass(frozen=True)
class Status:
    """A moment of a scan; ``done`` counts stored frames, those of earlier runs included.

    ``elapsed_s`` is the time spent running, pauses left out; ``remaining_s`` is estimated from it.
    """

    state: State
    shot: Shot | None = None
    done: int = 0
    total: int = 0
    elapsed_s: float = 0.0
    remaining_s: float = 0.0
    message: str = ""
