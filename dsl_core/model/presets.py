"""Plans and binary codes by name, and the exposures of a plan on a rig's projector."""

from __future__ import annotations

import math
from dataclasses import dataclass

from dsl_core.model.plan import (
    BinaryCode,
    CapturePlan,
    CodeSet,
    EnsembleCode,
    GrayCode,
    LineComb,
    ScanLines,
    Sentinels,
    Setting,
    XorCode,
)

#: Frame period of the published projector, ms: its exposures are whole multiples, so that every exposure
#: holds all of its coloured light.
PUBLISHED_PERIOD_MS = 1000.0 / 60.0
#: Columns of the published projector, which combs are stated for, and the farthest that lines move from frame
#: to frame: with edges more than two columns apart pixels between them do not find their column.
PUBLISHED_COLUMNS, FARTHEST_STEP_PX = 640, 4


@dataclass(frozen=True)
class Preset:
    """A plan with a name; ``purpose`` says in a sentence what it is for."""

    key: str
    title: str
    purpose: str
    plan: CapturePlan


def _setting(cycles: int, level: float) -> Setting:
    return Setting(exposure_ms=cycles * PUBLISHED_PERIOD_MS, level=level)


_DARK, _BRIGHT = _setting(10, 0.2), _setting(20, 0.8)
_COLUMNS = GrayCode(rows=False)
#: Where the first order of a line falls on the zero order of the next, a wavelength is lost: with periods of
#: 81 to 159 columns one in the middle of the spectrum, with 80 the very ends alone. Two periods of 64 columns
#: cost a little at about 540 nm.
_COMB, _COARSE_COMB = LineComb(period_px=80), LineComb(width_px=6, step_px=4, period_px=64)


def _plan(name: str, spectral: ScanLines | LineComb, *settings: Setting) -> CapturePlan:
    return CapturePlan(
        name=name,
        code=_COLUMNS,
        spectral=spectral,
        settings=settings,
        code_settings=tuple(range(len(settings))),
        sentinels=Sentinels(),
    )


PRESETS: tuple[Preset, ...] = (
    Preset(
        "preview",
        "Preview",
        "Combs of lines at two short settings: a first look at depth and spectra, captured in ten seconds"
        " (15 with 1280 columns).",
        # One setting alone takes 8 s, but where it spares the zero order its first orders drown in noise.
        _plan("preview", _COARSE_COMB, _setting(4, 0.2), _setting(6, 0.8)),
    ),
    Preset(
        "comb",
        "Comb",
        "Combs of lines at both settings: many lines at once.",
        _plan("comb", _COMB, _DARK, _BRIGHT),
    ),
    Preset(
        "quick",
        "Quick",
        "Single lines at one setting, each next to the last.",
        _plan("quick", ScanLines(step_px=5), _setting(20, 0.4)),
    ),
    Preset(
        "coarse",
        "Coarse",
        "Single lines, each next to the last, at both settings.",
        _plan("coarse", ScanLines(step_px=5), _DARK, _BRIGHT),
    ),
    Preset(
        "balanced",
        "Balanced",
        "Half as many lines as published, and no row code.",
        _plan("balanced", ScanLines(step_px=4), _DARK, _BRIGHT),
    ),
    Preset(
        "columns",
        "Published lines",
        "All lines as published, without the row code: equally accurate on the twin.",
        _plan("columns", ScanLines(), _DARK, _BRIGHT),
    ),
    Preset(
        "reference",
        "Reference",
        "As published: row and column code, 318 lines.",
        CapturePlan(sentinels=Sentinels()),
    ),
)


def preset_plan(name: str) -> CapturePlan | None:
    """The plan of a preset, for the published projector; None for a name that no preset has.

    >>> preset_plan("quick").settings[0].level
    0.4
    """
    return next((preset.plan for preset in PRESETS if preset.key == name), None)


def whole_cycles(exposure_ms: float, period_ms: float) -> int:
    """Whole LED cycles nearest to an exposure, at least one.

    >>> whole_cycles(166.7, 1000 / 60)
    10
    """
    return max(round(exposure_ms / period_ms), 1)


def on_cycles(plan: CapturePlan, period_ms: float) -> CapturePlan:
    """The plan with every exposure at whole cycles of a projector's frame period; the rest stays."""
    settings = tuple(_on_cycles(setting, period_ms) for setting in plan.settings)
    return plan.model_copy(update={"settings": settings})


def column_scale(width_px: int) -> float:
    """How many columns of a projector so wide show what one of the published projector shows, in halves.

    >>> column_scale(800), column_scale(1280), column_scale(1920)
    (1.0, 2.0, 3.0)
    """
    return max(round(2 * width_px / PUBLISHED_COLUMNS) / 2, 1.0)


def comb_on(comb: LineComb, width_px: int) -> LineComb:
    """What a comb of the published projector is on one of so many columns, unchanged up to 800.

    Of the same picture from more columns a nanometre of the first orders takes more: lines and period grow
    with them, in halves, and lines move by the same share of their width as far as columns are found so.

    >>> wide = comb_on(LineComb(width_px=5, step_px=2, period_px=80), 1280)
    >>> wide.width_px, wide.step_px, wide.period_px
    (10, 4, 160)
    """
    times = column_scale(width_px)
    if times == 1.0:
        return comb
    step_px = max(min(int(comb.step_px * times), FARTHEST_STEP_PX), comb.step_px)
    # Both edges of lines fall between different columns, half a step apart or nearly so.
    off_px = step_px // 2
    width = off_px + step_px * round((comb.width_px * times - off_px) / step_px)
    period_px = step_px * round(comb.period_px * times / step_px)
    red, green, blue = (round(shift * times) for shift in comb.shifts_px)
    return LineComb(width_px=width, step_px=step_px, period_px=period_px, shifts_px=(red, green, blue))


def on_columns(plan: CapturePlan, width_px: int) -> CapturePlan:
    """The plan for a projector of so many columns, if its comb is a preset's for its own projector's.

    Combs that somebody chose stay, and so do single lines: of narrow ones there are more.
    """
    for preset in PRESETS:
        comb = preset.plan.spectral
        if isinstance(comb, LineComb) and plan.spectral == comb_on(comb, plan.projector_size_px[0]):
            return plan.model_copy(update={"spectral": comb_on(comb, width_px)})
    return plan


def has_usual_exposures(plan: CapturePlan) -> bool:
    """Whether exposures and levels are those of a preset, or of a plan in which nobody set them.

    They are of the published projector, and fit no other one's cycles.
    """
    usual = (CapturePlan().settings, *(preset.plan.settings for preset in PRESETS))
    return any(
        len(settings) == len(plan.settings)
        and all(
            math.isclose(one.exposure_ms, other.exposure_ms) and math.isclose(one.level, other.level)
            for one, other in zip(settings, plan.settings, strict=True)
        )
        for settings in usual
    )


def _on_cycles(setting: Setting, period_ms: float) -> Setting:
    exposure_ms = whole_cycles(setting.exposure_ms, period_ms) * period_ms
    if math.isclose(exposure_ms, setting.exposure_ms):
        return setting
    return Setting(exposure_ms=exposure_ms, level=setting.level)


@dataclass(frozen=True)
class CodeChoice:
    """A binary code with its name on the command line and its title in the window."""

    name: str
    title: str
    code: BinaryCode


CODE_CHOICES: tuple[CodeChoice, ...] = (
    CodeChoice("full", "Columns and rows", GrayCode()),
    CodeChoice("columns", "Columns only", GrayCode(rows=False)),
    CodeChoice("xor-04", "Columns, XOR, 4 px", XorCode(rows=False, base_px=4)),
    CodeChoice("xor-02", "Columns, XOR, 2 px", XorCode(rows=False, base_px=2)),
    CodeChoice("ensemble-04", "Columns, Gray and XOR, 4 px", EnsembleCode(rows=False, base_px=4)),
    CodeChoice("ensemble-02", "Columns, Gray and XOR, 2 px", EnsembleCode(rows=False, base_px=2)),
    CodeChoice("full-xor-04", "Columns and rows, XOR, 4 px", XorCode(base_px=4)),
    CodeChoice("full-xor-02", "Columns and rows, XOR, 2 px", XorCode(base_px=2)),
    CodeChoice("full-ensemble-04", "Columns and rows, Gray and XOR, 4 px", EnsembleCode(base_px=4)),
    CodeChoice("full-ensemble-02", "Columns and rows, Gray and XOR, 2 px", EnsembleCode(base_px=2)),
)


def code_of(name: str) -> BinaryCode | None:
    """The code of a name; None for a name that no code has.

    >>> code_of("xor-02").base_px
    2
    """
    return next((choice.code for choice in CODE_CHOICES if choice.name == name), None)


def name_of(code: CodeSet) -> str | None:
    """The name of a code; None for no code."""
    return next((choice.name for choice in CODE_CHOICES if choice.code == code), None)
