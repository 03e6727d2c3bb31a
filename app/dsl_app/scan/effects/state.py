"""The state of the Effects tab."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from dsl_app.shared.evented import Value
from dsl_core.simulation.effects.tolerance import ONE_DN

if TYPE_CHECKING:
    from dsl_core.simulation.effects.planner import EffectPlan


class EffectChoice(Enum):
    """How effects are chosen; the values are those of the command line, ``CHOSEN`` stands for names."""

    USUAL = "usual"
    AUTO = "auto"
    ALL = "all"
    NONE = "none"
    CHOSEN = "chosen"


@dataclass(frozen=True)
class EffectsView:
    """A decision on every effect of the current scene, for a scan of so many ``frames``."""

    plan: EffectPlan
    frames: int

    @property
    def summary(self) -> str:
        """How much is rendered, and what the rest would change at most."""
        plan = self.plan
        return (
            f"{len(plan.names)} of {len(plan.decisions)} effects are rendered. The others change no pixel of"
            f" any picture by more than {plan.left_out_bound:.3g} {plan.tolerance.unit}."
        )

    @property
    def saved(self) -> str:
        """How long frames take to compute, and how much less that is than with all effects."""
        frame_s, all_s = self.plan.seconds
        share = 1 - frame_s / all_s if all_s > 0 else 0.0
        return (
            f"A frame takes about {1e3 * frame_s:.0f} ms to compute, {1e3 * all_s:.0f} ms with all effects."
            f" This saves {100 * share:.0f} %, or {self.frames * (all_s - frame_s):.0f} s for all"
            f" {self.frames} frames."
        )


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
