"""The Rig and Scan menus do from any page what the buttons of those pages do."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link, RigChoice
from dsl_app.scan.page import ScanPage
from dsl_app.scan.state import Phase
from dsl_app.shell.main_window import MainWindow
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from tests.app.support.real_window import show_window

TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48"), ("realtime", "on")))


@pytest.fixture
def composition(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Composition:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    return Composition(StartOptions(TWIN))


@pytest.fixture
def window(qtbot: QtBot, composition: Composition, tmp_path: Path) -> MainWindow:
    made = composition.open_window(tmp_path)
    made.parts.settings.output_folder = str(tmp_path / "scans")
    show_window(qtbot, made)
    return made


@pytest.mark.slow
def test_a_rig_is_watched_and_scans_from_the_results_page(
    qtbot: QtBot, window: MainWindow, composition: Composition
) -> None:
    state = composition.rig.state

    def do_from_results(key: str) -> None:
        window.open_page("results")
        window.actions_by_key[key].trigger()

    do_from_results("rig_connect")
    assert window.page == "rig"
    qtbot.waitUntil(lambda: state.link.value is Link.OPEN, timeout=20000)
    do_from_results("rig_live")
    qtbot.waitUntil(lambda: state.live.value, timeout=5000)
    do_from_results("rig_live")
    qtbot.waitUntil(lambda: not state.live.value, timeout=5000)
    do_from_results("rig_expose")
    qtbot.waitUntil(lambda: state.live.value, timeout=5000)
    do_from_results("rig_live")
    qtbot.waitUntil(lambda: not state.live.value, timeout=5000)

    do_from_results("scan_start")
    assert window.page == "scan"
    assert composition.scans is not None
    scan = composition.scans.state
    qtbot.waitUntil(lambda: scan.phase.value is Phase.RUNNING, timeout=20000)
    do_from_results("scan_pause")
    qtbot.waitUntil(lambda: scan.phase.value is Phase.PAUSED, timeout=20000)
    do_from_results("scan_pause")
    qtbot.waitUntil(lambda: scan.phase.value is Phase.RUNNING, timeout=20000)
    do_from_results("scan_stop")
    qtbot.waitUntil(lambda: scan.interrupted.value is not None, timeout=20000)

    do_from_results("rig_connect")
    qtbot.waitUntil(lambda: state.link.value is Link.CLOSED, timeout=20000)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("rig_live", "No camera is connected."),
        ("rig_expose", "No camera is connected."),
        ("scan_start", "No rig is connected."),
        ("scan_pause", "No scan is running."),
        ("scan_stop", "No scan is running."),
    ],
)
def test_without_a_rig_it_says_why_nothing_happens(window: MainWindow, key: str, said: str) -> None:
    window.do(key)
    assert [toast.text for toast in window.toasts.shown if toast.text.startswith(said)]


def test_a_name_that_is_being_typed_counts(
    qtbot: QtBot, window: MainWindow, composition: Composition
) -> None:
    page = window.open_page("scan")
    assert isinstance(page, ScanPage)
    window.activateWindow()
    page.target.name.setFocus()
    qtbot.waitUntil(page.target.name.hasFocus)
    page.target.name.selectAll()
    QTest.keyClicks(page.target.name, "leaf")
    window.do("scan_start")
    assert composition.scans is not None
    assert composition.scans.state.target.value.stem == "leaf"
    assert page.target.name.hasFocus()
