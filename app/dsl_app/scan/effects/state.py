"""Which effects of light a simulated rig renders, as the window knows it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from dsl_app.shared.evented import Value
from dsl_core.simulation.effects.tolerance import ONE_DN


class Wanted(Enum):
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
    """A decision on every effect of the scene at hand.

    ``left_out`` is the most that what is off changes, in words; ``frame_s`` and ``all_s`` are computing of a
    frame, of which the scan takes ``frames``.
    """

    rows: tuple[EffectRow, ...]
    left_out: str
    frame_s: float
    all_s: float
    frames: int

    @property
    def saved_share(self) -> float:
        """Share of the computing that is saved against rendering everything."""
        return 1 - self.frame_s / self.all_s if self.all_s > 0 else 0.0

    @property
    def on(self) -> tuple[str, ...]:
        """Names of what is rendered."""
        return tuple(row.name for row in self.rows if row.on)


class EffectsState:
    """Values that the controller sets and the panel follows.

    ``offered``: whether the rig is simulated. ``in_use`` and ``tolerance`` are those of the rig, ``view`` is
    what would be rendered by the choice looked at last.
    """

    def __init__(self) -> None:
        self.offered = Value(False)
        self.in_use = Value(Wanted.USUAL.value)
        self.tolerance = Value(ONE_DN)
        self.view: Value[EffectsView | None] = Value(None)
        self.busy = Value(False)
