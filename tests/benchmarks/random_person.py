"""A person who clicks and types whatever comes to hand, on the composed application."""

from __future__ import annotations

import random
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

from dsl_app.compare.page import ComparePage
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link, RigChoice
from dsl_app.results.page import ResultsPage
from dsl_app.scan.page import ScanPage
from dsl_app.shared.jobs.base import Job
from dsl_app.shared.jobs.qt_runner import WORKERS
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shell.application import ExceptionHook
from dsl_app.shell.main_window import MainWindow
from dsl_app.start.examples import EXAMPLES
from PySide6.QtCore import QEvent, QPoint, Qt, QTimer
from PySide6.QtGui import QDrag
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QComboBox, QDialog, QMessageBox, QWidget
from shiboken6 import isValid

from dsl_core.progress import Progress

RIG = RigChoice("twin", (("scene", "color-checker"), ("size", "112x72")))
NEVER = ("quit", "report_bundle")
KEYS = (
    *(Qt.Key.Key_1, Qt.Key.Key_2, Qt.Key.Key_3, Qt.Key.Key_4, Qt.Key.Key_5),
    *(Qt.Key.Key_Tab, Qt.Key.Key_Space, Qt.Key.Key_Return, Qt.Key.Key_Escape, Qt.Key.Key_Delete),
    *(Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_F, Qt.Key.Key_P),
)
PAGES = ("rig", "calibrate", "scan", "results", "compare")
#: How long a question may stand before it is given up, s.
QUESTION_S = 0.4
#: What a scan may compute (s of a core), and when one that computes nothing has hung (s by the clock).
PATIENCE_CPU_S, PATIENCE_S = 400.0, 3600.0
PAUSE_S = 0.05
#: When a drag that left the program is let go, ms.
DROP_MS = 500


class RandomPerson:
    """Everything it does comes from ``dice``; `done` says what it did, the latest last."""

    def __init__(self, home: Path, theme: str, dice: random.Random) -> None:
        self._home, self._dice = home, dice
        self.done: list[str] = []
        self.scans = 0
        self._composition = Composition(StartOptions())
        self.window: MainWindow = self._composition.open_window(home, "light" if theme == "light" else "dark")
        self.window.parts.settings.output_folder = str(home / "scans")
        self._hook = ExceptionHook(self.window.toasts)
        self._hook.install()
        self.window.show()
        self._questions = QTimer(self.window)
        self._questions.setInterval(int(1000 * QUESTION_S))
        self._questions.timeout.connect(_give_up)
        self._questions.start()
        self._composition.session.start()

    # At random -------------------------------------------------------------------------------------

    def act(self) -> None:
        """Do one thing."""
        kinds: list[tuple[Callable[[], str], int]] = [
            (self._press, 6),
            (self._click, 5),
            (self._type, 5),
            (self._do, 3),
            (self._drag, 2),
            (self._choose, 2),
            (self._turn_page, 3),
        ]
        acts, weights = zip(*kinds, strict=True)
        act = self._dice.choices(acts, weights)[0]
        self.done.append(act.__name__.strip("_"))
        said = act()
        self.done[-1] += f" {said}"
        self._live(self._dice.uniform(0.5, 2) * PAUSE_S)

    @property
    def _top(self) -> QWidget:
        """The dialog that is open, else the window."""
        return QApplication.activeModalWidget() or self.window

    def _press(self) -> str:
        buttons = [b for b in self._top.findChildren(QAbstractButton) if b.isVisible() and b.isEnabled()]
        if not buttons:
            return "nothing"
        button = self._dice.choice(buttons)
        name = button.text() or button.accessibleName()
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)
        return repr(name)

    def _click(self) -> str:
        # Another window may come to the top meanwhile.
        top = self._top
        at = self._spot(top)
        hit = top.childAt(at) or top
        kind, within = type(hit).__name__, hit.mapFrom(top, at)
        QTest.mouseMove(hit, within)
        # A dialog that is given up meanwhile takes its widgets with it.
        if isValid(hit):
            QTest.mouseClick(hit, Qt.MouseButton.LeftButton, pos=within)
        return f"{at.x()},{at.y()} {kind}"

    def _drag(self) -> str:
        top = self._top
        start, end = self._spot(top), self._spot(top)
        hit = top.childAt(start) or top
        kind, pressed = type(hit).__name__, hit.mapFrom(top, start)
        # Marked text that is dragged waits for a button of the real mouse, which nobody lets go.
        drop = QTimer()
        drop.timeout.connect(QDrag.cancel)
        drop.start(DROP_MS)
        QTest.mousePress(hit, Qt.MouseButton.LeftButton, pos=pressed)
        for step in (0.3, 0.7, 1.0):
            if isValid(hit):
                QTest.mouseMove(hit, pressed + (end - start) * step)
        if isValid(hit):
            QTest.mouseRelease(hit, Qt.MouseButton.LeftButton, pos=pressed + end - start)
        drop.stop()
        return f"{start.x()},{start.y()} to {end.x()},{end.y()} {kind}"

    def _type(self) -> str:
        key = self._dice.choice(KEYS)
        QTest.keyClick(QApplication.focusWidget() or self._top, key)
        return key.name

    def _do(self) -> str:
        actions = self.window.actions_by_key
        can = [key for key, action in actions.items() if action.isEnabled() and action.isVisible()]
        key = self._dice.choice([key for key in can if key not in NEVER])
        if QApplication.activeModalWidget() is None:
            actions[key].trigger()
        return key

    def _choose(self) -> str:
        boxes = [box for box in self._top.findChildren(QComboBox) if box.isVisible() and box.isEnabled()]
        boxes = [box for box in boxes if box.count()]
        if not boxes:
            return "nothing"
        box = self._dice.choice(boxes)
        box.setCurrentIndex(self._dice.randrange(box.count()))
        box.activated.emit(box.currentIndex())
        return f"{box.accessibleName()!r} {box.currentText()!r}"

    def _turn_page(self) -> str:
        page = self._dice.choice(PAGES)
        if QApplication.activeModalWidget() is None:
            self.window.open_page(page)
        return page

    def _spot(self, widget: QWidget) -> QPoint:
        return QPoint(self._dice.randrange(widget.width()), self._dice.randrange(widget.height()))

    # On purpose ------------------------------------------------------------------------------------

    def scan(self) -> None:
        """Connect where need be, scan and reconstruct; one in five is cancelled in between."""
        self.rest()
        rig = self._composition.rig
        if rig.state.link.value is not Link.OPEN or rig.state.choice.value != RIG:
            self.done.append("connect")
            rig.connect(RIG)
            self._wait(lambda: rig.state.link.value is Link.OPEN)
        page = self.window.open_page("scan")
        assert isinstance(page, ScanPage)
        self.rest()
        state, control = page._state, self._composition.scans
        assert control is not None
        control.plan_new_scan()
        control.plans.choose_preset("preview")
        control.plans.set_target(self._home / "scans" / f"scan-{self.scans}.dsl")
        state.then_reconstruct.set(True)
        self.done.append("scan")
        control.start()
        # Of the first one everything is looked at.
        if self.scans and self._dice.random() < 0.2:
            self._live(self._dice.uniform(0.2, 2.0))
            control.cancel()
        self._wait(lambda: not state.phase.value.is_busy)
        self.rest(cancel=False)
        self.scans += 1
        for old in sorted((self._home / "scans").glob("*"), key=lambda path: path.stat().st_mtime)[:-4]:
            shutil.rmtree(old, ignore_errors=True)

    def look_everywhere(self) -> None:
        """Do every action once, so that windows made when they are first wanted are there."""
        actions = self.window.actions_by_key
        left = set(actions) - {*NEVER, "live_demo", "calibrate_everything"}
        results = self.window.page_of("results")
        assert isinstance(results, ResultsPage)
        results._control.point_at((20, 20))
        for page in PAGES:
            for key in sorted(left):
                self.window.open_page(page)
                if actions[key].isEnabled() and actions[key].isVisible():
                    left.remove(key)
                    self.done.append(f"first {key}")
                    actions[key].trigger()
                    self._live(0.3)
                    if key == "view_cloud":
                        self._wait(lambda: results.cloud.view is not None)
                    self.rest()
        self._open_late_plots(results)
        self._open_examples()
        for room in self.window.findChildren(Deferred):
            _ = room.content
        self._busy_all_workers()
        self._compare(results)

    def _open_late_plots(self, results: ResultsPage) -> None:
        """Make each plot that comes with its first use: one has some 55 widgets inside."""
        self.done.append("first plots")
        _ = results.graph
        results.cloud._section_plot().hide()
        for shown in (True, False):
            results._state.contrast.set(shown)

    def _open_examples(self) -> None:
        """Open the largest results there are: the first raises the memory by 100 MB, others no more."""
        self.done.append("first examples")
        for example in EXAMPLES:
            self._composition.demo.show(example.key)
            self.rest(cancel=False)

    def _compare(self, results: ResultsPage) -> None:
        """Compare a result with itself: the scales are made for the first pair."""
        page, result = self.window.open_page("compare"), results._state.result.value
        assert isinstance(page, ComparePage)
        assert result is not None
        self.done.append("comparison")
        for second in (False, True):
            page._control.open_side(result.path, second)
            self._wait(lambda: not page.pair._state.busy.value)
        self._wait(lambda: len(page.pair.pictures.content.bars) == 2)

    def open_the_same(self) -> None:
        """Open one example on both pages that keep results, whose sizes differ by 75 MB each."""
        results = self.window.page_of("results")
        assert isinstance(results, ResultsPage)
        self._composition.demo.show(EXAMPLES[0].key)
        self.rest(cancel=False)
        self._compare(results)
        self.rest(cancel=False)

    def _busy_all_workers(self) -> None:
        """Let each worker calculate once: the last of them, and its own helpers, else come after hours."""
        import torch

        at_once = threading.Barrier(WORKERS)

        def work(_progress: Progress) -> None:
            at_once.wait()
            torch.sin(torch.ones(1_000_000))

        self.done.append("busy all workers")
        for _ in range(WORKERS):
            self.window.parts.runner.submit(Job("Calculate", work))
        self.rest(cancel=False)

    def rest(self, cancel: bool = True) -> None:
        """Leave all dialogs and let everything come to its end."""
        for _ in range(20):
            dialogs = [w for w in QApplication.topLevelWidgets() if isinstance(w, QDialog) and w.isVisible()]
            if not dialogs:
                break
            dialogs[-1].reject()
            self._live(0.1)
        runner = self.window.parts.runner

        def is_at_rest() -> bool:
            # Again and again: a rig that is connected meanwhile starts its live view, which never ends.
            if cancel:
                runner.cancel_all()
            return not runner.active

        self._wait(is_at_rest)
        for toast in list(self.window.toasts.shown):
            toast.dismiss()
        self._live(0.2)
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)

    def close(self) -> None:
        """Leave."""
        self.rest()
        self._questions.stop()
        self.window.close()

    def _wait(self, holds: Callable[[], object]) -> None:
        clock, computed = time.monotonic(), time.process_time()
        while not holds():
            waited, spent = time.monotonic() - clock, time.process_time() - computed
            running = [job.title for job in self.window.parts.runner.active]
            told = f"it never came true in {waited:.0f} s, {spent:.0f} s of them computing; jobs: {running}"
            assert max(spent / PATIENCE_CPU_S, waited / PATIENCE_S) < 1, told
            self._live(0.02)

    @staticmethod
    def _live(seconds: float) -> None:
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            QApplication.processEvents()
            time.sleep(0.003)


def _give_up() -> None:
    """Reject a question that stands in the way, such as one for a file; lose what a dialog would keep."""
    asked = QApplication.activeModalWidget()
    popup = QApplication.activePopupWidget()
    if popup is not None:
        popup.close()
    elif isinstance(asked, QMessageBox) and isinstance(asked.parentWidget(), QDialog):
        # Whether to leave that dialog unsaved: else it would stand there for ever.
        for button in asked.buttons():
            if asked.buttonRole(button) is QMessageBox.ButtonRole.AcceptRole:
                button.click()
    elif isinstance(asked, QDialog):
        # Not here: a dialog that asks in turn would wait within this timer, which could not answer.
        QTimer.singleShot(0, asked, asked.reject)
