"""A reconstruction on the Results page shows depth and points first, then its spectra in the same view."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dsl_app.results.state import ResultView
from dsl_app.session.parts import results_part
from dsl_app.shared.jobs.qt_runner import QtRunner
from PySide6.QtCore import QRectF
from pytestqt.qtbot import QtBot

from dsl_core.errors import Cancelled, DecodeError
from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.model.result_sink import SeenGeometry
from dsl_core.workflows import scans
from tests.app.support.results_bench import Bench as Window
from tests.app.support.results_bench import bench as window
from tests.app.support.results_controller import Bench
from tests.app.support.results_controller import bench as bench
from tests.app.support.small_result import write_small_result

__all__ = ["bench", "window"]
PIXEL = (20, 12)


def _scan(folder: Path, monkeypatch: pytest.MonkeyPatch, then: Callable[[], object]) -> Path:
    """A scan whose reconstruction shows its geometry, and whose spectra come after what happens ``then``."""
    folder.mkdir()
    maps: dict[str, Any] = dict(load_arrays(write_small_result(folder, spectra=False)).arrays)
    (folder / "small.zarr").rename(folder / "depth.zarr")

    def reconstruct(*_: object, seen_geometry: SeenGeometry, **__: object) -> Path:
        seen_geometry(maps)
        then()
        return write_small_result(folder)

    monkeypatch.setattr(scans, "reconstruct_to", reconstruct)
    monkeypatch.setattr("dsl_core.io.scan.folder.ScanReader", lambda session: session)
    monkeypatch.setattr("dsl_core.workflows.captures.is_import", lambda reader: False)
    return folder / "small.dsl"


def test_depth_and_points_come_before_spectra_in_the_same_view(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state, control = bench.state, bench.control
    seen: list[tuple[object, ...]] = []

    def look() -> None:
        control.take_news()
        result = state.result.value
        assert result is not None
        points = result["points_mm"].shape
        seen.append((result.path.name, points, result.has_spectra, state.is_begun.value, state.view.value))
        assert state.no_spectra == "The spectra are still being computed."
        assert results_part(state) is None, "a session would open what is on no disk"
        control.show(ResultView.COLOUR)
        seen.append((bench.told,))
        control.marks.add_outline(((1.5, 5.5), (6.5, 5.5), (6.5, 9.5)))
        control.show(ResultView.CLOUD)
        control.limit_depth((700.0, 710.0))
        control.point_at(PIXEL)
        control.inspect()
        seen.append((bench.told,))

    control.state.offer.set(_scan(tmp_path / "new", monkeypatch, look))
    control.reconstruct()
    (name, points, has_spectra, is_begun, view), (why,), (graph,) = seen
    assert (name, points, has_spectra, is_begun, view) == (
        "small.zarr", (3, 24, 36), False, True, ResultView.DEPTH,
    )  # fmt: skip
    assert "still being computed" in str(why)
    assert "Point at a pixel" in str(graph)
    assert state.result.value is not None
    assert state.result.value.has_spectra
    assert not state.is_begun.value
    assert state.picture.value is not None
    kept = state.view.value, state.cursor.value, state.depth_limits.value
    assert kept == (ResultView.CLOUD, PIXEL, (700.0, 710.0))
    assert "spectra of small are there" in bench.told
    assert state.no_spectra == ""
    assert results_part(state) is not None


@pytest.mark.parametrize("error", [Cancelled("Stopped."), DecodeError("No light.")])
def test_what_comes_to_nothing_gives_the_result_before_back(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    state, before = bench.state, bench.state.result.value
    bench.control.relight("A", adapted=False)
    picture = state.picture.value

    def fail() -> None:
        bench.control.take_news()
        assert state.result.value is not before
        raise error

    session = _scan(tmp_path / "new", monkeypatch, fail)
    state.offer.set(session)
    bench.control.reconstruct()
    assert (state.result.value, state.picture.value) == (before, picture)
    assert (state.light.value, state.is_begun.value, state.busy.value) == ("A", False, "")
    assert state.offer.value == session
    state.result.set(None)
    bench.control.reconstruct()
    assert state.result.value is None


def test_the_page_keeps_zoom_and_buttons_wait_for_the_spectra(
    window: Window, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go = threading.Event()
    page, state = window.page, window.state
    runner = QtRunner(window.window.toasts)
    window.control._runner = runner
    state.offer.set(_scan(tmp_path / "new", monkeypatch, lambda: go.wait(20)))
    page.offer.reconstruct.click()
    qtbot.waitUntil(lambda: state.is_begun.value)
    image = page.image.content
    assert image.isVisible()
    assert "spectra are being computed" in page.about.text()
    assert not any(button.isEnabled() for button in (page._export, page._report, page._inspect))
    image.box.setRange(QRectF(4, 4, 12, 8), padding=0)
    before = image.box.viewRange()[0]
    go.set()
    qtbot.waitUntil(lambda: not state.is_begun.value and not runner.active, timeout=20_000)
    assert state.result.value is not None
    assert state.result.value.has_spectra
    np.testing.assert_allclose(image.box.viewRange()[0], before)
    assert all(button.isEnabled() for button in (page._export, page._report, page._inspect))


def test_the_cloud_looks_from_where_it_did(window: Window, qtbot: QtBot, tmp_path: Path) -> None:
    window.control.show(ResultView.CLOUD)
    qtbot.waitUntil(lambda: window.page.cloud.view is not None, timeout=30_000)
    view = window.page.cloud.view
    assert view is not None
    qtbot.wait(100)
    resets: list[bool] = []
    view.show_cloud = lambda *given: resets.append(given[2])  # type: ignore[method-assign]
    (tmp_path / "new").mkdir()
    path = write_small_result(tmp_path / "new", spectra=False)
    for is_new in (True, False):
        resets.clear()
        window.control.open(path)
        qtbot.waitUntil(lambda: bool(resets))
        assert resets[0] == is_new
