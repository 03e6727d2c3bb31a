"""What of light's behaviour was rendered in a simulated scan, as its notes say."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class RenderedEffect:
    """An effect of the twin: the most it changes (DN), whether it was rendered, and why."""

    name: str
    what: str
    on: bool
    bound_dn: float
    why: str


@dataclass(frozen=True)
class RenderedEffects:
    """The effects of a scan: how they were chosen, the time they took, as estimated, and each of them."""

    choice: str
    tolerance: str
    frame_s: float
    frame_with_all_s: float
    effects: Sequence[RenderedEffect]

    @property
    def saved_share(self) -> float:
        """Share of the computing that was saved."""
        return 1 - self.frame_s / self.frame_with_all_s if self.frame_with_all_s > 0 else 0.0

    @classmethod
    def of_note(cls, note: str) -> RenderedEffects | None:
        """The effects from a scan's note; None when it is not legible."""
        try:
            data = json.loads(note)
            return cls(
                str(data["choice"]),
                str(data["tolerance"]),
                float(data["frame_s"]),
                float(data["frame_with_all_s"]),
                tuple(
                    RenderedEffect(
                        str(e["name"]), str(e["what"]), bool(e["on"]), float(e["bound_dn"]), str(e["why"])
                    )
                    for e in data["effects"]
                ),
            )
        except (KeyError, TypeError, ValueError):
            return None
