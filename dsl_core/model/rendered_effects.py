"""What of light's behaviour was rendered in a simulated scan, as its notes say."""

from __future__ import annotations

from pydantic import ValidationError

from dsl_core.model.base import Record


class RenderedEffect(Record, extra="ignore"):
    """An effect of the twin: the most it changes, whether it was rendered, its seconds a frame, and why."""

    name: str
    what: str
    on: bool
    bound_dn: float
    bound_sigmas: float = 0.0
    cost_s: float = 0.0
    why: str


class RenderedEffects(Record, extra="ignore"):
    """The effects of a scan: how they were chosen, the time they took, as estimated, and each of them.

    ``left_out_bound`` is the most that all those left out change, in the tolerance's unit; seconds are of
    computing a frame.
    """

    choice: str
    tolerance: str
    left_out_bound: float = 0.0
    frame_s: float
    frame_with_all_s: float
    effects: tuple[RenderedEffect, ...]

    @property
    def saved_share(self) -> float:
        """Share of the computing that was saved."""
        return 1 - self.frame_s / self.frame_with_all_s if self.frame_with_all_s > 0 else 0.0

    @classmethod
    def of_note(cls, note: str) -> RenderedEffects | None:
        """The effects from a scan's note; None when it is not legible."""
        try:
            return cls.model_validate_json(note)
        except ValidationError:
            return None
