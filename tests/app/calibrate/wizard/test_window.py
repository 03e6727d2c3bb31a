"""A wizard by mouse and keys."""

from __future__ import annotations

import pytest
from dsl_app.calibrate.state import RowState
from dsl_app.calibrate.wizard.state import Doing
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QWidget

from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.calibrate.page_stage import Stage, by_hand, cell, click


def test_a_calibration_by_mouse_from_placing_to_accepting(stage: Stage) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    buttons, state = wizard.buttons, stage.bench.wizards[-1][0]
    assert wizard.stack.currentWidget() is wizard.step
    assert wizard.step.instruction.text() == "Place the dim target."
    assert not buttons.all.isVisible()
    click(buttons.check)
    stage.wait(lambda: "Everything is right" in wizard.step.verdict.text())
    assert wizard.step.figures.rowCount() == 1
    click(buttons.capture)
    stage.wait(lambda: state.at.value == 2 and state.doing.value is Doing.IDLE)
    click(buttons.capture)
    stage.wait(lambda: wizard.stack.currentWidget() is wizard.fit)
    assert wizard.fit.verdict.text() == "All steps are captured. Fit them to see how good they are."
    click(buttons.fit)
    stage.wait(lambda: state.fit.value is not None)
    assert cell(wizard.fit.figures, 0, 1) == "Brightest"
    assert "within their limits" in wizard.fit.verdict.text()
    click(buttons.accept)
    stage.wait(lambda: "The rig is saved in" in state.note.value and state.doing.value is Doing.IDLE)
    said, height_px = buttons.findChild(QLabel), buttons.height()
    assert isinstance(said, QLabel)
    assert said.text().startswith("Self-test: accepted.")
    assert said.width() == buttons.width(), "the end of the sentence is cut off beside nothing"
    buttons._bar.show()
    layout = buttons.layout()
    assert layout is not None
    layout.activate()
    assert buttons.sizeHint().height() <= height_px, "the page above jumps"
    buttons._bar.hide()
    assert buttons.leave.text() == "&Close"
    assert buttons.following.text() == "&Next: Geometry…"
    assert buttons.following.property("role") == "primary"
    click(buttons.following)
    stage.wait(lambda: len(stage.windows) == 2)
    assert stage.windows[-1].windowTitle() == "Calibrate: Geometry"
    stage.windows[-1].reject()
    stage.wait(lambda: stage.bench.row("selftest").state is RowState.GOOD)
    row = stage.page.rows["selftest"]
    assert row.accessibleName() == f"{row._title.text()[4:]}: good."
    assert row.state.text() == "● good"
    assert row.figure.text().startswith("brightest")
    assert row.run.text() == "Open…"


def test_a_calibration_by_keys_alone(stage: Stage) -> None:
    by_hand(stage)
    stage.page.rows["selftest"].run.setFocus()
    QTest.keyClick(stage.page.rows["selftest"].run, Qt.Key.Key_Space)
    stage.wait(lambda: bool(stage.windows))
    wizard, state = stage.windows[-1], stage.bench.wizards[-1][0]
    assert state.at.value == 1
    for page in (2, 3):
        QTest.keyClick(wizard, Qt.Key.Key_Return)  # captures, the main button of a step
        stage.wait(lambda page=page: state.at.value == page and state.doing.value is Doing.IDLE)  # type: ignore[misc]
    QTest.keyClick(wizard, Qt.Key.Key_Return)
    stage.wait(lambda: state.fit.value is not None and state.doing.value is Doing.IDLE)
    QTest.keyClick(wizard, Qt.Key.Key_A, Qt.KeyboardModifier.AltModifier)
    stage.wait(lambda: "The rig is saved in" in state.note.value)
    QTest.keyClick(wizard, Qt.Key.Key_F1)
    assert any(w.windowTitle().startswith("Help") for w in wizard.findChildren(QWidget))
    QTest.keyClick(wizard, Qt.Key.Key_Escape)
    stage.wait(lambda: stage.bench.row("selftest").state is RowState.GOOD)


def test_settings_are_last_and_lead_back_to_the_work(stage: Stage) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    last = wizard.steps.item(wizard.steps.count() - 1)
    assert last.text() == "⚙  Advanced"
    spot = wizard.steps.visualItemRect(last).center()
    QTest.mouseClick(wizard.steps.viewport(), Qt.MouseButton.LeftButton, pos=spot)
    assert wizard.stack.currentWidget() is wizard.settings
    assert not wizard.buttons.next.isVisible()
    click(wizard.buttons.back)
    assert wizard.stack.currentWidget() is wizard.step
    assert not wizard.buttons.back.isEnabled()


def test_all_steps_at_once_where_the_rig_places_targets(stage: Stage) -> None:
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    assert wizard.buttons.all.isVisible()
    click(wizard.buttons.all)
    stage.wait(lambda: state.fit.value is not None)
    assert [each.state for each in state.statuses.value] == ["captured", "captured"]
    assert wizard.steps.item(0).text() == "✓  dim picture"


def test_closing_during_a_capture_asks_and_keeps_what_is_there(
    stage: Stage, slow: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    click(wizard.buttons.capture)
    taken = stage.bench.campaign / "selftest" / "dim" / "scan.dsl"
    stage.wait(taken.is_dir)
    assert state.doing.value is Doing.CAPTURING
    asked: list[str] = []

    def answer(goes: bool) -> None:
        def ask(_parent: object, _title: str, text: str, **_buttons: str) -> bool:
            asked.append(text)
            return goes

        monkeypatch.setattr("dsl_app.calibrate.wizard.window.confirm", ask)

    answer(False)
    wizard.close()
    assert wizard.isVisible()
    assert "Frames captured so far are kept" in asked[-1]
    answer(True)
    wizard.close()
    assert not wizard.isVisible()
    stage.idle()
    assert taken.is_dir()
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    click(wizard.buttons.capture)
    stage.wait(lambda: state.statuses.value[0].state == "captured")


def test_stop_ends_a_capture_soon(stage: Stage, slow: None) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    click(wizard.buttons.capture)
    stage.wait(wizard.buttons.stop.isVisible)
    assert not wizard.buttons.next.isEnabled()
    click(wizard.buttons.stop)
    stage.qtbot.waitUntil(lambda: state.doing.value is Doing.IDLE, timeout=2_000)
    assert "Stopped" in state.note.value
    assert wizard.buttons.capture.isVisible()


def test_a_lost_camera_stands_in_the_wizard(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]

    def silent(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        raise DeviceError("The camera sent no frame. Check its cable.")

    with monkeypatch.context() as lost:
        lost.setattr(SimCamera, "snap", silent)
        click(wizard.buttons.capture)
        stage.wait(wizard.banner.isVisible)
    assert "Check its cable" in wizard.banner.text
    click(wizard.banner.action)
    stage.wait(lambda: not wizard.banner.isVisible() and stage.runner.active == ())
    click(wizard.buttons.capture)
    stage.wait(lambda: state.statuses.value[0].state == "captured")


def test_figures_outside_their_limits_need_leave_to_be_accepted(stage: Stage) -> None:
    stage.bench.wrong = {"largest_dn": 1.0}
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    click(wizard.buttons.all)
    stage.wait(lambda: state.fit.value is not None)
    assert wizard.fit.verdict.text().startswith("✗ 0 of 1 figures")
    assert cell(wizard.fit.figures, 0, 4) == "Open the aperture."
    assert not wizard.buttons.accept.isEnabled()
    wizard.fit.allow.click()
    assert wizard.buttons.accept.isEnabled()
    click(wizard.buttons.discard)
    stage.wait(lambda: state.fit.value is None)
    assert not wizard.buttons.accept.isEnabled()
