"""Commands that weigh accuracy against time: tradeoff, design."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dsl_core.cli.options import CalibrationName, Force, Json, RigName, RigOptions, html_page, parse_options
from dsl_core.cli.output import Output
from dsl_core.errors import CalibrationError, PlanError
from dsl_core.io.staging import check_targets
from dsl_core.words import quoted

if TYPE_CHECKING:
    from dsl_core.devices.base import DeviceRig
    from dsl_core.model.rig import Rig
    from dsl_core.planning.choice import Weighed

#: A plan that is expected to give depth to less of the picture is told to.
FULL_COVERAGE = 0.9


def tradeoff(
    budget: Annotated[
        str | None, typer.Option("--budget", help="Longest time for the capture, like 60s or 2min.")
    ] = None,
    error: Annotated[
        float | None, typer.Option("--error", help="Reflectance error of a pixel that is accurate enough.")
    ] = None,
    rig: RigName = "twin",
    option: RigOptions = [],  # noqa: B006 - typer reads it, nobody changes it
    calibration: CalibrationName = None,
    look: Annotated[
        Path | None, typer.Option("--look", help="Result of a quick scan of the scene to plan for.")
    ] = None,
    plan: Annotated[Path | None, typer.Option("--plan", help="Write the chosen plan to this file.")] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", callback=html_page, help="Write all plans as an HTML page."),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Choose the plan predicted to be most accurate in a time budget, or fastest for an error."""
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.plan_file import save_plan
    from dsl_core.io.result.result_file import load_result
    from dsl_core.planning.choice import choose, pareto, possible_plans, weigh
    from dsl_core.planning.store import PredictionStore, store_folder

    output, budget_s = Output(json), None if budget is None else parse_seconds(budget)
    if error is not None and not 0 < error < math.inf:
        raise PlanError(f"--error must be a number above 0, such as 0.01, not {error:g}.")
    check_targets([path for path in (plan, report) if path is not None], overwrite=force)
    seen = None if look is None else load_result(look)
    with open_rig(rig, parse_options(option)) as devices:
        known = _calibration(devices, calibration)
        latency_ms, plans = devices.projector.info.latency_ms, possible_plans(devices, known)
    view = None
    if seen is not None:
        from dsl_core.planning.samples import scene_samples  # loads torch, which known predictions need not

        view = scene_samples(known, seen)
    with output.progress() as progress:
        limit_s = None if report else budget_s
        store = PredictionStore(store_folder(), known, latency_ms) if view is None else None
        weighed = weigh(
            known, plans, view, latency_ms=latency_ms, budget_s=limit_s, progress=progress, store=store
        )
    chosen = choose(weighed, budget_s, error)
    front = pareto(weighed)
    _tell(output, front if chosen in front else sorted([*front, chosen], key=_seconds), chosen)
    if view is None or view.black_dn_per_ms is None:
        output.say(
            "This is for a dark room: a scan made in the light of yours, as --look, tells what it costs."
        )
    if report is not None:
        from dsl_core.planning.report import write_tradeoff_report

        output.put(report=write_tradeoff_report(weighed, chosen, report, overwrite=force))
        output.say(f"All plans are compared in {report}.")
    if plan is not None:
        save_plan(chosen.plan, plan, overwrite=force)
        output.put(plan_file=plan)
        output.say(
            f"The plan is saved in {plan}."
            f" Next: dsl-scan scan SCAN.dsl --plan {quoted(plan)} and the same rig."
        )
    output.finish()


def design(
    target: Annotated[Path, typer.Argument(metavar="SET.json", help="File to write.")],
    frames: Annotated[
        int, typer.Option("--frames", help="Number of patterns, 8 to 160.", min=8, max=160)
    ] = 32,
    rig: RigName = "twin",
    option: RigOptions = [],  # noqa: B006
    calibration: CalibrationName = None,
    orders: Annotated[
        int,
        typer.Option(
            "--orders", help="Orderings of the best lines to try; more take longer.", min=1, max=10_000
        ),
    ] = 24,
    plan: Annotated[
        Path | None, typer.Option("--plan", help="Also write a plan with these patterns.")
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Design patterns for a calibrated rig: the least expected error for a number of frames."""
    from dsl_core.capture.preflight import require_possible
    from dsl_core.devices.registry import open_rig
    from dsl_core.io.plan_file import save_plan
    from dsl_core.model.plan import CapturePlan, GrayCode, Sentinels

    output = Output(json)
    check_targets([path for path in (target, plan) if path is not None], overwrite=force)
    with open_rig(rig, parse_options(option)) as devices:
        known = _calibration(devices, calibration)
        base = CapturePlan(name=f"designed {frames}", code=GrayCode(rows=False), sentinels=Sentinels())
        base = base.sized(known.camera, known.projector)
        if plan is not None:
            require_possible(replace(devices, calibration=None), base)  # reported before the search
    # These load torch, which a refusal does not wait for.
    from dsl_core.planning.design import design as search
    from dsl_core.planning.designed import DesignedSet, packed, save_design

    with output.progress() as progress:
        found = search(known, base, frames, orders=orders, progress=progress)
    made = DesignedSet(
        name=f"designed {frames}",
        rig=known.name,
        command=f"dsl-scan design {quoted(target.name)} --frames {frames} --orders {orders}",
        frames=frames,
        width_px=found.levels.shape[1],
        lines=found.lines.name,
        comb_error=round(found.comb_error, 6),
        error=round(found.error, 6),
        levels=packed(found.levels),
    )
    save_design(made, target, overwrite=force)
    output.say(
        f"{frames} patterns are saved in {target}: {made.lines}; expected error {made.error:.4f},"
        f" {made.comb_error:.4f} with the best comb."
    )
    output.put(set=target, lines=made.lines, comb_error=made.comb_error, error=made.error)
    if plan is not None:
        save_plan(base.model_copy(update={"spectral": found.columns}), plan, overwrite=force)
        output.put(plan_file=plan)
    output.finish()


def parse_seconds(text: str) -> float:
    """Seconds from ``60``, ``60s`` or ``2min``; raises `PlanError`.

    >>> parse_seconds("2min")
    120.0
    """
    units = {"min": 60.0, "s": 1.0}
    unit = next((unit for unit in units if text.endswith(unit)), "")
    try:
        value = float(text.removesuffix(unit)) * units.get(unit, 1.0)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise PlanError(f"--budget must be a time like 60s or 2min, not {text!r}.")
    return value


def _calibration(devices: DeviceRig, name: str | None) -> Rig:
    from dsl_core.io.calibration_library import load_calibration

    known = load_calibration(name) if name else devices.calibration
    if known is None:
        raise CalibrationError(
            f"The rig {devices.name!r} has no calibration to predict with. Name one with --calibration."
        )
    return known


def _seconds(weighed: Weighed) -> float:
    return weighed.expected.seconds


def _tell(output: Output, front: list[Weighed], chosen: Weighed) -> None:
    rows = [
        (
            "*" if each.plan is chosen.plan else "",
            each.plan.name,
            each.expected.frames,
            f"{each.expected.seconds:.0f}",
            f"{each.expected.computing_s:.0f}",
            f"{each.expected.pixel_rmse:.4f}",
            f"{each.expected.pixel_angle_rad:.3f}",
            f"{each.expected.depth_std_mm:.2f}",
        )
        for each in front
    ]
    output.say("Plans that no other beats in both time and expected error:")
    output.table(
        ("", "plan", "frames", "s", "computing s", "error of a pixel", "angle rad", "depth mm"), rows
    )
    e = chosen.expected
    output.say(
        f"Chosen: {chosen.plan.name}: {e.frames} frames in {e.seconds:.0f} s, expected reflectance error"
        f" {e.pixel_rmse:.4f} per pixel, depth {e.depth_std_mm:.2f} mm, {e.computing_s:.0f} s of computing."
    )
    if e.coverage < FULL_COVERAGE:
        output.say(
            f"Only {e.coverage:.0%} of the picture is expected to get a depth and a spectrum: the rest is too"
            " dark or too bright for this plan. Choose longer or shorter exposures, or more or less light."
        )
    output.put(chosen=chosen.plan.name, expected=e.model_dump())
    output.put(front=[{"plan": each.plan.name, **each.expected.model_dump()} for each in front])
