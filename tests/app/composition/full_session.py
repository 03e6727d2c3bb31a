"""A day at the rig by mouse and keys; run by its test in a process of its own, on two monitors.

Connect, self-test, every wizard, a scan on the second screen, results, marks, export, close and reopen.
"""

from __future__ import annotations

import os
import resource
import sys
import time
import traceback
from pathlib import Path

from dsl_app.calibrate.campaign_box import NewCampaignDialog
from dsl_app.calibrate.page import CalibratePage
from dsl_app.calibrate.state import RowState
from dsl_app.calibrate.wizard.settings_page import BoardEdit
from dsl_app.calibrate.wizard.state import Doing
from dsl_app.calibrate.wizard.window import CalibrationWizard
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link
from dsl_app.results.export.dialog import ExportDialog
from dsl_app.results.page import ResultsPage
from dsl_app.results.state import ResultsState, ResultView
from dsl_app.rig.page import RigPage
from dsl_app.scan.page import ScanPage
from dsl_app.scan.state import Phase
from dsl_app.shell.application import ExceptionHook, make_application
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import QPoint, QPointF, Qt, QtMsgType, qInstallMessageHandler
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QCheckBox, QLineEdit, QWidget

from tests.app.composition.person import (
    choose,
    click,
    double_click,
    drag,
    drop,
    key,
    opened,
    type_letter,
    wait,
    when_asked,
    write,
)
from tests.app.composition.screen_reader import ScreenReader, screen_of
from tests.app.support.two_screens import PROJECTOR, plug, unplug
from tests.cases.memory import do_not_wait_for_the_disk

CONTROL = Qt.KeyboardModifier.ControlModifier
CAMPAIGN = "room 12"
RIG = "size=112x72 truth=4"
#: Settings that make each calibration small, by the keys of their fields.
SETTINGS: dict[str, dict[str, str]] = {
    "geometry": {"board": "7 5 30", "poses": "4"},
    "spectralon": {},
    "color-checker": {},
    "bandpass": {"filters_nm": "450:650:50", "line_px": "10", "pixels": "1500"},
    "depth-stage": {
        "positions_mm": "620,850",
        "filters_nm": "450,640",
        "code_step_px": "5",
        "filter_step_px": "32",
        "chain": "false",
    },
}
KEYS = dict(
    zip(SETTINGS, (Qt.Key.Key_F5, Qt.Key.Key_F6, Qt.Key.Key_F7, Qt.Key.Key_F8, Qt.Key.Key_F9), strict=True)
)


class Session:
    """One window with its pages, and what a person does in it."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.composition = Composition(StartOptions())
        self.window: MainWindow = self.composition.open_window(home)
        self.hook = ExceptionHook(self.window.toasts)
        self.hook.install()
        self.window.setGeometry(0, 0, 1280, 800)
        self.window.show()
        self.window.activateWindow()
        assert QTest.qWaitForWindowActive(self.window)

    def idle(self) -> None:
        wait(lambda: not self.window.parts.runner.active, "all work to end")

    def close_toasts(self) -> None:
        """Take messages away that lie over what is needed; errors are no part of this day."""
        for toast in self.window.toasts.shown:
            assert toast.level != "error", toast.text
            toast.dismiss()
        QApplication.processEvents()

    # Rig and calibrations --------------------------------------------------------------------------

    def connect(self) -> None:
        """Type the rig's options and connect it."""
        key(Qt.Key.Key_1, self.window, CONTROL)
        page = self.window.page_of("rig")
        assert isinstance(page, RigPage)
        write(page.options.text, RIG)
        click(page.connect_button)
        rig = self.composition.rig
        wait(lambda: rig.state.link.value is Link.OPEN, "the rig to answer")

    def self_test(self) -> None:
        """By the button of the Rig page; begins a campaign; every step by hand."""
        page = self.window.page_of("rig")
        assert isinstance(page, RigPage)

        def begin(dialog: NewCampaignDialog) -> None:
            write(dialog.name, CAMPAIGN)
            click(dialog.begin)

        when_asked(NewCampaignDialog, begin)
        click(page.selftest)
        wizard = opened(CalibrationWizard)
        state, buttons = wizard._state, wizard.buttons
        # A rig that places targets looks at once.
        if not buttons.check.isChecked():
            click(buttons.check)
        wait(lambda: state.look.value is not None, "a look at the target")
        assert state.look.value is not None
        assert state.look.value.is_good
        click(buttons.capture)
        wait(lambda: state.at.value == state.last and state.doing.value is Doing.IDLE, "the capture")
        self._judge(wizard, fit=True)

    def calibrate(self, name: str) -> None:
        """By the key of the wizard; types its settings, captures all and accepts."""
        key(KEYS[name], self.window)
        wizard = opened(CalibrationWizard)
        state = wizard._state
        wizard.steps.setCurrentRow(wizard.steps.count() - 1)
        wait(lambda: wizard.stack.currentWidget() is wizard.settings, "the settings")
        for field, text in SETTINGS[name].items():
            _set(wizard.settings.fields[field], text)
            wait(lambda: state.doing.value is Doing.IDLE, f"the setting {field}")
        assert not state.settings_trouble.value, state.settings_trouble.value
        click(wizard.buttons.all)
        wait(lambda: state.fit.value is not None or state.trouble.value, f"the fit of {name}")
        self._judge(wizard)

    def _judge(self, wizard: CalibrationWizard, fit: bool = False) -> None:
        state, buttons = wizard._state, wizard.buttons
        if fit:
            click(buttons.fit)
        wait(lambda: state.fit.value is not None or state.trouble.value, "a fit")
        wait(lambda: state.doing.value is Doing.IDLE, "the wizard to rest")
        assert not state.trouble.value, state.trouble.value
        click(buttons.accept)
        wait(lambda: "The rig is saved in" in state.note.value, "the rig to be written")
        name = state.name
        click(buttons.leave)
        page = self.window.page_of("calibrate")
        assert isinstance(page, CalibratePage)
        rows = page._state.rows
        wait(
            lambda: any(row.name == name and row.state is RowState.GOOD for row in rows.value),
            f"{name} to be good",
        )
        self.idle()

    def use_calibration(self) -> None:
        """Let scans use what was calibrated."""
        page = self.window.page_of("calibrate")
        assert isinstance(page, CalibratePage)
        wait(lambda: page._state.library.value, "the library")
        click(page.library.use)
        self.idle()
        assert self.window.parts.settings.calibration == CAMPAIGN

    # Scan and results ------------------------------------------------------------------------------

    def scan(self) -> tuple[ScreenReader, Path]:
        """Put the chart back, choose the projector's screen, scan, and read every picture back."""
        key(Qt.Key.Key_1, self.window, CONTROL)
        page = self.window.page_of("rig")
        assert isinstance(page, RigPage)
        rig = self.composition.rig.state
        click(page.connect_button)
        wait(lambda: rig.link.value is Link.CLOSED, "the rig to be let go")
        self.idle()
        click(page.connect_button)
        wait(lambda: rig.link.value is Link.OPEN, "the rig to answer")
        choose(page.projector._screen, PROJECTOR[:2])
        wait(lambda: self.composition.screens.projector_window.is_armed, "the projector window")
        devices = rig.devices.value
        assert devices is not None
        reader = ScreenReader(devices.projector, PROJECTOR)
        devices.projector = reader.projector
        key(Qt.Key.Key_3, self.window, CONTROL)
        scan = self.window.page_of("scan")
        assert isinstance(scan, ScanPage)
        self.idle()
        choose(scan.plan.preset, "Pre")
        assert scan._state.preset is not None
        assert scan._state.preset.key == "preview"
        assert scan._state.calibration.value.key == CAMPAIGN
        click(scan.run.start)
        wait(lambda: scan._state.phase.value is Phase.DONE, "the scan")
        target = scan._state.result
        found: list[Path] = []
        target.connect(found.append)
        wait(lambda: found or self.window.page == "results", "the result")
        self.idle()
        return reader, self.results.result.value.path if self.results.result.value else found[0]

    def pull_out(self) -> str:
        """Scan once more, pull the projector's screen out in the middle, plug it in, and go on."""
        key(Qt.Key.Key_3, self.window, CONTROL)
        scan = self.window.page_of("scan")
        rig = self.window.page_of("rig")
        assert isinstance(scan, ScanPage)
        assert isinstance(rig, RigPage)
        state, display = scan._state, os.environ["DISPLAY"]
        click(scan.run.then, QPoint(8, scan.run.then.height() // 2))
        click(scan.run.start)
        wait(lambda: state.status.value.done > 5 and state.phase.value is Phase.RUNNING, "a few frames")
        unplug(display)
        wait(lambda: state.phase.value is Phase.LOST, "the scan to be interrupted")
        told = scan.banner.text
        plug(display)
        wait(lambda: screen_of(PROJECTOR) is not None, "the second screen")
        for toast in self.window.toasts.shown:
            toast.dismiss()
        key(Qt.Key.Key_1, self.window, CONTROL)
        choose(rig.projector._screen, PROJECTOR[:2])
        wait(lambda: self.composition.screens.projector_window.is_armed, "the projector window")
        key(Qt.Key.Key_3, self.window, CONTROL)
        click(scan.banner.action)
        wait(lambda: state.phase.value is Phase.DONE, "the rest of the scan")
        self.idle()
        return told

    def open_again(self) -> None:
        """Open what was open last time by a double click in the list of recent files."""
        page = self.window.page_of("results")
        assert isinstance(page, ResultsPage)
        files = page.welcome.files
        names = [files.item(i).text() for i in range(files.count())]
        row = next(i for i, name in enumerate(names) if ".zarr" in name)
        double_click(files.viewport(), files.visualItemRect(files.item(row)).center())
        wait(lambda: self.results.result.value is not None, "the last result")
        self.idle()

    @property
    def results(self) -> ResultsState:
        page = self.window.page_of("results")
        assert isinstance(page, ResultsPage)
        return page._state

    def look(self) -> None:
        """The five views by their keys, a pin, a region, a reference."""
        page, state = self.window.page_of("results"), self.results
        assert isinstance(page, ResultsPage)
        self.close_toasts()
        click(page.title)
        for view, digit in zip(reversed(ResultView), "54321", strict=True):
            type_letter(self.window, digit)
            wait(lambda view=view: state.view.value is view, f"the view {view.value}")  # type: ignore[misc]
            self.idle()
        canvas = page.image.content.canvas.viewport()
        click(canvas, _at(page, (30, 30)))
        wait(lambda: len(state.marks.value) == 1, "a pin")
        click(page.bar.tools[next(tool for tool in page.bar.tools if tool.value == "rectangle")])
        drag(canvas, _at(page, (50, 30)), _at(page, (58, 36)))
        wait(lambda: len(state.marks.value) == 2, "a region")
        drop(self.window, _reference(self.home / "reference.csv", state))
        wait(lambda: len(state.marks.value) == 3, "a reference")
        self.idle()

    def export(self) -> list[Path]:
        """Points and the pins' spectra."""
        key(Qt.Key.Key_E, self.window, CONTROL)
        dialog = opened(ExportDialog)
        click(dialog.formats["csv"], QPoint(10, 10))
        targets = list(dialog.targets.values())
        click(dialog.write)
        self.idle()
        return targets

    def close(self) -> None:
        """Leave by the key."""
        key(Qt.Key.Key_Q, self.window, CONTROL)
        wait(lambda: not self.window.isVisible(), "the window to close")


def _set(field: QWidget, text: str) -> None:
    if isinstance(field, QCheckBox):
        if field.isChecked() != (text == "true"):
            click(field, QPoint(8, field.height() // 2))
    elif isinstance(field, BoardEdit):
        for box, number in zip((field.columns, field.rows, field.square), text.split(), strict=True):
            write(box, number)
    else:
        assert isinstance(field, QLineEdit)
        write(field, text)


def _at(page: ResultsPage, pixel: tuple[int, int]) -> QPoint:
    """Where a pixel of the result lies on the canvas."""
    image = page.image.content
    at = image.canvas.mapFromScene(image.box.mapViewToScene(QPointF(*pixel)))
    return QPoint(at.x(), at.y())


def _reference(path: Path, state: ResultsState) -> Path:
    spectrum = state.marks.value[0].spectrum
    rows = "\n".join(f"{nm:g},{value:.5f}" for nm, value in zip(spectrum.nm, spectrum.mean, strict=True))
    path.write_text(f"nm,reflectance\n{rows}\n")
    return path


def main(home: Path) -> None:
    do_not_wait_for_the_disk()
    warnings: list[str] = []
    make_application([])
    qInstallMessageHandler(
        lambda kind, _context, text: warnings.append(text) if kind != QtMsgType.QtDebugMsg else None
    )
    wait(lambda: screen_of(PROJECTOR) is not None, "the second screen")
    session = Session(home)
    session.connect()
    session.self_test()
    for name in SETTINGS:
        session.calibrate(name)
        _say(f"calibrated: {name}")
    session.use_calibration()
    reader, result = session.scan()
    _say(f"pulled out: {session.pull_out()}")
    key(Qt.Key.Key_4, session.window, CONTROL)
    _say(f"pictures on the second screen: {reader.compared}, differing pixels: {reader.differing}")
    session.look()
    exported = session.export()
    _say(f"exported: {sorted(path.suffix for path in exported if path.stat().st_size > 0)}")
    marks = [(mark.kind, mark.name) for mark in session.results.marks.value]
    session.close()

    again = Session(home)
    assert again.window.page == "results"
    again.open_again()
    value = again.results.result.value
    assert value is not None
    assert value.path == result
    assert [(mark.kind, mark.name) for mark in again.results.marks.value] == marks
    rig = again.composition.rig.state.choice.value
    assert rig.options == tuple(tuple(part.split("=")) for part in RIG.split())
    again.close()
    _say(f"opened again with: {[kind for kind, _ in marks]}")
    _say(f"warnings: {warnings}")
    _say(f"seconds of CPU: {time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime:.0f}")


def _say(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]))
    except BaseException:
        # The application's own hook keeps the console clean, which a test must not be.
        traceback.print_exc()
        raise SystemExit(1) from None
