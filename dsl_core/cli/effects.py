"""Which effects of the twin a scene needs, and what the others would cost."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import (
    Effects,
    Json,
    PlanChoice,
    PlanSource,
    RigOptions,
    Tolerance,
    parse_options,
    with_effects,
)
from dsl_core.cli.output import Output
from dsl_core.errors import DeviceError

if TYPE_CHECKING:
    from dsl_core.simulation.effects.planner import Decision, EffectPlan


def in_words(number: float) -> str:
    """Three digits, without an exponent where it is large.

    >>> in_words(0.6667), in_words(94731.2)
    ('0.667', '94731')
    """
    return f"{number:.0f}" if abs(number) >= 100 else f"{number:.3g}"


def effects(
    scene: Annotated[
        str | None, typer.Option(help="A scene of the twin; 'dsl-scan scenes' lists them.")
    ] = None,
    option: RigOptions = [],  # noqa: B006 - typer reads it, nobody changes it
    effects: Effects = "auto",
    tolerance: Tolerance = None,
    plan: PlanSource = None,
    json: Json = False,
) -> None:
    """Show which effects of light a scene needs, and why: how much each changes at most, and its cost."""
    from dsl_core.capture.preflight import fit_plan
    from dsl_core.devices.registry import open_rig
    from dsl_core.simulation.effects.planner import describe
    from dsl_core.simulation.sim_devices import SimCamera

    output, options = Output(json), parse_options(option)
    if scene is not None:
        if "scene" in options:
            raise DeviceError("Give the scene as --scene or as --option scene=..., not both.")
        options["scene"] = scene
    if "effects" not in options:
        options = with_effects(options, effects, None)
    captured = PlanChoice(plan).build()
    with open_rig("twin", with_effects(options, None, tolerance)) as rig:
        assert isinstance(rig.camera, SimCamera)
        world = rig.camera.world
        # Exposures of a scan are whole cycles of the LEDs where the camera can.
        captured = fit_plan(captured, rig)
        made = world.effect_plan(replace(world.request, settings=captured.settings))
    output.table(
        ("effect", "what it is", "changes at most", "cost per frame", "", "why"),
        [_row(decision) for decision in made.decisions],
    )
    output.say(_left_out(made))
    output.say(_saved(made, captured.shot_count))
    output.put(**describe(made, world.request.choice.text).model_dump(), frames=captured.shot_count)
    output.finish()


def _row(decision: Decision) -> tuple[str, ...]:
    bound, effect = decision.bound, decision.effect
    change = f"{in_words(bound.dn)} DN, {in_words(bound.sigmas)} σ"
    cost = f"{1e3 * decision.cost_s:.1f} ms" if decision.cost_s else "-"
    return effect.name, effect.summary, change, cost, "on" if decision.on else "off", decision.why


def _left_out(plan: EffectPlan) -> str:
    bound = f"{in_words(plan.left_out_bound)} {plan.tolerance.unit}"
    return f"The effects left out change no pixel by more than {bound}; the tolerance is {plan.tolerance}."


def _saved(plan: EffectPlan, frames: int) -> str:
    rendered, everything = plan.seconds
    saved, share = everything - rendered, 100 * (1 - rendered / everything)
    return (
        f"A frame with a line takes about {1e3 * rendered:.0f} ms to compute, {1e3 * everything:.0f} ms with"
        f" all effects: {frames} frames take {frames * saved:.0f} s ({share:.0f} %) less."
    )
