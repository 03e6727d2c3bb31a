"""The Results page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from dsl_app.results.cloud.views import InteractiveCloud
from dsl_app.results.export.dialog import ExportDialog
from dsl_app.results.marks.library_dialog import LibraryDialog
from dsl_app.results.page import ResultsPage
from dsl_app.results.reconstruct_again.dialog import ReconstructionDialog
from dsl_app.results.state import QualityMap, ResultsState, ResultView, SearchMode
from PySide6.QtWidgets import QDialog, QTabWidget, QWidget

from tests.io.spectra.test_reference_file import write_library
from tests.screens.stage import Stage


def opened(stage: Stage) -> tuple[ResultsPage, ResultsState]:
    """The page with a result."""
    result = stage.copied(stage.material.scans) / "chart.zarr"
    stage.open()
    stage.window.open_path(result)
    page = stage.window.page_of("results")
    assert isinstance(page, ResultsPage)
    state = page._state
    stage.wait(lambda: state.result.value is not None)
    stage.idle()
    return page, state


def marked(stage: Stage) -> tuple[ResultsPage, ResultsState]:
    """The page with pins, a region and a reference."""
    page, state = opened(stage)
    control = page._control
    for pixel in ((40, 40), (60, 40), (80, 60)):
        control.point_at(pixel)
        control.marks.pin(pixel)
    control.marks.add_outline(((90.0, 35.0), (104.0, 35.0), (104.0, 47.0), (90.0, 47.0)))
    stage.idle()
    control.marks.add_reference(write_reference(stage.folder / "spectroradiometer.csv", state))
    stage.idle()
    return page, state


def write_reference(path: Path, state: ResultsState) -> Path:
    """A spectrum near the first pin's, as a spectroradiometer's program writes it."""
    spectrum = state.marks.value[0].spectrum
    values = spectrum.mean + 0.01 * np.sin(spectrum.nm / 20)
    rows = "\n".join(f"{nm:g},{value:.5f}" for nm, value in zip(spectrum.nm, values, strict=True))
    path.write_text(f"nm,reflectance\n{rows}\n")
    return path


def nothing(stage: Stage) -> None:
    """No result is open, at the first start and later."""
    stage.open()
    stage.window.open_page("results")
    stage.shoot("first")
    stage.window.parts.recent.add(stage.folder / "scans" / "gone.zarr")
    stage.window.parts.recent.add(stage.material.scans / "chart.zarr")
    stage.shoot("recent")
    stage.window.open_path(stage.copied(stage.material.scans) / "unreconstructed.dsl")
    stage.shoot("offer")


def views(stage: Stage) -> None:
    """The five views of a result."""
    page, state = opened(stage)
    page._control.point_at((60, 40))
    for view in ResultView:
        stage.window.do(view.value)
        stage.idle()
        if view is ResultView.CLOUD:
            wait_for_cloud(stage, page)
        stage.shoot(view.value.removeprefix("view_"))
    stage.window.do("view_quality")
    for quality in QualityMap:
        state.quality.set(quality)
        stage.shoot(f"quality-{quality.name.lower().replace('_', '-')}")


def wait_for_cloud(stage: Stage, page: ResultsPage) -> None:
    """The cloud is drawn in a thread of its own."""
    stage.wait(lambda: page.cloud.view is not None)
    view = page.cloud.view
    assert isinstance(view, InteractiveCloud)
    # It is filled one turn later.
    stage.settle()
    stage.wait(lambda: view.renderer.is_at_rest)


def marks(stage: Stage) -> None:
    """Pins, a region and a reference with its figures; the same in 3D."""
    page, state = marked(stage)
    stage.shoot()
    state.selected.set(state.marks.value[0].key)
    stage.shoot("compared")
    stage.window.do("view_cloud")
    wait_for_cloud(stage, page)
    stage.shoot("cloud")
    page.marks.remove_selected()
    stage.shoot("undo")


def library(stage: Stage) -> None:
    """Which spectra of a library to compare with."""
    page, _ = opened(stage)
    page._control.point_at((60, 40))
    stage.window.open_path(write_library(stage.folder / "plants.sli"))
    stage.idle()
    dialog = stage.dialog(LibraryDialog)
    dialog.list.item(1).setSelected(True)
    stage.shoot()


def limits(stage: Stage) -> None:
    """Depth between two limits, in the picture and in the cloud."""
    page, state = opened(stage)
    stage.window.do("view_depth")
    result = state.result.value
    assert result is not None
    low, high = np.nanpercentile(result["depth_mm"], (20, 60))
    page.bar.near.setValue(low)
    page.bar.far.setValue(high)
    stage.shoot("picture")
    stage.window.do("view_cloud")
    state.cloud_by.set(ResultView.QUALITY)
    state.quality.set(QualityMap.SHARE)
    wait_for_cloud(stage, page)
    stage.shoot("cloud")


def light(stage: Stage) -> None:
    """The colours under another light."""
    page, _ = opened(stage)
    page._control.relight("A", False)
    stage.idle()
    stage.shoot()


def graph(stage: Stage) -> None:
    """What a pixel saw line by line."""
    page, _ = opened(stage)
    page._control.point_at((60, 40))
    stage.window.do("intensity_graph")
    stage.wait(page.graph.isVisible)
    stage.shoot()


def show_tab(page: ResultsPage, shown: QWidget) -> None:
    """Show the tab of a widget, which may scroll."""
    tabs = page.findChild(QTabWidget)
    assert tabs is not None
    pages = [tabs.widget(i) for i in range(tabs.count())]
    tabs.setCurrentIndex(next(i for i, each in enumerate(pages) if each and each.isAncestorOf(shown)))


def search(stage: Stage) -> None:
    """Where a spectrum occurs, and where only its colour does."""
    page, state = marked(stage)
    state.selected.set(state.marks.value[0].key)
    show_tab(page, page.search)
    # The tab is made when it is seen.
    stage.settle()
    for mode in SearchMode:
        page.search.content.mode.setCurrentIndex(page.search.content.mode.findData(mode))
        stage.press("Search", page)
        stage.idle()
        stage.shoot(mode.name.lower())


def export(stage: Stage) -> None:
    """The export dialog, ready and with a target that exists."""
    marked(stage)
    stage.window.do("export")
    dialog = stage.dialog(ExportDialog)
    for box in dialog.formats.values():
        box.setChecked(box.isEnabled())
    stage.shoot()
    (stage.folder / "scans" / "chart.ply").touch()
    dialog.name.setText("chart ")
    stage.shoot("taken")


def again(stage: Stage) -> None:
    """Reconstruct again: the dialog, a bad order, the work, and the offer to compare."""
    opened(stage)
    stage.window.do("reconstruct_again")
    dialog = stage.dialog(ReconstructionDialog)
    stage.shoot()
    dialog.step.setValue(7)
    stage.shoot("refused")
    dialog.step.setValue(46)
    dialog.name.setText("chart-coarse")
    stage.press("Show command line", dialog)
    stage.shoot("command")
    for text in dialog.findChildren(QDialog):
        text.close()
    stage.press("Reconstruct", dialog)
    stage.wait(lambda: stage.window.toasts.shown)
    stage.idle()
    stage.shoot("done")


SCENES: dict[str, Callable[[Stage], None]] = {
    "results-nothing": nothing,
    "results-view": views,
    "results-marks": marks,
    "results-library": library,
    "results-limits": limits,
    "results-light": light,
    "results-graph": graph,
    "results-search": search,
    "results-export": export,
    "results-again": again,
}
