"""The plan that answers a request: the most accurate within a budget, or the quickest that is good enough.

Plans to choose from are pattern sets of every kind times exposures in whole LED cycles.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

from dsl_core.capture.preflight import find_obstacles
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Sentinels, Setting, SpectralSet
from dsl_core.model.presets import PUBLISHED_PERIOD_MS, column_scale, comb_on
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.spectra import ORDERS, chain_response
from dsl_core.planning.designed import designed_sets
from dsl_core.planning.expected import Prediction
from dsl_core.progress import NoProgress, Progress
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.front import front

if TYPE_CHECKING:
    from dsl_core.planning.samples import SamplePixels
    from dsl_core.planning.store import PredictionStore

#: Width and step of single lines; width, step and period of combs of the published projector, px; those whose
#: two edges fall between different columns find the column best.
LINES = ((5, 2), (5, 3), (5, 4), (8, 2))
COMBS = (
    (6, 4, 64), (5, 2, 64), (6, 4, 128), (5, 3, 96), (5, 2, 80), (9, 2, 64), (9, 2, 80), (4, 3, 192),
)  # fmt: skip
#: Cycles and levels of the settings of a bracket; a setting twice is a repeat.
Exposures = tuple[tuple[int, float], ...]
#: Those of the published rig.
BRACKETS: tuple[Exposures, ...] = (
    ((10, 0.2), (20, 0.8)),
    ((2, 0.2), (8, 0.8)),
    ((4, 0.2), (12, 0.8)),
    ((10, 0.2), (40, 0.8)),
    ((10, 0.2), (20, 0.8), (20, 0.8), (20, 0.8)),
    ((20, 0.4),),
)


#: Plans that give depth to less than this share of what the best of them reaches are no choice: their figures
#: are of the few pixels that are left.
COVERING = 0.9


@dataclass(frozen=True)
class Weighed:
    """A plan and what is expected of it."""

    plan: CapturePlan
    expected: Prediction


def weigh(
    rig: Rig,
    plans: Iterable[CapturePlan],
    view: SamplePixels | None = None,
    *,
    latency_ms: float = 0.0,
    budget_s: float | None = None,
    progress: Progress | None = None,
    store: PredictionStore | None = None,
) -> list[Weighed]:
    """Predict every plan that takes no longer than the budget.

    A ``store`` of the same rig, latency and view is asked first, and keeps what is new.
    Raises `PlanError` where every plan takes longer.
    """
    progress = progress or NoProgress()
    seconds = [(plan, plan.duration_s(latency_ms)) for plan in plans]
    todo = [plan for plan, takes_s in seconds if budget_s is None or takes_s <= budget_s]
    if budget_s is not None and seconds and not todo:
        quickest, takes_s = min(seconds, key=lambda each: each[1])
        raise _too_slow(budget_s, quickest, takes_s)
    found = []
    for done, plan in enumerate(todo, 1):
        expected = None if store is None else store.find(plan, peaks=False)
        if expected is None:
            from dsl_core.planning.prediction import predict
            from dsl_core.planning.samples import plane_samples

            view = view or plane_samples(rig)
            expected = predict(rig, plan, view, latency_ms=latency_ms, peaks=False)
            if store is not None:
                store.keep(plan, expected, peaks=False)
        found.append(Weighed(plan, expected))
        progress.report("plans", done, len(todo))
    if store is not None:
        store.save()
    return found


def pareto(weighed: Sequence[Weighed]) -> list[Weighed]:
    """The plans worth their time: none that covers the picture is both quicker and more accurate."""
    able = covering(weighed)
    return [able[i] for i in front([(each.expected.seconds, each.expected.pixel_rmse) for each in able])]


def covering(weighed: Sequence[Weighed]) -> list[Weighed]:
    """The plans that give depth to about as much of the picture as any of them does."""
    most = max((each.expected.coverage for each in weighed), default=0.0)
    return [each for each in weighed if each.expected.coverage >= COVERING * most]


def choose(weighed: Sequence[Weighed], budget_s: float | None = None, error: float | None = None) -> Weighed:
    """The quickest plan with at most ``error`` (pixel RMSE), or the most accurate within the budget.

    Both are sought among those that cover the picture.
    Raises `PlanError` that says what could be had.
    """
    able = [each for each in weighed if budget_s is None or each.expected.seconds <= budget_s]
    if budget_s is not None and not able:
        quickest = min(weighed, key=lambda each: each.expected.seconds)
        raise _too_slow(budget_s, quickest.plan, quickest.expected.seconds)
    able = covering(able)
    best = min(able, key=lambda each: (each.expected.pixel_rmse, each.expected.seconds))
    if error is None:
        return best
    good = [each for each in able if each.expected.pixel_rmse <= error]
    if not good:
        within = "" if budget_s is None else f" within {budget_s:g} s"
        raise PlanError(
            f"No plan is expected to reach a reflectance error of {error:g}{within}; the best,"
            f" {best.plan.name!r}, reaches {best.expected.pixel_rmse:.4f} in {best.expected.seconds:.0f} s."
        )
    return min(good, key=lambda each: (each.expected.seconds, each.expected.pixel_rmse))


def _too_slow(budget_s: float, quickest: CapturePlan, takes_s: float) -> PlanError:
    # Rounded up, as a budget of what is named here has to be enough.
    return PlanError(
        f"No plan takes at most {budget_s:g} s on this rig; the quickest, {quickest.name!r}, takes"
        f" {math.ceil(10 * takes_s - 1e-6) / 10:g} s. Allow more time, or lower its latency."
    )


def candidate_plans(rig: Rig, longest_ms: float = math.inf) -> Iterator[CapturePlan]:
    """All combinations on a rig whose camera exposes for at most so long, the published plan first."""
    yield CapturePlan(name="published", sentinels=Sentinels()).sized(rig.camera, rig.projector)
    for (name, spectral), bracket in product(pattern_sets(rig).items(), brackets_on(rig, longest_ms)):
        settings = tuple(
            Setting(exposure_ms=cycles * rig.frame_period_ms, level=level) for cycles, level in bracket
        )
        words = " + ".join(f"{cycles}@{level:g}" for cycles, level in bracket)
        plan = CapturePlan(
            name=f"{name}, {words} cycles",
            code=GrayCode(rows=False),
            spectral=spectral,
            settings=settings,
            code_settings=tuple(range(len(settings))),
            sentinels=Sentinels(),
        )
        yield plan.sized(rig.camera, rig.projector)


def brackets_on(rig: Rig, longest_ms: float) -> list[Exposures]:
    """The brackets in whole cycles of a rig's projector, each once.

    They gather as much light as on the published rig; where there is less, others that are as quick as there
    are offered as well. One with an exposure above ``longest_ms`` is shortened as a whole.
    """
    times, most = light_scale(rig), longest_ms / rig.frame_period_ms
    found: dict[Exposures, None] = {}
    for scale, bracket in product((times, min(times, 1.0)), BRACKETS):
        wanted = [cycles * scale * PUBLISHED_PERIOD_MS / rig.frame_period_ms for cycles, _ in bracket]
        share = min(1.0, most / max(wanted))
        whole = [max(int(min(round(cycles * share), most)), 1) for cycles in wanted]
        found[tuple((cycles, level) for cycles, (_, level) in zip(whole, bracket, strict=True))] = None
    return list(found)


def light_scale(rig: Rig) -> float:
    """How many times as long as on the published rig first orders take to fill the sensor, a power of two.

    1 for a rig without first orders.
    """
    own = _range_per_ms(rig)
    return float(2.0 ** round(math.log2(_range_per_ms(published_rig()) / own))) if own > 0 else 1.0


def _range_per_ms(rig: Rig) -> float:
    """Share of the sensor's range that white in a first order fills in a ms, in the brightest colour."""
    nm, sensor = WavelengthGrid().centres_nm, rig.sensor
    light_dn = max(chain_response(rig, order, nm).sum((1, 2)).max() for order in ORDERS)
    shading = (rig.reference_distance_mm / rig.usual_depth_mm) ** 2
    return float(light_dn * shading / (sensor.full_scale_dn - sensor.black_level_dn))


def possible_plans(devices: DeviceRig, rig: Rig) -> list[CapturePlan]:
    """The combinations that devices of this calibration can capture; raises `PlanError` if there is none."""
    # Whether the devices are still as they were calibrated is the scan's question, and can be mended.
    bare, camera = replace(devices, calibration=None), devices.camera.info
    found = [(plan, find_obstacles(bare, plan)) for plan in candidate_plans(rig, camera.exposure_range_ms[1])]
    able = [plan for plan, obstacles in found if not obstacles]
    if not able:
        plan, obstacles = min(found, key=lambda each: len(each[1]))
        advice = "Use a camera that exposes for a colour cycle of the projector or longer."
        if plan != plan.sized(camera, devices.projector.info):
            advice = "Name a rig and a calibration of one kind."
        raise PlanError(
            f"None of {len(found)} plans for the calibration {rig.name!r} is possible on the rig"
            f" {devices.name!r}: {'; '.join(obstacles)}. {advice}"
        )
    return able


def pattern_sets(rig: Rig) -> dict[str, SpectralSet]:
    """Pattern sets by name that fit a rig's projector.

    Single lines are offered as they are, which find columns best, and as many times as wide and as far apart
    as a projector has more columns: those take no more frames on it.
    """
    found: dict[str, SpectralSet] = {}
    width = rig.projector.width_px
    for times, (line, step) in product((1.0, column_scale(width)), LINES):
        lines = ScanLines(width_px=round(line * times), step_px=int(step * times))
        found[f"lines {lines.width_px}x{lines.step_px}"] = lines
    for comb in (LineComb(width_px=w, step_px=s, period_px=p) for w, s, p in COMBS):
        one = comb_on(comb, width)
        name, third = f"comb {one.width_px}x{one.step_px}x{one.period_px}", round(one.period_px / 3)
        found[name] = one
        found[f"colour {name}"] = one.model_copy(update={"shifts_px": (0, third, 2 * third)})
    return found | {
        name: columns for name, columns in designed_sets().items() if len(columns.levels[0]) == width
    }
