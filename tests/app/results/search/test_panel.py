"""The search panel."""

from __future__ import annotations

from dsl_app.results.search.controller import SearchController
from dsl_app.results.search.panel import SearchPanel
from dsl_app.results.state import SearchMode
from pytestqt.qtbot import QtBot

from tests.app.support.doubles import ManualRunner, RecordingNotifier
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench


def test_the_search_is_shown_with_its_share(bench: Bench) -> None:
    bench.control.point_at((30, 5))
    panel = bench.page.search.content
    panel.start.click()
    assert "50.06 % of the pixels with a spectrum" in panel.text.text()
    assert bench.page.image.content.overlay.isVisible()
    panel.mode.setCurrentIndex(panel.mode.findData(SearchMode.METAMERS))
    assert "look like pixel 30, 5" in panel.text.text()
    panel.angle.setValue(0.2)
    search = bench.state.search.value
    assert search is not None
    assert search.within_rad == 0.2
    panel.clear.click()
    assert not bench.page.image.content.overlay.isVisible()


def test_what_is_chosen_while_a_search_runs_is_what_is_shown(bench: Bench, qtbot: QtBot) -> None:
    runner = ManualRunner()
    panel = SearchPanel(bench.state, SearchController(bench.state, runner, RecordingNotifier()))
    qtbot.addWidget(panel)
    bench.control.point_at((30, 5))
    panel.start.click()
    panel.mode.setCurrentIndex(panel.mode.findData(SearchMode.METAMERS))
    runner.run_all()
    search = bench.state.search.value
    assert search is not None
    assert search.mode is SearchMode.METAMERS
    assert "look like pixel 30, 5" in panel.text.text()


def test_pixels_that_differ_by_their_noise_alone_are_told(bench: Bench) -> None:
    """Half of one patch would otherwise be called another pigment of the same colour."""
    bench.control.point_at((30, 5))
    panel = bench.page.search.content
    panel.start.click()
    search = bench.state.search.value
    assert search is not None
    assert search.noise_of_alike_rad > 0
    limit = 2 * search.noise_of_alike_rad
    panel.angle.setValue(limit + 0.01)
    assert "Deviations alone" not in panel.text.text()
    panel.angle.setValue(limit / 2)
    assert f"angles of about {limit / 2:.2g} rad here" in panel.text.text()
