"""The Compare page."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from dsl_app.compare.page import ComparePage
from dsl_app.compare.pair.state import PairQuantity
from dsl_app.compare.series.state import SeriesKind

from tests.cases.stage_series import write_stage, write_sweep
from tests.screens.stage import Stage

#: Where the published depth test was measured.
POSITIONS_MM = np.linspace(695.2, 859.2, 15).tolist()


def compared(stage: Stage) -> ComparePage:
    """The page with one result."""
    stage.open()
    page = stage.window.open_page("compare")
    assert isinstance(page, ComparePage)
    page._control.open_side(stage.material.scans / "chart.zarr", second=False)
    stage.idle()
    return page


def empty(stage: Stage) -> None:
    """Nothing to compare yet, then one side."""
    stage.open()
    stage.window.open_page("compare")
    stage.shoot()


def truth(stage: Stage) -> None:
    """A result against what the twin knows."""
    page = compared(stage)
    stage.shoot("one")
    page._control.use_truth()
    stage.wait(lambda: page.pair._state.pair.value is not None)
    page._control.point_at((60, 40))
    stage.shoot()


def two(stage: Stage) -> None:
    """Two results, by depth and by band."""
    page = compared(stage)
    page._control.open_side(stage.material.scans / "chart-again.zarr", second=True)
    stage.wait(lambda: page.pair._state.pair.value is not None)
    page._control.point_at((60, 40))
    stage.shoot()
    page._control.show(PairQuantity.BAND)
    stage.shoot("band")


def series_page(stage: Stage) -> ComparePage:
    """The page with its series."""
    stage.open()
    page = stage.window.open_page("compare")
    assert isinstance(page, ComparePage)
    page.tabs.setCurrentIndex(1)
    return page


def series(stage: Stage) -> None:
    """No series yet, then a flat target at the published positions, and one with a region."""
    page = series_page(stage)
    stage.shoot("empty")
    for i, position in enumerate(POSITIONS_MM):
        write_stage(stage.folder, round(position, 1), seed=i, bend_mm=0.02 * (-1) ** i)
    page._series_control.add([stage.folder])
    stage.wait(
        lambda: (
            page.series.content._state.test.value is not None and not page.series.content._state.busy.value
        )
    )
    stage.shoot()
    stage.press("Region")
    stage.idle()
    stage.shoot("region")


def sweep(stage: Stage) -> None:
    """Scans of one scene against the longest one."""
    page = series_page(stage)
    reference, *_ = write_sweep(stage.folder)
    page._series_control.ask(SeriesKind.SWEEP)
    page._series_control.compare_with(reference)
    page._series_control.add([stage.folder])
    stage.wait(
        lambda: len(page.series.content._state.points) == 3 and not page.series.content._state.busy.value
    )
    stage.shoot()


SCENES: dict[str, Callable[[Stage], None]] = {
    "compare-empty": empty,
    "compare-truth": truth,
    "compare-two": two,
    "compare-series": series,
    "compare-sweep": sweep,
}
