"""The Compare page."""

from __future__ import annotations

from collections.abc import Callable

from app.panels.compare_page import ComparePage
from app.state.compare import Shown
from tests.screens.stage import Stage


def compared(stage: Stage) -> ComparePage:
    """The page with one result."""
    stage.open()
    page = stage.window.open_page("compare")
    assert isinstance(page, ComparePage)
    page._commands.open_side(stage.material.scans / "chart.zarr", second=False)
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
    page._commands.use_truth()
    stage.wait(lambda: page._state.pair.value is not None)
    page._commands.point_at((60, 40))
    stage.shoot()


def two(stage: Stage) -> None:
    """Two results, by depth and by band."""
    page = compared(stage)
    page._commands.open_side(stage.material.scans / "chart-again.zarr", second=True)
    stage.wait(lambda: page._state.pair.value is not None)
    page._commands.point_at((60, 40))
    stage.shoot()
    page._commands.show(Shown.BAND)
    stage.shoot("band")


SCENES: dict[str, Callable[[Stage], None]] = {
    "compare-empty": empty,
    "compare-truth": truth,
    "compare-two": two,
}
