from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from dsl_app.connection.state import Link
from dsl_app.scan import reconnect
from dsl_app.scan.effects.controller import EffectsController
from dsl_app.scan.effects.state import EffectsState
from dsl_app.scan.forecast.controller import ForecastController
from dsl_app.scan.forecast.panel import READY, ForecastPanel
from dsl_app.scan.forecast.state import ForecastState
from dsl_app.scan.frame_box import pattern_levels
from dsl_app.scan.page import ScanPage
from dsl_app.scan.state import CalibrationChoice, InterruptedScan, LivePicture, Phase
from dsl_app.scan.view import FramePicture
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.theme import DARK, LIGHT
from dsl_app.shared.widgets.figure_file import save_figure
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog
from pytestqt.qtbot import QtBot

from dsl_core.errors import DeviceError
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.frames import Frame
from dsl_core.model.plan import LineComb
from dsl_core.model.presets import PRESETS
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.scan_bench import (
    SHORT,
    TWIN,
    ScanBench,
    made_up_prediction,
    make_bench,
    make_forecast,
)

Bench = tuple[ScanPage, ScanBench, list[Path]]


@pytest.fixture
def ready(qtbot: QtBot, tmp_path: Path) -> Iterator[Bench]:
    runner = QtRunner()
    bench = make_bench(tmp_path, runner)
    opened: list[Path] = []
    expected = ForecastState()
    forecast = make_forecast(bench, expected, tmp_path / "forecasts", runner)
    rendered = EffectsState()
    effects = EffectsController(rendered, bench.state, bench.rig, runner, bench.notifier)
    page = ScanPage(
        bench.state,
        bench.scans,
        ForecastPanel(expected, forecast),
        rendered,
        effects,
        opened.append,
    )
    qtbot.addWidget(page)
    page.apply_theme(LIGHT)
    page.resize(1200, 800)
    page.show()
    bench.rig.connect(TWIN)
    qtbot.waitUntil(lambda: bench.rig.state.devices.value is not None, timeout=60_000)
    bench.plan(SHORT)
    qtbot.waitUntil(lambda: runner.active == ())
    yield page, bench, opened
    page.release()
    runner.shut_down()


def click(button: object) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)  # type: ignore[call-overload]


def in_phase(bench: ScanBench, phase: Phase) -> Callable[[], bool]:
    return lambda: bench.state.phase.value is phase


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    snap = SimCamera.snap

    def slowly(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        time.sleep(0.01)
        return snap(self, timeout_ms)

    monkeypatch.setattr(SimCamera, "snap", slowly)


def test_a_name_counts_as_far_as_it_is_typed(ready: Bench, tmp_path: Path) -> None:
    page, bench, _ = ready
    field = page.target.name
    field.selectAll()
    QTest.keyClicks(field, "leaf 1/2")
    assert bench.state.target.value == tmp_path / "leaf 1-2.dsl"
    # Another folder is chosen meanwhile: neither the text nor the place in it changes.
    field.cursorBackward(False, 3)
    bench.scans.plans.set_target(tmp_path / "other" / "leaf 1-2.dsl")
    assert (field.text(), field.cursorPosition()) == ("leaf 1/2", 5)
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert field.text() == "leaf 1-2"
    field.selectAll()
    QTest.keyClick(field, Qt.Key.Key_Delete)
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert field.text() == "leaf 1-2"


@pytest.mark.slow
def test_pause_go_on_and_finish(qtbot: QtBot, ready: Bench, slow: None, tmp_path: Path) -> None:
    page, bench, _ = ready
    click(page.run.start)
    qtbot.waitUntil(page.run.pause.isEnabled, timeout=60_000)
    assert not page.plan.isEnabled()
    click(page.run.pause)
    qtbot.waitUntil(in_phase(bench, Phase.PAUSED), timeout=60_000)
    assert page.run.pause.text() == "Cont&inue"
    click(page.run.pause)
    qtbot.waitUntil(in_phase(bench, Phase.DONE), timeout=60_000)
    assert ScanReader(tmp_path / "first.dsl").missing() == []
    assert page.plan.isEnabled()
    assert f"{SHORT.shot_count} of {SHORT.shot_count}" in page.run.frames.text()
    # It is to be reconstructed, until that is done, from this page or from another; however that ended.
    assert page.run.again.property("role") == "primary"
    bench.state.then_reconstruct.set(True)
    bench.state.is_reconstructing.set(True)
    assert page.run.again.property("role") != "primary"
    bench.state.is_reconstructing.set(False)
    assert page.run.again.property("role") == "primary"
    page.hide()
    (tmp_path / "first.zarr").mkdir()
    page.show()
    assert page.run.again.property("role") != "primary"
    assert page.run.start.property("role") == "primary"


@pytest.mark.slow
def test_cancel_keeps_frames_and_offers_to_resume(qtbot: QtBot, ready: Bench, slow: None) -> None:
    page, bench, _ = ready
    click(page.run.start)
    qtbot.waitUntil(lambda: bench.state.status.value.done > 3, timeout=60_000)
    click(page.run.cancel)
    qtbot.waitUntil(in_phase(bench, Phase.STOPPED), timeout=2_000)
    assert page.run.resume.text() == "Resume sca&n"
    assert not page.run.start.isVisible()
    assert page.run.renew.isVisible()
    assert page.run.drift.isVisible()
    page.run.drift.setChecked(False)
    assert not bench.state.check_drift.value
    click(page.run.resume)
    qtbot.waitUntil(in_phase(bench, Phase.DONE), timeout=60_000)
    assert not page.run.drift.isVisible()
    assert page.run.drift.isChecked()


def test_a_second_scan_is_refused_in_a_sentence(qtbot: QtBot, ready: Bench, slow: None) -> None:
    page, bench, _ = ready
    click(page.run.start)
    assert page.middle.currentWidget() is page.view
    assert not page.run.start.isEnabled()
    bench.scans.start()
    assert "A scan is running" in bench.notifier.told[-1][1]
    assert bench.scans.open(Path("x.dsl")) is False


@pytest.mark.slow
def test_a_lost_camera_is_said_over_the_page(
    qtbot: QtBot, ready: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, bench, _ = ready
    monkeypatch.setattr(reconnect, "RETRY_S", 0.0)
    monkeypatch.setattr(reconnect, "ATTEMPTS", 1000)

    def silent(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        raise DeviceError("The camera sent no frame. Check its cable.")

    with monkeypatch.context() as lost:
        lost.setattr(SimCamera, "snap", silent)
        click(page.run.start)
        qtbot.waitUntil(in_phase(bench, Phase.LOST), timeout=60_000)
        assert page.banner.isVisible()
        assert "Check its cable" in page.banner.text
        # Told once, where it is seen with what to do.
        assert not any(level == "error" or "interrupted" in text for level, text in bench.notifier.told)
        assert "frames are safe" not in page.run.remarks.text()
        # The page itself makes one attempt after another.
        qtbot.waitUntil(lambda: "attempt 1 of" not in page.banner.text, timeout=60_000)
        assert page.banner.action.text() == "Connect and start again"
        assert page.stop.isVisible()
        click(page.stop)
        assert not page.stop.isVisible()
        assert "was stopped" in page.banner.text
        qtbot.waitUntil(lambda: bench.rig.state.link.value is Link.LOST)
    click(page.banner.action)
    assert not page.banner.action.isEnabled()
    qtbot.waitUntil(in_phase(bench, Phase.DONE), timeout=60_000)
    assert not page.banner.isVisible()


def test_closing_the_window_during_a_scan_loses_no_frame(qtbot: QtBot, tmp_path: Path, slow: None) -> None:
    runner = QtRunner()
    bench = make_bench(tmp_path, runner)
    bench.rig.connect(TWIN)
    qtbot.waitUntil(lambda: bench.rig.state.devices.value is not None, timeout=60_000)
    bench.plan(SHORT)
    bench.scans.start()
    seen = 0

    def begun() -> bool:
        nonlocal seen
        bench.scans.take_news()
        seen = bench.state.status.value.done
        return seen > 2

    qtbot.waitUntil(begun, timeout=60_000)
    bench.scans.pause()
    runner.shut_down()
    reader = ScanReader(tmp_path / "first.dsl")
    assert len(list(reader.plan.shots())) - len(reader.missing()) >= seen


def test_an_edited_plan_is_ones_own(ready: Bench) -> None:
    page, bench, _ = ready
    page.plan.step.setValue(3)
    spectral = bench.state.plan.value.spectral
    assert isinstance(spectral, LineComb)
    # As near to the preset's period as whole steps come.
    assert isinstance(SHORT.spectral, LineComb)
    assert spectral.step_px == 3
    assert spectral.period_px == 3 * round(SHORT.spectral.period_px / 3)
    assert page.plan.period.value() == spectral.period_px
    assert page.plan.preset.currentText() == "Custom plan"


def test_exposures_snap_to_whole_cycles(ready: Bench) -> None:
    page, bench, _ = ready
    exposure, _ = page.plan.settings._rows[0]
    exposure.setValue(95.0)
    assert bench.state.plan.value.settings[0].exposure_ms == pytest.approx(6 * 1000 / 60)
    assert exposure.value() == pytest.approx(100.0)
    page.plan.settings._add()
    assert len(page.plan.settings._rows) == 3
    assert bench.state.plan.value.code_settings == (0, 1, 2)
    page.plan.settings._remove(0)
    assert len(bench.state.plan.value.settings) == 2


def test_room_that_is_made_on_the_disk_is_seen_on_coming_back(
    ready: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, bench, _ = ready
    with monkeypatch.context() as full:
        full.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1_000))
        bench.scans.plans.refresh()
    assert not page.run.start.isEnabled()
    QApplication.sendEvent(page, QEvent(QEvent.Type.WindowActivate))
    assert page.run.start.isEnabled()


def test_an_override_is_shown_as_it_is(ready: Bench) -> None:
    page, bench, _ = ready
    bench.scans.plans.set_override(True)
    assert page.calibration.override.isChecked()
    assert page.calibration.override.isVisible()
    page.calibration.override.click()
    assert not bench.state.override.value


def test_a_calibration_that_cannot_be_read_is_not_shown_as_if_in_use(qtbot: QtBot, ready: Bench) -> None:
    page, bench, _ = ready
    bench.library.store("torn", bench.calibration)
    bench.scans.plans.load_library()
    qtbot.waitUntil(lambda: page.calibration.choice.findData("torn") > 0, timeout=60_000)
    shutil.rmtree(bench.library.home / "torn")
    page.calibration.choice.setFocus()
    QTest.keyClick(page.calibration.choice, Qt.Key.Key_Down)
    assert page.calibration.choice.currentData() == "torn"
    qtbot.waitUntil(lambda: bool(bench.notifier.told), timeout=60_000)
    assert bench.state.calibration.value.key == ""
    assert page.calibration.choice.currentData() == ""
    assert "no calibration 'torn'" in bench.notifier.told[-1][1]


def test_a_scan_that_is_resumed_shows_the_calibration_that_it_keeps(ready: Bench) -> None:
    page, bench, _ = ready
    before = page.calibration.choice.currentText()
    bench.state.calibration.set(CalibrationChoice("Labor", "Labor"))
    bench.state.interrupted.set(InterruptedScan(Path("half.dsl"), 30, 76, calibration="first rig"))
    assert page.calibration.choice.currentText() == "first rig"
    assert not page.calibration.isEnabled()
    bench.state.calibration.set(bench.state.calibrations.value[0])
    bench.state.interrupted.set(None)
    assert page.calibration.choice.currentText() == before


def test_no_reconstruction_is_promised_without_calibration(ready: Bench) -> None:
    page, _, _ = ready
    facts, run = page._state.facts, page.run
    assert facts.value is not None
    page._state.then_reconstruct.set(True)
    assert run.then.isEnabled()
    facts.set(replace(facts.value, is_calibrated=False))
    assert not run.then.isEnabled()
    assert run.then.isChecked()


def test_a_step_wider_than_the_line_is_said_and_not_started(ready: Bench) -> None:
    page, _, _ = ready
    page.plan.step.setValue(9)
    assert not page.run.start.isEnabled()
    assert "leave columns between them dark" in page.run.remarks.text()


@pytest.mark.slow
def test_arrow_keys_follow_another_pixel(qtbot: QtBot, ready: Bench) -> None:
    page, bench, _ = ready
    click(page.run.start)
    qtbot.waitUntil(in_phase(bench, Phase.DONE), timeout=60_000)
    QTest.keyClick(page.view.content.picture, Qt.Key.Key_Right)
    QTest.keyClick(page.view.content.picture, Qt.Key.Key_Down)
    assert bench.state.cursor.value == (36, 28)
    assert "Intensity graph at 36, 28" in page.view.content.graph._title.text()


@pytest.fixture
def predicted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Predictions that take no time."""
    from dsl_core.planning import prediction

    monkeypatch.setattr(
        prediction, "predict", lambda rig, plan, view, latency_ms: made_up_prediction(rig, plan, latency_ms)
    )


def figures(page: ScanPage, column: int) -> dict[str, str]:
    table = page.forecast.table
    cells = [(table.item(row, 0), table.item(row, column)) for row in range(table.rowCount())]
    return {name.text(): value.text() for name, value in cells if name is not None and value is not None}


def begin(qtbot: QtBot, page: ScanPage) -> ForecastState:
    control = page.forecast._controller
    assert isinstance(control, ForecastController)
    control.predict_all()
    qtbot.waitUntil(lambda: control.state.progress.value == (0, 0), timeout=60_000)
    return control.state


def test_nothing_is_shown_before_it_is_predicted(ready: Bench) -> None:
    page, _, _ = ready
    assert set(figures(page, 1).values()) == {"–"}
    assert "Nothing is predicted yet" in page.forecast._note.text()
    assert "need a connected rig" in page.forecast._note.text()
    page.forecast._state.is_ready.set(True)
    # With a rig and a calibration nobody is told to connect one.
    assert page.forecast._note.text() == READY
    assert not page.forecast.ask.isEnabled()


def test_dragging_the_marker_shows_what_is_expected_and_dropping_chooses(
    qtbot: QtBot, ready: Bench, predicted: None
) -> None:
    page, bench, _ = ready
    state = begin(qtbot, page)
    curve = page.forecast.curve.content
    assert figures(page, 1)["Frames"] == str(SHORT.shot_count)
    assert figures(page, 2)["Frames"] == "748"
    assert figures(page, 2)["Capture"] == "3.7 min"
    published = state.published
    assert published is not None
    at = curve.spot(published)
    assert at is not None
    # A drag moves the marker many times before it is dropped.
    curve.marker.moving = True
    curve.marker.setPos(at[0] - 0.004, at[1])
    curve.marker.sigPositionChanged.emit(curve.marker)
    assert figures(page, 1)["Frames"] == "748"
    assert bench.state.preset is PRESETS[0]
    curve.marker.sigPositionChangeFinished.emit(curve.marker)
    assert bench.state.preset is PRESETS[-1]
    assert page.plan.preset.currentData() == "reference"
    assert curve.marker.pos() == QPointF(*at)


def test_arrow_keys_walk_along_the_curve(qtbot: QtBot, ready: Bench, predicted: None) -> None:
    page, bench, _ = ready
    state = begin(qtbot, page)
    page.forecast.curve.content.plot.setFocus()
    QTest.keyClick(page.forecast.curve.content.plot, Qt.Key.Key_Right)
    current = state.current.value
    assert current is not None
    assert current in page.forecast.curve.content.front()
    assert current.expected.seconds > SHORT.duration_s(50.0)
    QTest.keyClick(page.forecast.curve.content.plot, Qt.Key.Key_Left)
    assert bench.state.preset is PRESETS[0]


def test_a_wish_for_time_is_answered(qtbot: QtBot, ready: Bench, predicted: None) -> None:
    page, bench, _ = ready
    begin(qtbot, page)
    page.forecast.budget.setValue(100)
    click(page.forecast.ask)
    assert bench.state.preset is not None
    assert bench.state.preset.key == "coarse"
    assert "Chosen: Coarse, 93 s" in page.forecast._answer.text()
    page.forecast.wish.setCurrentIndex(1)
    assert page.forecast.error.isVisible()
    page.forecast.error.setValue(0.001)
    click(page.forecast.ask)
    assert "No plan is expected to reach" in page.forecast._answer.text()


def test_nothing_is_asked_for_while_a_scan_runs(qtbot: QtBot, ready: Bench, predicted: None) -> None:
    page, bench, _ = ready
    state = begin(qtbot, page)
    bench.state.phase.set(Phase.RUNNING)
    # News of predictions come while it runs.
    state.progress.set((1, 7))
    boxes = (page.forecast.ask, page.forecast.wish, page.forecast.budget, page.forecast.error)
    assert not any(box.isEnabled() for box in boxes)
    bench.state.phase.set(Phase.DONE)
    assert all(box.isEnabled() for box in boxes)
    state.progress.set((0, 0))


def test_every_figure_has_its_curve(qtbot: QtBot, ready: Bench, predicted: None) -> None:
    page, _, _ = ready
    begin(qtbot, page)
    for index in range(page.forecast.curve.content.figure.count()):
        page.forecast.curve.content.figure.setCurrentIndex(index)
        assert len(page.forecast.curve.content.front()) >= 1
        assert page.forecast.curve.content.marker.isVisible()


@pytest.mark.slow
def test_after_a_scan_its_figures_stand_beside(qtbot: QtBot, ready: Bench) -> None:
    page, bench, _ = ready
    click(page.run.start)
    qtbot.waitUntil(in_phase(bench, Phase.DONE), timeout=60_000)
    assert figures(page, 3)["Frames"] == str(SHORT.shot_count)
    # The twin does not wait for exposures.
    assert figures(page, 3)["Capture"] == "–"


def test_a_result_does_not_interrupt_work_on_another_page(ready: Bench, tmp_path: Path) -> None:
    page, bench, opened = ready
    first, second, third = (tmp_path / f"{name}.zarr" for name in ("first", "second", "third"))
    bench.state.result.emit(first)
    assert opened == [first]
    page.hide()
    bench.state.result.emit(second)
    assert opened == [first]
    assert bench.notifier.told[-1] == ("info", "The result second is saved.")
    bench.notifier.offers["Open the result"]()
    assert opened == [first, second]
    page._awaits_result = lambda: True
    bench.state.result.emit(third)
    assert opened == [first, second, third]


def test_a_plan_is_saved_and_opened_by_the_buttons(
    qtbot: QtBot, ready: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    page, bench, _ = ready
    path = tmp_path / "Plan v1.2.json"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(tmp_path / "Plan v1.2"), ""))
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *_: (str(path), ""))
    click(page.plan.save)
    qtbot.waitUntil(path.is_file)
    bench.scans.plans.choose_preset("quick")
    click(page.plan.open)
    qtbot.waitUntil(lambda: bench.state.preset is PRESETS[0])
    assert page.plan.preset.currentData() == "preview"


def test_a_scan_of_another_picture_size_fills_the_view(qtbot: QtBot) -> None:
    picture = FramePicture()
    qtbot.addWidget(picture)
    picture.resize(600, 400)
    picture.show()
    shot = next(iter(SHORT.shots()))
    for width, height, cell_px in ((48, 32, 2), (600, 400, 2), (600, 400, 4), (30, 20, 2)):
        seen = LivePicture(SHORT, shot, np.zeros((height, width, 3), np.uint8), cell_px)
        picture.show_picture(seen)
        view = picture.box.viewRect()
        assert view.contains(QRectF(0, 0, width * cell_px, height * cell_px))
        assert view.height() < 1.2 * height * cell_px


@pytest.mark.slow
def test_the_pattern_beside_a_frame_is_that_of_its_shot_as_bright_as_can_be() -> None:
    shots = list(SHORT.shots())
    picture = np.zeros((20, 30, 3), np.uint8)
    lines, white, repeated = (
        next(each for each in shots if each.role == role) for role in ("spectral", "white", "sentinel")
    )
    drawn = [pattern_levels(LivePicture(SHORT, shot, picture, 2)) for shot in (lines, white, repeated)]
    assert [(levels.min(), levels.max()) for levels in drawn[:2]] == [(0, 255), (255, 255)]
    original = LivePicture(SHORT, SHORT.original(repeated), picture, 2)
    np.testing.assert_array_equal(drawn[2], pattern_levels(original))


def test_arrow_keys_come_back_into_a_smaller_picture(qtbot: QtBot) -> None:
    picture = FramePicture()
    qtbot.addWidget(picture)
    shot = next(iter(SHORT.shots()))
    picture.show_picture(LivePicture(SHORT, shot, np.zeros((20, 30, 3), np.uint8), 2))
    picture.show_cursor((500, 10))
    with qtbot.waitSignal(picture.pointed) as pointed:
        QTest.keyClick(picture, Qt.Key.Key_Left)
    assert pointed.args == [(55, 10)]


def test_the_curve_is_saved_as_a_figure(qtbot: QtBot, ready: Bench, predicted: None, tmp_path: Path) -> None:
    page, _, _ = ready
    plot = page.forecast.curve.content.plot
    assert page.figure() is None
    begin(qtbot, page)
    figure = page.figure()
    assert figure is not None
    save_figure(figure, tmp_path / "curve.svg", DARK)
    assert "Capture time" in (tmp_path / "curve.svg").read_text("utf-8")
    assert plot.backgroundBrush().color().name() == DARK.base
