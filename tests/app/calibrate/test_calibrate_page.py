from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from dsl_app.calibrate.campaign_box import NewCampaignDialog
from dsl_app.calibrate.evidence.base import PlainEvidence
from dsl_app.calibrate.library_panel import DriftWindow
from dsl_app.calibrate.page import CalibratePage
from dsl_app.calibrate.state import ABOUT, DriftVerdict, RowState
from dsl_app.calibrate.wizard.settings_page import BoardEdit, SettingsPage
from dsl_app.calibrate.wizard.state import Doing
from dsl_app.calibrate.wizard.window import CalibrationWizard
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shared.theme import DARK, LIGHT
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QDesktopServices
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QFileDialog,
    QLabel,
    QLineEdit,
    QMessageBox,
    QTableWidget,
    QWidget,
)
from pytestqt.qtbot import QtBot

from dsl_core.errors import DeviceError
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.model.figure import Figure
from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.calibrate.calibrate_bench import CalibrateBench, make_bench

LIMITED = Figure(name="error", value=0.8, std=0.1, unit="px", high=0.5, advice="Hold it still.")


class Stage:
    """The page on a host window, and the wizards that it opened."""

    def __init__(self, qtbot: QtBot, folder: Path) -> None:
        self.qtbot, self.runner = qtbot, QtRunner()
        self.bench: CalibrateBench = make_bench(folder, self.runner)
        bench = self.bench
        self.page = CalibratePage(bench.state, bench.rig.state, bench.control, folder)
        qtbot.addWidget(self.page)
        self.page.apply_theme(LIGHT)
        self.page.resize(1196, 740)
        self.page.show()
        self.windows: list[CalibrationWizard] = []
        bench.control.wizard_ready.connect(self._open)
        bench.rig.connect(bench.rig.state.choice.value)
        self.wait(lambda: bench.rig.state.devices.value is not None)

    def _open(self, pair: object) -> None:
        state, control = self.bench.wizards[-1]
        self.windows.append(CalibrationWizard(state, control, LIGHT, self.page))
        self.windows[-1].open()

    def wait(self, until: Callable[[], bool]) -> None:
        self.qtbot.waitUntil(until, timeout=60_000)

    def idle(self) -> None:
        self.wait(lambda: self.runner.active == ())

    def wizard(self, name: str) -> CalibrationWizard:
        """Open a wizard by the button of its row."""
        count = len(self.windows)
        click(self.page.rows[name].run)
        self.wait(lambda: len(self.windows) > count)
        return self.windows[-1]

    def finish(self) -> None:
        self.page.release()
        self.runner.shut_down()


@pytest.fixture
def stage(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    # The small calibrations bear the names of real ones, but not their records.
    monkeypatch.setattr("dsl_app.calibrate.wizard.fit_page.make_evidence", lambda name: PlainEvidence())
    made = Stage(qtbot, tmp_path)
    made.bench.control.begin_campaign(made.bench.campaign)
    made.idle()
    yield made
    made.finish()


def click(button: QWidget) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def cell(table: QTableWidget, row: int, column: int) -> str:
    item = table.item(row, column)
    assert item is not None
    return item.text()


def by_hand(stage: Stage) -> None:
    devices = stage.bench.rig.state.devices.value
    assert devices is not None
    devices.place = None


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    snap = SimCamera.snap

    def slowly(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        time.sleep(0.3)
        return snap(self, timeout_ms)

    monkeypatch.setattr(SimCamera, "snap", slowly)


def test_a_calibration_by_mouse_from_placing_to_accepting(stage: Stage) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    buttons, state = wizard.buttons, stage.bench.wizards[-1][0]
    assert wizard.stack.currentWidget() is wizard.settings
    click(buttons.next)
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
    assert cell(wizard.fit.figures, 0, 1) == "brightest"
    assert "within their limits" in wizard.fit.verdict.text()
    click(buttons.accept)
    stage.wait(lambda: "The rig is saved in" in state.note.value)
    assert buttons.leave.text() == "&Close"
    click(buttons.leave)
    stage.wait(lambda: stage.bench.row("selftest").state is RowState.GOOD)
    row = stage.page.rows["selftest"]
    assert row._state.text() == "● good"
    assert row._figure.text().startswith("brightest")
    assert row.run.text() == "Open…"


def test_a_calibration_by_keys_alone(stage: Stage) -> None:
    by_hand(stage)
    stage.page.rows["selftest"].run.setFocus()
    QTest.keyClick(stage.page.rows["selftest"].run, Qt.Key.Key_Space)
    stage.wait(lambda: bool(stage.windows))
    wizard, state = stage.windows[-1], stage.bench.wizards[-1][0]
    QTest.keyClick(wizard.steps, Qt.Key.Key_Down)
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


def test_all_steps_at_once_where_the_rig_places_targets(stage: Stage) -> None:
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    assert wizard.buttons.all.isVisible()
    click(wizard.buttons.all)
    stage.wait(lambda: state.fit.value is not None)
    assert [each.state for each in state.statuses.value] == ["captured", "captured"]
    assert wizard.steps.item(1).text() == "✓  dim picture"


def test_closing_during_a_capture_asks_and_keeps_what_is_there(
    stage: Stage, slow: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    click(wizard.buttons.next)
    click(wizard.buttons.capture)
    taken = stage.bench.campaign / "selftest" / "dim" / "scan.dsl"
    stage.wait(taken.is_dir)
    assert state.doing.value is Doing.CAPTURING
    asked: list[str] = []

    def answer(which: QMessageBox.StandardButton) -> None:
        def ask(parent: QWidget, title: str, text: str) -> QMessageBox.StandardButton:
            asked.append(text)
            return which

        monkeypatch.setattr(QMessageBox, "question", ask)

    answer(QMessageBox.StandardButton.No)
    wizard.close()
    assert wizard.isVisible()
    assert "Frames taken so far are kept" in asked[-1]
    answer(QMessageBox.StandardButton.Yes)
    wizard.close()
    assert not wizard.isVisible()
    stage.idle()
    assert taken.is_dir()
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    if state.at.value == 0:
        click(wizard.buttons.next)
    click(wizard.buttons.capture)
    stage.wait(lambda: state.statuses.value[0].state == "captured")


def test_stop_ends_a_capture_soon(stage: Stage, slow: None) -> None:
    by_hand(stage)
    wizard = stage.wizard("selftest")
    state = stage.bench.wizards[-1][0]
    click(wizard.buttons.next)
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
    click(wizard.buttons.next)

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


def test_settings_are_typed_and_wrong_ones_explained(stage: Stage) -> None:
    wizard = stage.wizard("selftest")
    field = wizard.settings.fields["scale"]
    assert isinstance(field, QLineEdit)
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, "much")
    click(wizard.buttons.next)
    QTest.keyClick(field, Qt.Key.Key_Tab)
    stage.wait(lambda: "setting scale" in wizard.settings._trouble.text())
    assert wizard.stack.currentWidget() is wizard.settings
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, "3")
    QTest.keyClick(field, Qt.Key.Key_Tab)
    stage.idle()
    assert CampaignFolder.open(stage.bench.campaign).info.settings == {"selftest": {"scale": "3"}}
    assert not wizard.settings._trouble.isVisible()


def test_boards_are_edited_as_fields(qtbot: QtBot) -> None:
    edit = BoardEdit("Board")
    qtbot.addWidget(edit)
    told: list[str] = []
    edit.edited.connect(told.append)
    edit.show_text('{"kind":"checkerboard","columns":9,"rows":6,"square_mm":25.0}')
    assert (edit.columns.value(), edit.rows.value(), edit.square.value()) == (9, 6, 25.0)
    assert told == []
    edit.columns.setValue(10)
    assert told == ['{"kind":"checkerboard","columns":10,"rows":6,"square_mm":25.0}']
    edit.kind.setCurrentIndex(1)
    edit.kind.activated.emit(1)
    assert '"marker_mm":15.0' in told[-1]
    assert not edit.marker.isHidden()


def test_a_campaign_is_begun_and_opened_from_the_page(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Stage(qtbot, tmp_path)
    assert "No campaign is open" in stage.page.head._where.text()
    (tmp_path / "taken").mkdir()

    def fill(dialog: NewCampaignDialog) -> int:
        dialog.name.setText("taken")
        assert not dialog.begin.isEnabled()
        dialog.name.setText("first")
        assert dialog.begin.isEnabled()
        return 1

    monkeypatch.setattr(NewCampaignDialog, "exec", fill)
    stage.page.page_actions()["calibrate_selftest"]()  # a campaign is begun on the way
    stage.wait(lambda: bool(stage.windows))
    stage.windows[-1].reject()
    assert (tmp_path / "first" / "campaign.json").is_file()
    stage.idle()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(tmp_path / "taken"))
    click(stage.page.head.open)
    assert "is no campaign" in stage.bench.told
    assert stage.bench.state.campaign.value is not None
    assert stage.bench.state.campaign.value.path.name == "first"
    stage.finish()


def test_another_rigs_campaign_offers_to_connect_its_rig(stage: Stage) -> None:
    other = replace(stage.bench.rig.state.choice.value, options=(("scene", "plane"), ("size", "48x32")))
    stage.bench.rig.connect(other)
    stage.wait(lambda: "is connected. Connect the campaign's rig" in stage.page.banner.text)
    assert not stage.page.head.everything.isEnabled()
    stage.idle()
    click(stage.page.banner.action)
    stage.wait(lambda: not stage.page.banner.isVisible())


def test_everything_by_one_button_and_the_library_shows_it(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert stage.page.head.everything.isEnabled()
    click(stage.page.head.everything)
    assert stage.page.head.cancel.isVisible()
    assert not stage.page.rows["selftest"].run.isEnabled()
    stage.wait(lambda: "Everything is calibrated" in stage.bench.state.note.value)
    stage.idle()
    library = stage.page.library
    assert cell(library.table, 0, 0) == "campaign"
    assert cell(library.table, 0, 3) == "TWIN-C, 32 × 24 px"
    assert "brightest" in library.details.toPlainText()
    shown: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: shown.append(url.toLocalFile()))
    click(library.report)
    stage.wait(lambda: bool(shown))
    assert Path(shown[0]).name == "campaign.html"
    click(library.use)
    assert stage.bench.state.in_use.value == "campaign"
    assert cell(library.table, 0, 2) == "scans"
    assert not library.restore.isEnabled()


def test_a_drift_check_shows_its_figures(stage: Stage) -> None:
    stage.bench.state.drift.set(DriftVerdict("room 12", (LIMITED,)))
    window = stage.page.findChild(DriftWindow)
    assert isinstance(window, DriftWindow)
    assert cell(window.table, 0, 2) == "0.80 ± 0.10 px"
    assert cell(window.table, 0, 4) == "Hold it still."
    window.close()


def test_a_missed_drift_check_offers_to_check_again_and_to_go_on(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    checks: list[tuple[object, ...]] = []
    library = type(stage.bench.control.library)
    monkeypatch.setattr(library, "check", lambda self, *asked: checks.append(asked))
    verdict = DriftVerdict("room 12", (LIMITED,), spectralon=False, overridden=("the gain was 6 and is 0",))

    def shown() -> DriftWindow:
        stage.bench.state.drift.set(replace(verdict))
        window = stage.page.findChild(DriftWindow)
        assert isinstance(window, DriftWindow)
        assert any("the gain was 6" in each.text() for each in window.findChildren(QLabel))
        return window

    window = shown()
    click(window.again)
    assert checks == [("room 12", False, True)]
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    click(shown().use)
    assert stage.bench.state.in_use.value == "room 12"


def test_a_passed_drift_check_has_nothing_to_offer(stage: Stage) -> None:
    stage.bench.state.drift.set(DriftVerdict("room 12", (LIMITED.model_copy(update={"high": 2.0}),)))
    window = stage.page.findChild(DriftWindow)
    assert isinstance(window, DriftWindow)
    assert not window.again.isVisible()
    assert not window.use.isVisible()
    window.close()


def test_every_control_has_a_name_and_a_tip(stage: Stage) -> None:
    wizard = stage.wizard("selftest")
    wizard.apply_theme(DARK)
    kinds = (QAbstractButton, QLineEdit, QAbstractSpinBox, QComboBox)
    for top in (stage.page, wizard, SettingsPage()):
        for kind in kinds:
            for control in top.findChildren(kind):
                if not control.objectName().startswith("qt_"):
                    text = control.text() if isinstance(control, QAbstractButton) else ""
                    assert control.accessibleName() or text, control
                    assert control.toolTip(), (control, text)


def test_the_page_names_every_calibration() -> None:
    from dsl_core.campaign.recipes import recipe_names

    assert tuple(ABOUT) == recipe_names()
