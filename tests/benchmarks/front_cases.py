"""The plans that the front of accuracy against time is measured with, on the chart and on narrow filters."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Setting, SpectralSet
from dsl_core.model.rig import Rig
from dsl_core.planning.designed import designed_sets
from tests.benchmarks.sweep import Case

PALETTES = ("chart", "filters")
PERIOD_MS = 1000 / 60
#: Cycles and level of every setting.
Bracket = tuple[tuple[int, float], ...]
PUBLISHED: Bracket = ((10, 0.2), (20, 0.8))
BRIGHT: Bracket = ((4, 0.2), (20, 0.8))
BRACKETS: dict[str, Bracket] = {
    "short": ((2, 0.2), (8, 0.8)),
    "shorter": ((4, 0.2), (12, 0.8)),
    "long": ((10, 0.2), (40, 0.8)),
    "repeated": ((10, 0.2), (20, 0.8), (20, 0.8)),
    "repeated 3 times": ((10, 0.2), (20, 0.8), (20, 0.8), (20, 0.8)),
    "single": ((20, 0.4),),
    "dark": ((10, 0.2),),
}
LINES = ((5, 2), (5, 3), (5, 4), (5, 5), (8, 4), (10, 5), (3, 3), (16, 8), (8, 2), (3, 2))
COMBS = (
    (5, 2, 106), (5, 2, 128), (5, 2, 160), (5, 4, 104), (8, 4, 128), (5, 3, 105),
    (10, 5, 160), (5, 2, 80), (8, 4, 160), (5, 4, 164), (5, 3, 165), (5, 5, 165),
)  # fmt: skip
MORE_COMBS = (
    (6, 4, 64), (5, 2, 64), (6, 4, 96), (6, 4, 128), (5, 3, 96), (4, 3, 192), (6, 4, 48), (5, 2, 48),
    (5, 3, 63), (6, 4, 80), (7, 3, 72), (4, 2, 64), (9, 2, 64), (9, 2, 80), (9, 2, 128),
)  # fmt: skip
COLOURED = ((6, 4, 96), (5, 2, 80), (4, 3, 192), (5, 3, 96))
KNOBS = ("comb 6x4x64", "comb 9x2x80", "comb 9x2x64", "comb 5x2x80", "lines 5x4")


def line_sets() -> dict[str, SpectralSet]:
    """Lines, combs and combs in three colours by name."""
    found: dict[str, SpectralSet] = {f"lines {w}x{s}": ScanLines(width_px=w, step_px=s) for w, s in LINES}
    for w, s, p in (*COMBS, *MORE_COMBS):
        found[f"comb {w}x{s}x{p}"] = LineComb(width_px=w, step_px=s, period_px=p)
    for w, s, p in COLOURED:
        shifts = (0, round(p / 3), 2 * round(p / 3))
        found[f"colour comb {w}x{s}x{p}"] = LineComb(width_px=w, step_px=s, period_px=p, shifts_px=shifts)
    return found


def plan_of(name: str, spectral: SpectralSet, bracket: Bracket, rows: bool = False) -> CapturePlan:
    """A plan whose code and patterns take all settings."""
    return CapturePlan(
        name=name,
        code=GrayCode(rows=rows),
        spectral=spectral,
        settings=tuple(Setting(exposure_ms=n * PERIOD_MS, level=level) for n, level in bracket),
        code_settings=tuple(range(len(bracket))),
    )


def front_cases(rig: Rig) -> list[Case]:
    """All cases, those that answer most first."""
    found = [*_operating_point(), *_sets(), *_knobs()]
    found += [case for palette in PALETTES for case in designed_cases(rig, palette)]
    return found


def _operating_point() -> Iterator[Case]:
    """The published plan under every solver: the baselines."""
    for palette, solver in product(PALETTES, ("best", "nearest-line", "colour-basis", "published")):
        yield Case(
            name=f"published plan, {solver}, {palette}",
            plan=CapturePlan(name="published"),
            palette=palette,
            solver=solver,
        )


def _sets() -> Iterator[Case]:
    sets = line_sets()
    quick = [f"comb {w}x{s}x{p}" for w, s, p in MORE_COMBS]
    rest = [name for name in sets if name not in quick]
    for name, palette in product(quick, PALETTES):
        yield _case(name, sets[name], "published", PUBLISHED, palette)
    for name, palette in product(rest, PALETTES):
        yield _case(name, sets[name], "published", PUBLISHED, palette)


def _knobs() -> Iterator[Case]:
    """Exposures, levels and repeats; binning; the code of rows; bands; other solvers on fewer lines."""
    sets = line_sets()
    for name, (words, bracket), palette in product(KNOBS, BRACKETS.items(), PALETTES):
        yield _case(name, sets[name], words, bracket, palette)
    for name, palette in product((*KNOBS, "lines 5x2"), PALETTES):
        case = _case(name, sets[name], "published", PUBLISHED, palette)
        yield case.model_copy(update={"name": f"{case.name}, binned by 2", "binning": 2})
        yield case.model_copy(
            update={
                "name": f"{case.name}, rows coded",
                "plan": plan_of(f"{name}, rows coded", sets[name], PUBLISHED, rows=True),
            }
        )
    for name, palette in product(("comb 6x4x64", "comb 5x2x80"), PALETTES):
        case = _case(name, sets[name], "published", PUBLISHED, palette)
        yield case.model_copy(update={"name": f"{case.name}, every 10 nm", "step_nm": 10.0})
    for name, solver, palette in product(("lines 5x4", "lines 5x5"), ("nearest-line", "published"), PALETTES):
        case = _case(name, sets[name], "published", PUBLISHED, palette)
        yield case.model_copy(update={"name": f"{case.name}, {solver}", "solver": solver})
    for name, palette in product(sets, ("chart",)):
        if name not in KNOBS and "colour" not in name:
            yield _case(name, sets[name], "single", BRACKETS["single"], palette)


def designed_cases(rig: Rig, palette: str) -> list[Case]:
    """The designed sets that come with the program, with the published settings; the largest with all."""
    width = rig.projector.width_px
    sets = {name: columns for name, columns in designed_sets().items() if len(columns.levels[0]) == width}
    found = [_case(name, columns, "published", PUBLISHED, palette) for name, columns in sets.items()]
    largest = max(sets, key=lambda name: len(sets[name].levels), default=None)
    if largest is not None:
        found += [_case(largest, sets[largest], *knob, palette) for knob in BRACKETS.items()]
    return found


def _case(name: str, spectral: SpectralSet, words: str, bracket: Bracket, palette: str) -> Case:
    plan = plan_of(f"{name}, {words}", spectral, bracket)
    shown = plan.name if palette == "chart" else f"{plan.name}, {palette}"
    return Case(name=shown, plan=plan, palette=palette)
