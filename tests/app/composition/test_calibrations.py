from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from dsl_app.calibrate.page import CalibratePage
from dsl_app.calibrate.wizard.window import CalibrationWizard
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import RigChoice
from dsl_app.rig.page import RigPage
from dsl_app.scan.page import ScanPage
from dsl_app.shared.settings import load_settings
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from dsl_core.devices.conditions import current_conditions
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.campaign_folder import CampaignFolder
from dsl_core.simulation.published_rig import published_rig
from tests.app.support.real_window import show_window

OPTIONS = {"scene": "plane", "size": "64x48"}


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MainWindow:
    monkeypatch.setenv("DSL_SCAN_HOME", str(tmp_path))
    composition = Composition(StartOptions(RigChoice("twin", tuple(OPTIONS.items()))))
    made = composition.open_window(tmp_path)
    show_window(qtbot, made)
    rig = composition.rig
    rig.connect(rig.state.choice.value)
    qtbot.waitUntil(lambda: rig.state.devices.value is not None, timeout=60_000)
    return made


def idle(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.waitUntil(lambda: window.parts.runner.active == (), timeout=60_000)


def test_a_program_that_is_killed_remembers_its_campaign(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    page, path = window.open_page("calibrate"), tmp_path / "room" / "march"
    assert isinstance(page, CalibratePage)
    page._commands.begin_campaign(path)
    idle(qtbot, window)
    # Nothing is closed.
    settings, trouble = load_settings(window.parts.settings_path)
    assert (settings.campaign, settings.campaigns_folder) == (str(path), str(path.parent))
    assert trouble == ""
    window.close()


@pytest.mark.slow
def test_the_self_test_opens_from_the_rig_page_on_the_real_twin(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    campaign = CampaignFolder.begin(tmp_path / "room", "twin", OPTIONS)
    window.open_path(campaign.path)
    assert window.page == "calibrate"
    idle(qtbot, window)
    page = window.open_page("rig")
    assert isinstance(page, RigPage)
    QTest.mouseClick(page.selftest, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: window.findChild(CalibrationWizard) is not None, timeout=60_000)
    wizard = window.findChild(CalibrationWizard)
    assert isinstance(wizard, CalibrationWizard)
    assert wizard.windowTitle() == "Calibrate: Self-test"
    QTest.mouseClick(wizard.buttons.all, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: wizard.fit.figures.rowCount() > 10, timeout=60_000)
    qtbot.waitUntil(wizard.buttons.leave.isEnabled, timeout=60_000)
    wizard.fit.allow.setChecked(True)
    QTest.mouseClick(wizard.buttons.accept, Qt.MouseButton.LeftButton)
    qtbot.waitUntil((tmp_path / "room" / "report.html").is_file, timeout=60_000)
    idle(qtbot, window)
    wizard.reject()
    idle(qtbot, window)
    calibrate = window.open_page("calibrate")
    assert isinstance(calibrate, CalibratePage)
    assert calibrate.rows["selftest"].run.text() == "Open…"
    assert window.parts.settings.campaign == str(tmp_path / "room")


def test_scans_use_the_calibration_that_was_chosen(qtbot: QtBot, window: MainWindow) -> None:
    library = CalibrationLibrary()
    rig = published_rig()
    library.store("room 12", rig)
    calibrate = window.open_page("calibrate")
    assert isinstance(calibrate, CalibratePage)
    qtbot.waitUntil(lambda: calibrate.library.table.rowCount() == 1, timeout=60_000)
    QTest.mouseClick(calibrate.library.use, Qt.MouseButton.LeftButton)
    # A program that is killed now remembers it: else scans would use another calibration without a word.
    qtbot.waitUntil(
        lambda: load_settings(window.parts.settings_path)[0].calibration == "room 12", timeout=60_000
    )
    scan = window.open_page("scan")
    assert isinstance(scan, ScanPage)
    qtbot.waitUntil(lambda: scan._state.calibration.value.key == "room 12", timeout=60_000)
    assert "--calibration 'room 12'" in scan.command_line()
    idle(qtbot, window)
    # An older version, once another one is current.
    old = library.stamps("room 12")[0]
    library.store("room 12", rig)
    window.open_page("calibrate")
    qtbot.waitUntil(lambda: calibrate.library.table.rowCount() == 2, timeout=60_000)
    calibrate.library.table.selectRow(1)
    QTest.mouseClick(calibrate.library.use, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: scan._state.calibration.value.key == f"room 12@{old}", timeout=60_000)
    window.open_page("scan")
    idle(qtbot, window)
    assert scan.calibration.choice.currentData() == f"room 12@{old}"
    scan.calibration.choice.setCurrentIndex(0)
    scan.calibration.choice.activated.emit(0)
    assert window.parts.settings.calibration == ""


def test_a_scan_with_other_settings_is_refused_unless_overridden(qtbot: QtBot, window: MainWindow) -> None:
    page = window.open_page("rig")
    assert isinstance(page, RigPage)
    devices = page._state.devices.value
    assert devices is not None
    conditions = current_conditions(devices)
    camera = conditions.camera.model_copy(update={"binning": 2, "gain_db": 6.0})
    other = conditions.model_copy(update={"camera": camera})
    assert devices.calibration is not None
    CalibrationLibrary().store("other", devices.calibration.model_copy(update={"conditions": other}))
    window.parts.settings.calibration = "other"
    scan = window.open_page("scan")
    assert isinstance(scan, ScanPage)
    qtbot.waitUntil(lambda: not scan.run.start.isEnabled(), timeout=60_000)
    facts = scan._state.facts.value
    assert facts is not None
    text = " ".join(facts.obstacles)
    assert "the camera's binning was 2 and is 1" in text.lower()
    assert scan.calibration.override.isVisible()
    scan.calibration.override.click()
    assert scan.run.start.isEnabled()


def test_a_calibration_that_is_gone_is_forgotten_and_told_once(qtbot: QtBot, window: MainWindow) -> None:
    window.parts.settings.calibration = "gone"
    scan = window.open_page("scan")
    assert isinstance(scan, ScanPage)
    idle(qtbot, window)
    window.open_page("calibrate")
    idle(qtbot, window)
    assert scan._state.calibration.value.key == ""
    assert window.parts.settings.calibration == ""
    (toast,) = window.toasts.shown
    assert "no longer has the calibration 'gone'. Scans use the calibration of the rig itself" in toast.text


def in_use(
    qtbot: QtBot, window: MainWindow, library: CalibrationLibrary, *names: str
) -> tuple[ScanPage, CalibratePage]:
    """The pages of a window that scans with the first of these calibrations of a library."""
    for name in names:
        library.store(name, published_rig())
    scan, calibrate = window.open_page("scan"), window.open_page("calibrate")
    assert isinstance(scan, ScanPage)
    assert isinstance(calibrate, CalibratePage)
    idle(qtbot, window)
    calibrate._state.in_use.set(names[0])
    qtbot.waitUntil(lambda: scan._state.calibration.value.key == names[0], timeout=60_000)
    idle(qtbot, window)
    return scan, calibrate


def test_a_calibration_in_use_that_leaves_the_library_is_told_once(qtbot: QtBot, window: MainWindow) -> None:
    library = CalibrationLibrary()
    scan, calibrate = in_use(qtbot, window, library, "room 12", "other")
    for name in ("room 12", "other"):
        shutil.rmtree(library.home / name)
        window.open_page("scan")
        window.open_page("calibrate")
        idle(qtbot, window)
    assert calibrate._state.library.value == ()
    assert scan._state.calibration.value.key == "room 12"
    (toast,) = window.toasts.shown
    assert "no longer has the calibration 'room 12'. Scans use it until you choose another" in toast.text


def test_a_calibration_that_cannot_be_read_is_in_use_nowhere(qtbot: QtBot, window: MainWindow) -> None:
    library = CalibrationLibrary()
    scan, calibrate = in_use(qtbot, window, library, "room 12", "torn")
    for file in (library.home / "torn").rglob("*.json"):
        file.write_text("{ torn")
    calibrate._state.in_use.set("torn")
    qtbot.waitUntil(lambda: calibrate._state.in_use.value == "room 12", timeout=60_000)
    idle(qtbot, window)
    assert scan._state.calibration.value.key == "room 12"
    assert window.parts.settings.calibration == "room 12"
    assert window.toasts.shown[-1].text.endswith("Scans use room 12.")
