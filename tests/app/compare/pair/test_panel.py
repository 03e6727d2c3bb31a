from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.panel import PairFigures, PairPanel
from dsl_app.compare.pair.sides import SmallDepth
from dsl_app.compare.pair.state import Pair, PairQuantity, PairState, Side
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.settings import RecentFiles, Settings
from dsl_app.shared.theme import DARK, LIGHT
from dsl_app.shared.widgets.inside import apply_theme_to, stop_following
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog
from pytestqt.qtbot import QtBot

from dsl_core.io.result.result_arrays import ResultArrays
from tests.app.support.compare_bench import make_result, make_variant
from tests.app.support.doubles import RecordingNotifier

Bench = tuple[PairPanel, PairState, PairController]


@pytest.fixture(scope="module")
def chart(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_result(tmp_path_factory.mktemp("results"), "chart")


@pytest.fixture
def bench(qtbot: QtBot) -> Iterator[Bench]:
    runner, state = QtRunner(), PairState()
    control = PairController(state, runner, RecordingNotifier())
    page = PairPanel(state, control, RecentFiles(Settings()))
    qtbot.addWidget(page)
    apply_theme_to(page, LIGHT)
    page.resize(1100, 700)
    page.show()
    yield page, state, control
    stop_following(page)
    runner.shut_down()


def with_truth(qtbot: QtBot, bench: Bench, chart: Path) -> None:
    page, state, control = bench
    assert control.open(chart)
    qtbot.waitUntil(lambda: state.first.value is not None and not state.busy.value, timeout=20_000)
    QTest.mouseClick(page.truth, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: state.pair.value is not None, timeout=20_000)


def test_an_empty_page_says_what_to_do(bench: Bench) -> None:
    page, _, _ = bench
    first, second = page.empty.places
    assert "Open A" in first.text.text()
    assert first.picture.is_empty
    assert second.picture.is_empty
    assert first.picture.y() == second.picture.y()
    # Both share the page, and the recent results lie where the first one is missing.
    assert abs(first.width() - second.width()) <= 1
    assert first.width() + second.width() > 0.9 * page.width()
    assert first.isAncestorOf(page.recent)
    assert not page.truth.isEnabled()
    assert not page.report.isEnabled()
    assert not page.parts.isVisible()


def test_a_result_alone_is_hatched_where_it_has_no_depth(qtbot: QtBot) -> None:
    picture = SmallDepth()
    qtbot.addWidget(picture)
    picture.apply_theme(DARK)
    picture.resize(200, 100)
    picture.show_depth(np.array([[np.nan, 700.0]]))
    image = picture.grab().toImage()
    without, valued = (
        {image.pixelColor(x, y).name() for x in range(first, first + 80) for y in range(10, 90)}
        for first in (10, 110)
    )
    # Hatched, as in the pictures of a pair: the ground of the page would look like a dark surface.
    assert without >= {DARK.line, DARK.muted}
    assert len(valued) == 1


@pytest.mark.slow
def test_recent_results_are_compared_by_a_double_click(qtbot: QtBot, bench: Bench, chart: Path) -> None:
    page, state, _ = bench
    near = make_variant(chart, "near", 3.0)
    for path in (near, chart, chart.with_suffix(".dsl"), chart.with_name("gone.zarr")):
        page.recent._recent.add(path)
    files = page.recent.files
    assert [files.item(i).text().split(" ")[0] for i in range(files.count())] == ["chart.zarr", "near.zarr"]
    assert files.isVisible()
    files.itemActivated.emit(files.item(0))
    qtbot.waitUntil(lambda: state.first.value is not None and not state.busy.value, timeout=20_000)
    assert [files.item(i).text().split(" ")[0] for i in range(files.count())] == ["near.zarr"]
    first, second = page.empty.places
    assert second.isAncestorOf(page.recent)
    assert first.title.text() == "A: chart"
    assert (first.picture.is_empty, second.picture.is_empty) == (False, True)
    # Its depth is seen: more than the ground of the place.
    seen = first.picture.grab().toImage()
    middle = seen.pixelColor(seen.width() // 2, seen.height() // 2)
    assert middle != second.picture.grab().toImage().pixelColor(seen.width() // 2, seen.height() // 2)
    files.itemActivated.emit(files.item(0))
    qtbot.waitUntil(lambda: state.pair.value is not None, timeout=20_000)
    assert not page.empty.isVisible()


def test_a_name_with_signs_of_markup_is_whole_above_its_picture(
    qtbot: QtBot, bench: Bench, chart: Path
) -> None:
    page, state, control = bench
    control.open_side(chart, False)
    qtbot.waitUntil(lambda: not state.busy.value, timeout=20_000)
    control.open_side(make_variant(chart, "Mitte <2>", 3.0), True)
    qtbot.waitUntil(lambda: state.pair.value is not None, timeout=20_000)
    titles = [title.item.toPlainText() for title in page.pictures.content.titles]
    assert [" ".join(title.split()) for title in titles] == ["A chart", "B Mitte <2>", "A − B"]


def test_a_report_without_an_ending_gets_that_of_a_page(
    qtbot: QtBot, bench: Bench, chart: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, state, control = bench
    for second in (False, True):
        control.open_side(chart, second)
        qtbot.waitUntil(lambda: not state.busy.value, timeout=20_000)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "report"), ""))
    written: list[tuple[Path, Pair | None]] = []
    monkeypatch.setattr(control, "write_report", lambda *given: written.append(given))
    page.report.click()
    assert written == [(tmp_path / "report.html", state.pair.value)]


@pytest.mark.slow
def test_figures_pictures_and_spectra_of_a_pair(qtbot: QtBot, bench: Bench, chart: Path) -> None:
    page, state, _ = bench
    with_truth(qtbot, bench, chart)
    assert not page.hint.isVisible()
    assert page.report.isEnabled()
    assert not page.swap.isEnabled()
    first = page.figures.content.table.item(0, 0)
    assert first is not None
    assert first.text() == "Depth, RMSE per pixel"
    assert " ± " in page.figures.content.table.item(0, 1).text()  # type: ignore[union-attr]
    shapes = [item.image.shape for item in page.pictures.content.images]
    assert shapes == [(48, 64)] * 3
    assert tuple(page.pictures.content.images[0].levels) == tuple(page.pictures.content.images[1].levels)
    qtbot.waitUntil(lambda: len(page.pictures.content.bars) == 2)
    assert page.pictures.content.bars[0].levels() == pytest.approx(
        page.pictures.content.images[0].levels, rel=1e-3
    )
    low, high = page.pictures.content.images[2].levels
    assert low == -high
    QTest.keyClick(page.pictures.content, Qt.Key.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    assert state.cursor.value == (22, 24)
    assert "column 22, row 24" in page.bar.readout.text()
    assert all(curve.solid.isVisible() for curve in page.figures.content.curves)
    apply_theme_to(page, DARK)


@pytest.mark.slow
def test_the_slider_steps_through_common_bands(qtbot: QtBot, bench: Bench, chart: Path) -> None:
    page, state, _ = bench
    with_truth(qtbot, bench, chart)
    page.bar.shown.setCurrentIndex(1)
    page.bar.shown.activated.emit(1)
    assert state.shown.value is PairQuantity.BAND
    assert page.bar.band.isVisible()
    page.bar.band.setFocus()
    QTest.keyClick(page.bar.band, Qt.Key.Key_Right)
    assert page.bar.nm.text() == "550 nm"
    assert page.pictures.content.images[0].levels[0] == 0.0


def test_pictures_stay_where_they_are_while_work_is_told(qtbot: QtBot, bench: Bench, chart: Path) -> None:
    page, state, _ = bench
    with_truth(qtbot, bench, chart)
    QApplication.processEvents()
    before = page.parts.geometry()
    state.busy.set("Compare chart")
    QApplication.processEvents()
    assert page.hint.isVisible()
    assert page.parts.geometry() == before
    state.busy.set("")
    QApplication.processEvents()
    assert not page.hint.isVisible()
    assert page.parts.geometry() == before


def test_spectra_are_drawn_over_the_bands_of_both_results(qtbot: QtBot) -> None:
    state = PairState()
    figures = PairFigures(state)
    qtbot.addWidget(figures)
    sides = []
    for name, nm in (("near", np.arange(700.0, 901.0, 10.0)), ("far", np.arange(800.0, 1001.0, 10.0))):
        depth = np.full((2, 3), 700.0, np.float32)
        arrays = {"depth_mm": depth, "reflectance": np.full((nm.size, 2, 3), 0.5, np.float32)}
        sides.append(Side(name, ResultArrays(Path(f"{name}.zarr"), nm, arrays)))
    state.pair.set(Pair(sides[0], sides[1], ((10, 0),), ()))
    assert figures.plot.getPlotItem().viewRange()[0] == pytest.approx([694, 1006])
    stop_following(figures)
