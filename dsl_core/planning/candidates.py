"""Plans worth weighing: pattern sets of every kind times exposures in whole LED cycles."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Setting, SpectralSet
from dsl_core.model.rig import Rig
from dsl_core.planning.designed import designed_sets

#: Width and step of single lines; width, step and period of combs, px; those whose two edges fall between
#: different columns find the column best.
LINES = ((5, 2), (5, 3), (5, 4), (8, 2))
COMBS = (
    (6, 4, 64), (5, 2, 64), (6, 4, 128), (5, 3, 96), (5, 2, 80), (9, 2, 64), (9, 2, 80), (4, 3, 192),
)  # fmt: skip
#: Cycles and levels of the settings of a bracket; a setting twice is a repeat.
BRACKETS = (
    ((10, 0.2), (20, 0.8)),
    ((2, 0.2), (8, 0.8)),
    ((4, 0.2), (12, 0.8)),
    ((10, 0.2), (40, 0.8)),
    ((10, 0.2), (20, 0.8), (20, 0.8), (20, 0.8)),
    ((20, 0.4),),
)


def candidate_plans(rig: Rig) -> Iterator[CapturePlan]:
    """All combinations on a rig, the published plan first."""
    size = {
        "camera_size_px": (rig.camera.width_px, rig.camera.height_px),
        "projector_size_px": (rig.projector.width_px, rig.projector.height_px),
    }
    yield CapturePlan(name="published").model_copy(update=size)
    for (name, spectral), bracket in product(pattern_sets(rig).items(), BRACKETS):
        settings = tuple(
            Setting(exposure_ms=cycles * rig.frame_period_ms, level=level) for cycles, level in bracket
        )
        words = " + ".join(f"{cycles}@{level:g}" for cycles, level in bracket)
        yield CapturePlan(
            name=f"{name}, {words} cycles",
            code=GrayCode(rows=False),
            spectral=spectral,
            settings=settings,
            code_settings=tuple(range(len(settings))),
        ).model_copy(update=size)


def pattern_sets(rig: Rig) -> dict[str, SpectralSet]:
    """Pattern sets by name that fit a rig's projector."""
    found: dict[str, SpectralSet] = {f"lines {w}x{s}": ScanLines(width_px=w, step_px=s) for w, s in LINES}
    for w, s, p in COMBS:
        found[f"comb {w}x{s}x{p}"] = LineComb(width_px=w, step_px=s, period_px=p)
        third = round(p / 3)
        found[f"colour comb {w}x{s}x{p}"] = LineComb(
            width_px=w, step_px=s, period_px=p, shifts_px=(0, third, 2 * third)
        )
    width = rig.projector.width_px
    return found | {
        name: columns for name, columns in designed_sets().items() if len(columns.levels[0]) == width
    }
