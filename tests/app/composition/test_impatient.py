"""What impatient people do to the whole window: click everything, make it small, close it in the middle."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link, RigChoice
from dsl_app.results.page import ResultsPage
from dsl_app.results.state import ResultView
from dsl_app.scan.page import ScanPage
from dsl_app.scan.state import Phase
from dsl_app.shared.widgets.open_dialog import OpenDialog
from dsl_app.shell.actions import PAGES
from dsl_app.shell.application import ExceptionHook
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.paged_window import SMALLEST
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QDialog, QFileDialog, QWidget
from pytestqt.qtbot import QtBot
from shiboken6 import isValid

from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.presets import PRESETS
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.small_result import write_small_result
from tests.cases.faults import FaultPlan, with_faults

ROOT = Path(__file__).resolve().parents[3]
_LEFT = Qt.MouseButton.LeftButton
TWIN = RigChoice("twin", (("scene", "plane"), ("size", "32x24")))
#: Buttons that end what the test wants to go on, and those of other programs' windows.
SPARED = ("Cancel", "Pause", "Stop", "Disconnect", "Show the demo")


class Bench:
    """A composed window with a connected twin."""

    def __init__(self, folder: Path) -> None:
        self.composition = Composition(StartOptions(TWIN))
        self.window: MainWindow = self.composition.open_window(folder)
        self.window.parts.settings.output_folder = str(folder / "scans")
        self.hook = ExceptionHook(self.window.toasts)
        self.window.show()
        rig = self.composition.rig
        rig.connect(TWIN)
        self.wait(lambda: rig.state.link.value is Link.OPEN)

    def wait(self, holds: Callable[[], object], seconds: float = 100.0) -> None:
        """Let window and threads live until something holds."""
        limit = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < limit, "it never came true"
            QApplication.processEvents()
            time.sleep(0.002)

    def live(self, seconds: float) -> None:
        """Let window and threads live for a while."""
        limit = time.monotonic() + seconds
        self.wait(lambda: time.monotonic() > limit)

    def scan_page(self) -> ScanPage:
        """The Scan page with a short plan."""
        page = self.window.open_page("scan")
        assert isinstance(page, ScanPage)
        self.wait(lambda: not self.window.parts.runner.active)
        page._controller.plans.change_plan(PRESETS[0].plan)
        page._state.then_reconstruct.set(False)
        return page

    def close(self) -> None:
        """Stop everything and close."""
        self.window.parts.runner.cancel_all()
        self.wait(lambda: not self.window.parts.runner.active)
        self.window.close()
        self.window.deleteLater()


@pytest.fixture
def bench(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    # Not a widget of qtbot's, which would close it, and be asked, while the camera still waits.
    made = Bench(tmp_path)
    yield made
    made.close()


@pytest.fixture
def gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """The camera waits for this before it hands over a frame beyond the seventh; metering takes three."""
    free, count, snap = threading.Event(), iter(range(10_000)), SimCamera.snap

    def slowly(self: SimCamera, timeout_ms: float = 5000.0) -> object:
        if next(count) >= 7:
            free.wait()
        return snap(self, timeout_ms)

    monkeypatch.setattr(SimCamera, "snap", slowly)
    yield free
    free.set()


@pytest.mark.slow
def test_clicking_everything_while_a_scan_runs_loses_nothing(
    bench: Bench, gate: threading.Event, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: ("", ""))
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: ("", ""))
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: "")
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: None)
    caught: list[str] = []
    bench.hook.caught.connect(caught.append)
    bench.window.open_path(write_small_result(tmp_path))
    bench.wait(lambda: not bench.window.parts.runner.active)
    page = bench.scan_page()
    state = page._state
    QTest.mouseClick(page.run.start, _LEFT)
    bench.wait(lambda: state.status.value.done >= 3)
    # Whatever asks is given up, however late it asks.
    impatience = QTimer()
    impatience.timeout.connect(_give_up)
    impatience.start(20)
    clicked = 0
    for key in ("scan", "rig", "calibrate", "results", "compare", "scan"):
        bench.window.open_page(key)
        for button in _buttons(bench.window.page_of(key)):
            # A dialog that was given up a moment ago takes its buttons along.
            if isValid(button) and button.isVisible() and button.isEnabled():
                QTest.mouseClick(button, _LEFT)
                bench.live(0.05)
                clicked += 1
    impatience.stop()
    assert clicked > 20
    assert state.phase.value is Phase.RUNNING
    gate.set()
    bench.wait(lambda: state.phase.value is Phase.DONE)
    assert not caught
    (session,) = (tmp_path / "scans").glob("*.dsl")
    assert not ScanReader(session).missing()


def test_closing_during_a_scan_asks_and_the_frames_stay(
    bench: Bench, gate: threading.Event, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    answers = [False, True]
    asked: list[str] = []

    def answer(_parent: object, _title: str, text: str, **_buttons: str) -> bool:
        asked.append(text)
        gate.set()
        return answers[len(asked) - 1]

    monkeypatch.setattr("dsl_app.shell.paged_window.confirm", answer)
    page = bench.scan_page()
    state = page._state
    QTest.mouseClick(page.run.start, _LEFT)
    bench.wait(lambda: state.status.value.done >= 3)
    assert not bench.window.close()
    assert state.phase.value.is_busy
    page._controller.pause()
    bench.wait(lambda: state.phase.value is Phase.PAUSED)
    assert bench.window.close()
    assert "can be resumed" in asked[1]
    (session,) = (tmp_path / "scans").glob("*.dsl")
    reader = ScanReader(session)
    assert reader.plan.shot_count > len(reader.missing()) > 0


@pytest.mark.slow
def test_a_projector_that_is_pulled_out_interrupts_and_its_scan_goes_on(bench: Bench) -> None:
    page = bench.scan_page()
    state, rig = page._state, bench.composition.rig.state
    whole = rig.devices.value
    assert whole is not None
    rig.devices.set(with_faults(whole, FaultPlan(projector_gone_at=8)))
    QTest.mouseClick(page.run.start, _LEFT)
    bench.wait(lambda: state.phase.value is Phase.LOST)
    assert "frames are saved" in page.banner.text
    bench.wait(lambda: rig.link.value is Link.OPEN)
    assert page.banner.text.endswith("The rig is reconnected.")
    QTest.mouseClick(page.banner.action, _LEFT)
    bench.wait(lambda: state.phase.value is Phase.DONE)
    assert not page.banner.isVisible()


@pytest.mark.slow
def test_every_page_fits_the_smallest_window(bench: Bench, tmp_path: Path) -> None:
    bench.window.open_path(write_small_result(tmp_path))
    bench.wait(lambda: not bench.window.parts.runner.active)
    for page in PAGES:
        shown = bench.window.open_page(page.key)
        bench.window.resize(SMALLEST)
        bench.live(0.1)
        assert bench.window.size() == SMALLEST, page.key
        room = shown.size()
        least = shown.minimumSizeHint()
        assert least.width() <= room.width(), f"{page.key}: {least} in {room}"
        if isinstance(shown, ResultsPage):
            for view in ResultView:
                shown._state.view.set(view)
                assert shown.minimumSizeHint().width() <= room.width(), view
            shown._state.view.set(ResultView.COLOUR)
            bench.live(0.05)
        for button in _buttons(shown):
            if button.isVisible():
                words = button.fontMetrics().horizontalAdvance(button.text().replace("&", ""))
                assert button.width() > words, f"{page.key}: {button.text()}"


@pytest.mark.slow
def test_the_window_opens_at_one_and_a_half_times_the_size(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path;"
        "from dsl_app.shell.application import make_application;"
        "from dsl_app.composition.window import Composition, StartOptions; app = make_application([]);"
        "made = Composition(StartOptions());"
        "window = made.open_window(Path(sys.argv[1])); window.show();"
        "[(window.open_page(key), app.processEvents(), window.grab()) for key in made.pages];"
        "print(window.devicePixelRatioF(), window.grab().width() / window.width()); window.close()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        env={**os.environ, "QT_SCALE_FACTOR": "1.5", "DSL_SCAN_HOME": str(tmp_path)},
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=110,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1.5", "1.5"]


def _buttons(page: QWidget) -> list[QAbstractButton]:
    found = page.findChildren(QAbstractButton)
    return [button for button in found if button.text().replace("&", "").rstrip("…") not in SPARED]


def _give_up() -> None:
    for widget in QApplication.topLevelWidgets():
        if isinstance(widget, QDialog) and widget.isVisible():
            widget.reject()
    popup = QApplication.activePopupWidget()
    if popup is not None:
        popup.close()
