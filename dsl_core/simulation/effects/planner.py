"""Which effects a scene calls for: the costliest are left out first, as far as their bounds allow."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from dsl_core.model.plan import CapturePlan, Setting
from dsl_core.model.rendered_effects import RenderedEffect, RenderedEffects
from dsl_core.simulation.effects.base import Effect, LightPath, Limits
from dsl_core.simulation.effects.catalogue import EFFECTS, USUAL
from dsl_core.simulation.effects.cost import PLAIN_MS, PLAIN_NS, slowness
from dsl_core.simulation.effects.tolerance import ONE_DN, EffectBound, Tolerance
from dsl_core.words import sentence


@dataclass(frozen=True)
class Decision:
    """Whether an effect is rendered, and why.

    ``cost_s`` is seconds of computing a frame, without the rendering in three ``colours`` that some share.
    """

    effect: Effect
    bound: EffectBound
    cost_s: float
    colours: bool
    on: bool
    why: str


@dataclass(frozen=True)
class EffectPlan:
    """A decision on every effect; what is left out changes no pixel by the tolerance or more.

    ``colour_s`` is what the plain renderer takes for a frame with a line in one colour.
    """

    tolerance: Tolerance
    decisions: tuple[Decision, ...]
    colour_s: float

    @property
    def names(self) -> frozenset[str]:
        """What is rendered."""
        return frozenset(decision.effect.name for decision in self.decisions if decision.on)

    @property
    def left_out(self) -> tuple[Decision, ...]:
        """What is not."""
        return tuple(decision for decision in self.decisions if not decision.on)

    @property
    def left_out_bound(self) -> float:
        """The most that everything left out changes, in the tolerance's unit."""
        return sum(self.tolerance.of_bound(decision.bound) for decision in self.left_out)

    def frame_s(self, names: Collection[str]) -> float:
        """CPU seconds of a frame with a line and some effects."""
        chosen = [decision for decision in self.decisions if decision.effect.name in names]
        colours = 3 if any(decision.colours for decision in chosen) else 1
        usual = sum(d.cost_s for d in self.decisions if d.effect.name in USUAL)
        plain = self.colour_s - usual + sum(d.cost_s for d in chosen if d.effect.name in USUAL)
        return colours * plain + sum(d.cost_s for d in chosen if d.effect.name not in USUAL)

    @property
    def seconds(self) -> tuple[float, float]:
        """CPU seconds of a frame with what is rendered, and with everything."""
        return self.frame_s(self.names), self.frame_s([d.effect.name for d in self.decisions])


def describe(plan: EffectPlan, choice: str) -> RenderedEffects:
    """The plan for files and other programs; ``choice`` is how the effects were asked for."""
    rendered_s, all_s = plan.seconds
    effects = tuple(
        RenderedEffect(
            name=d.effect.name,
            what=d.effect.summary,
            on=d.on,
            bound_dn=d.bound.dn,
            bound_sigmas=d.bound.sigmas,
            cost_s=d.cost_s,
            why=d.why,
        )
        for d in plan.decisions
    )
    return RenderedEffects(
        choice=choice,
        tolerance=str(plan.tolerance),
        left_out_bound=plan.left_out_bound,
        frame_s=rendered_s,
        frame_with_all_s=all_s,
        effects=effects,
    )


def plan_effects(
    path: LightPath,
    tolerance: Tolerance = ONE_DN,
    settings: Sequence[Setting] = CapturePlan().settings,
    only: Collection[str] | None = None,
) -> EffectPlan:
    """Decide on every effect of a path in which everything happens.

    ``settings`` are those of the plan. With ``only``, those effects are on and all others off.
    """
    limits = Limits(path, settings)
    bounds = {effect.name: effect.bound(limits) for effect in EFFECTS}
    costs = {effect.name: effect.cost_s(limits) for effect in EFFECTS}
    reasons = _forced(only, bounds) if only is not None else _weighed(bounds, costs, tolerance)
    decisions = tuple(
        Decision(
            effect,
            bounds[effect.name],
            costs[effect.name],
            effect.needs_colours(path),
            *reasons[effect.name],
        )
        for effect in EFFECTS
    )
    plain_s = 1e-9 * PLAIN_NS * limits.pixel_count + 1e-3 * PLAIN_MS
    return EffectPlan(tolerance, decisions, plain_s * slowness())


def _weighed(
    bounds: dict[str, EffectBound], costs: dict[str, float], tolerance: Tolerance
) -> dict[str, tuple[bool, str]]:
    """On or off and why, by name: what costs most is left out first, then what changes least."""
    reasons, spent = {}, 0.0
    order = sorted(EFFECTS, key=lambda e: (-costs[e.name], tolerance.of_bound(bounds[e.name])))
    for effect in order:
        bound, most = bounds[effect.name], tolerance.of_bound(bounds[effect.name])
        if effect.needed:
            reasons[effect.name] = (True, sentence(f"{bound.reason}; cannot be left out"))
        elif most == 0:
            reasons[effect.name] = (False, sentence(bound.reason))
        elif spent + most < tolerance.value:
            spent += most
            reasons[effect.name] = (
                False, sentence(f"{bound.reason}; that is at most {most:.2g} of the {tolerance} allowed"),
            )  # fmt: skip
        else:
            over = "alone" if most >= tolerance.value else "with what is left out already"
            reasons[effect.name] = (True, sentence(f"{bound.reason}; {over} more than {tolerance}"))
    return reasons


def _forced(only: Collection[str], bounds: dict[str, EffectBound]) -> dict[str, tuple[bool, str]]:
    return {
        name: (
            name in only,
            sentence(f"requested; {bound.reason}" if name in only else f"not requested; {bound.reason}"),
        )
        for name, bound in bounds.items()
    }
