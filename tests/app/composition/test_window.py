from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link, RigChoice
from dsl_app.scan.page import ScanPage
from dsl_app.shared.settings import load_settings
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from shiboken6 import isValid

from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from tests.app.support.scan_bench import made_up_prediction
from tests.app.support.small_result import write_small_result

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))


@pytest.fixture
def composed(qtbot: QtBot, tmp_path: Path) -> tuple[Composition, MainWindow]:
    composition = Composition(StartOptions(TWIN))
    window = composition.open_window(tmp_path)
    qtbot.addWidget(window)
    window.show()
    return composition, window


def test_the_rig_is_connected_once_the_window_is_there(
    qtbot: QtBot, composed: tuple[Composition, MainWindow]
) -> None:
    composition, _ = composed
    composition.start()
    rig = composition.rig
    assert rig.state.link.value is Link.CLOSED
    qtbot.waitUntil(lambda: rig.state.link.value is Link.OPEN, timeout=30_000)


def test_a_program_that_is_killed_remembers_its_rig(
    composed: tuple[Composition, MainWindow], tmp_path: Path
) -> None:
    composition, window = composed
    window.open_page("scan")
    composition.rig.state.choice.set(RigChoice("twin", (("scene", "sphere"),)))
    # Nothing is closed.
    settings, trouble = load_settings(window.parts.settings_path)
    assert (settings.rig, settings.rig_options, trouble) == ("twin", {"scene": "sphere"}, "")
    assert settings.page == "start", "the page where unfinished scans are offered"


@pytest.mark.slow
def test_every_page_opens_in_both_themes(composed: tuple[Composition, MainWindow]) -> None:
    composition, window = composed
    for theme in ("light", "dark"):
        window.do(f"theme_{theme}")
        for key in composition.pages:
            window.do(f"page_{key}")
            assert window.page == key


def test_who_waits_on_an_empty_results_page_sees_the_result(
    qtbot: QtBot, composed: tuple[Composition, MainWindow], tmp_path: Path
) -> None:
    composition, window = composed
    window.open_page("scan")
    window.open_page("results")
    assert composition.scans is not None
    path = write_small_result(tmp_path)
    composition.scans.state.result.emit(path)
    results = window.page_of("results")
    qtbot.waitUntil(lambda: results.subject() == path, timeout=30_000)
    # The next one is offered to who looks at this one.
    composition.scans.state.result.emit(tmp_path / "next.zarr")
    assert window.toasts.shown[-1].text == "The result next is saved."
    assert results.subject() == path


def test_a_result_that_opens_behind_the_compare_page_is_the_one_it_offers(
    qtbot: QtBot, composed: tuple[Composition, MainWindow], tmp_path: Path
) -> None:
    composition, window = composed
    window.open_page("results")
    window.open_page("compare")
    assert composition.session.pair is not None
    offered = composition.session.pair.state.at_hand
    assert offered.value is None
    path = write_small_result(tmp_path)
    window.page_of("results").open_path(path)
    qtbot.waitUntil(lambda: offered.value == path, timeout=30_000)


def test_a_finished_scan_is_a_recent_file_before_it_has_a_result(
    composed: tuple[Composition, MainWindow], tmp_path: Path
) -> None:
    composition, window = composed
    window.open_page("scan")
    assert composition.scans is not None
    composition.scans.state.finished.set(tmp_path / "leaf.dsl")
    assert window.parts.recent.paths.value == (tmp_path / "leaf.dsl",)


def test_the_rig_is_remembered(
    qtbot: QtBot, composed: tuple[Composition, MainWindow], tmp_path: Path
) -> None:
    composition, window = composed
    rig = composition.rig
    rig.connect(RigChoice("twin", (("scene", "box"), ("size", "64x48"))))
    qtbot.waitUntil(lambda: rig.state.link.value is Link.OPEN, timeout=30_000)
    window.close()
    assert '"scene": "box"' in (tmp_path / "settings.json").read_text()


def test_accuracy_is_predicted_in_the_background_and_closing_ends_it(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dsl_core.planning import prediction
    from dsl_core.planning.expected import Prediction

    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))

    def predict(rig: Rig, plan: CapturePlan, view: object, latency_ms: float) -> Prediction:
        time.sleep(0.05)
        return made_up_prediction(rig, plan, latency_ms)

    monkeypatch.setattr(prediction, "predict", predict)
    composition = Composition(StartOptions(TWIN, predicts=True))
    window = composition.open_window(tmp_path)
    qtbot.addWidget(window)
    window.resize(1280, 800)
    window.show()
    page = window.open_page("scan")
    assert isinstance(page, ScanPage)
    composition.start()
    qtbot.waitUntil(lambda: len(page.forecast._state.points.value) > 3, timeout=60_000)
    assert page.forecast.curve.content.marker.isVisible()
    window.close()
    assert list((tmp_path / "forecasts").glob("*.json"))


@pytest.mark.slow
def test_starting_loads_nothing_heavy() -> None:
    code = (
        "import sys, dsl_app.shell.application, dsl_app.composition.window;"
        "print([m for m in ('torch', 'scipy', 'cv2', 'xarray', 'zarr', 'pyvista') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_program_says_how_it_is_called() -> None:
    done = subprocess.run([sys.executable, "-m", "dsl_app", "--help"], capture_output=True, text=True)
    assert done.returncode == 0
    assert "--rig" in done.stdout


def test_nothing_stays_on_any_screen_when_the_window_closes(
    qtbot: QtBot, composed: tuple[Composition, MainWindow], monkeypatch: pytest.MonkeyPatch
) -> None:
    composition, window = composed
    screens = composition.screens
    screens.projector_window.show()
    screens.identify()
    (name,) = screens._labels
    for shown in (screens.projector_window, name):
        assert not shown.testAttribute(Qt.WidgetAttribute.WA_QuitOnClose)
    monkeypatch.setattr(window, "_may_stop", lambda: False)
    assert not window.close()
    assert screens.projector_window.isVisible()
    assert name.isVisible()
    monkeypatch.undo()
    assert window.close()
    assert not screens.projector_window.isVisible()
    assert not screens._labels


def test_names_of_screens_leave_before_a_scan(composed: tuple[Composition, MainWindow]) -> None:
    composition, _ = composed
    state, screens = composition.rig.state, composition.screens
    screens.identify()
    (name,) = screens._labels
    state.used_by.set("Scan first")
    assert not screens._labels
    assert not isValid(name) or not name.isVisible()
