"""What each page saves in the session, and how it is restored from it. No Qt."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import TypeVar

from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.state import PairState, Side
from dsl_app.compare.series.controller import SeriesController
from dsl_app.compare.series.state import SeriesKind, SeriesState
from dsl_app.results.controller import ResultsController, is_complete
from dsl_app.results.state import QualityMap, ResultsState, ResultView
from dsl_app.scan.controller import ScanController
from dsl_app.scan.state import CalibrationChoice, ScanState, preset_of
from dsl_app.session.records import ComparePart, ResultsPart, ScanPart, SeriesPart
from dsl_app.shared.evented import Value
from dsl_app.shared.paths import is_file, there
from dsl_core.evaluation.time_sweep import FIGURES
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.presets import on_cycles

E = TypeVar("E", bound=Enum)
#: The plan that a page begins with does not need to be restored.
_FIRST_PLAN = "reference"


def results_part(state: ResultsState) -> ResultsPart | None:
    """The result that is open and its views."""
    result = state.saved_result
    if result is None:
        return None
    return ResultsPart(
        path=result.path,
        view=state.view.value.value,
        cloud_by=state.cloud_by.value.value,
        quality=state.quality.value.value,
        band=state.band.value,
        light=state.light.value,
        adapted=state.adapted.value,
        cursor=state.cursor.value,
        depth_limits=state.depth_limits.value,
    )


def restore_result(part: ResultsPart, control: ResultsController) -> None:
    """Open the result again, and restore its views once it is read."""
    state = control.state

    def look(result: ResultArrays) -> None:
        if part.cursor is not None:
            control.point_at(part.cursor)
        if result.has_spectra:
            control.step_band(part.band - state.band.value)
        _set_named(state.cloud_by, ResultView, part.cloud_by)
        _set_named(state.quality, QualityMap, part.quality)
        state.depth_limits.set(part.depth_limits)
        view = _named(ResultView, part.view)
        if view is not None:
            control.show(view)
        if (part.light, part.adapted) != (state.light.value, state.adapted.value):
            control.relight(part.light, part.adapted)

    control.opened.once(look, lambda result: result.path == part.path)
    control.open(part.path)


def scan_part(state: ScanState) -> ScanPart | None:
    """The plan and its target, unless it is the initial plan."""
    preset = preset_of(on_cycles(state.plan.value, state.period_ms.value), state.period_ms.value)
    is_begun = state.phase.value.is_busy or state.interrupted.value is not None
    if not is_begun and preset is not None and preset.key == _FIRST_PLAN:
        return None
    return ScanPart(
        plan=state.plan.value,
        target=state.target.value,
        then_reconstruct=state.then_reconstruct.value,
        meters=state.meters.value,
        calibration=state.calibration.value.key,
    )


def restore_scan(part: ScanPart, control: ScanController) -> None:
    """Restore the plan, or offer to resume the scan that the crash interrupted.

    Whether to use a calibration although settings differ is asked again: a crash must not skip the check.
    """
    control.state.then_reconstruct.set(part.then_reconstruct)
    control.state.meters.set(part.meters)
    if is_file(part.target / MANIFEST_NAME) and not is_complete(part.target):
        control.open(part.target)
        return
    control.plans.change_plan(part.plan)
    if not there(part.target):
        control.plans.set_target(part.target)
    if part.calibration:
        control.plans.choose_calibration(CalibrationChoice(part.calibration, part.calibration))


def compare_part(state: PairState) -> ComparePart | None:
    """The two sides."""
    first, second = state.first.value, state.second.value
    if first is None and second is None:
        return None
    truth = second is not None and second.truth is not None
    return ComparePart(first=_path(first), second=None if truth else _path(second), with_truth=truth)


def restore_comparison(part: ComparePart, control: PairController) -> None:
    """Open A, then B or the truth of A."""

    def then(_: Side | None) -> None:
        if part.with_truth:
            control.use_truth()
        elif part.second is not None:
            control.open_side(part.second, second=True)

    if part.first is None:
        if part.second is not None:
            control.open_side(part.second, second=True)
        return
    control.state.first.changed.once(then, lambda side: _path(side) == part.first)
    control.open_side(part.first, second=False)


def series_part(state: SeriesState) -> SeriesPart | None:
    """The results with their positions, and what is compared."""
    rows = state.rows.value
    if not rows:
        return None
    return SeriesPart(
        rows=tuple((row.path, row.position_mm) for row in rows),
        kind=state.kind.value.value,
        figure=state.figure.value.field,
        against=state.against.value,
        region=state.region.value,
    )


def restore_series(part: SeriesPart, control: SeriesController) -> None:
    """Compare the same results in the same way."""
    state = control.state
    _set_named(state.kind, SeriesKind, part.kind)
    for figure in FIGURES:
        if figure.field == part.figure:
            state.figure.set(figure)
    control.restore(part.rows, part.against, part.region)


def _path(side: Side | None) -> Path | None:
    return None if side is None else side.arrays.path


def _named(kind: type[E], name: str) -> E | None:
    return next((each for each in kind if each.value == name), None)


def _set_named(value: Value[E], kind: type[E], name: str) -> None:
    found = _named(kind, name)
    if found is not None:
        value.set(found)
