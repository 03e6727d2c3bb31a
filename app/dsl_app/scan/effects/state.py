"""The state of the Effects tab."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dsl_app.shared.evented import Value
from dsl_core.simulation.effects.tolerance import ONE_DN


class EffectChoice(Enum):
    """How effects are chosen; the values are those of the command line, ``CHOSEN`` stands for names."""

    USUAL = "usual"
    AUTO = "auto"
    ALL = "all"
    NONE = "none"
    CHOSEN = "chosen"


@dataclass(frozen=True)
class EffectRow:
    """An effect: the most it changes (counts, sigmas of a dark pixel), its seconds a frame, and why."""

    name: str
    what: str
    bound_dn: float
    bound_sigmas: float
    cost_s: float
    on: bool
    needed: bool
    why: str


@dataclass(frozen=True)
class EffectsView:
    """A decision on every effect of the current scene.

    ``left_out`` bounds the change by all effects that are off, in words; ``frame_s`` and ``all_s`` are the
    computing times of a frame with this choice and with all effects; the scan has ``frames``.
    """

    rows: tuple[EffectRow, ...]
    left_out: str
    frame_s: float
    all_s: float
    frames: int

    @property
    def saved_share(self) -> float:
        """Share of computing saved, compared with rendering everything."""
        return 1 - self.frame_s / self.all_s if self.all_s > 0 else 0.0

    @property
    def on(self) -> tuple[str, ...]:
        """Names of the rendered effects."""
        return tuple(row.name for row in self.rows if row.on)


class EffectsState:
    """Values that the controller sets and the panel follows.

    ``offered``: whether the rig is simulated. ``in_use`` and ``tolerance`` are those of the rig, ``view`` is
    what the last choice would render.
    """

    def __init__(self) -> None:
        self.offered = Value(False)
        self.in_use = Value(EffectChoice.USUAL.value)
        self.tolerance = Value(ONE_DN)
        self.view: Value[EffectsView | None] = Value(None)
        self.busy = Value(False)
