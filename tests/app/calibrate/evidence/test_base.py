"""Every calibration has its evidence, made without the heavy libraries and with names for everybody."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
import weakref

import pytest
import shiboken6
from dsl_app.calibrate.evidence.base import BackgroundReader, PlainEvidence, make_evidence
from dsl_app.calibrate.wizard.state import Fit
from PySide6.QtCore import QThreadPool
from PySide6.QtWidgets import QLabel, QPushButton, QTabBar, QTableWidget, QWidget
from pytestqt.qtbot import QtBot

from dsl_core.campaign.recipes import recipe_names
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration
from tests.app.calibrate.evidence_bench import THEMES, session_of

MAKE_ALL = """
import sys
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication
application = QApplication([])
from dsl_app.shared.theme import DARK
from dsl_app.calibrate.evidence.base import make_evidence
for name in sys.argv[1:]:
    make_evidence(name).apply_theme(DARK)
heavy = {"torch", "scipy", "cv2", "zarr", "xarray", "colour", "matplotlib", "pyvista"} & set(sys.modules)
assert not heavy, heavy
"""


@pytest.mark.slow
def test_evidence_is_made_without_heavy_libraries() -> None:
    command = [sys.executable, "-c", MAKE_ALL, *recipe_names()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", recipe_names())
def test_everything_has_a_name_and_a_tip(qtbot: QtBot, name: str) -> None:
    widget = make_evidence(name)
    qtbot.addWidget(widget)
    assert not isinstance(widget, PlainEvidence)
    # Themes come before the first fit as well as after it.
    for theme in THEMES:
        widget.apply_theme(theme)
    # The bar of tabs has the keys, not the widget around it.
    wanted = (QPushButton, QTabBar, QTableWidget)
    own = [child for child in widget.findChildren(QWidget) if isinstance(child, wanted)]
    assert [child for child in own if not child.accessibleName()] == []
    assert [child for child in own if isinstance(child, QPushButton) and not child.toolTip()] == []


def test_a_calibration_without_evidence_says_so(qtbot: QtBot) -> None:
    widget = make_evidence("of another package")
    qtbot.addWidget(widget)
    widget.show_fit(Fit(AcceptedCalibration(name="other", title="Other"), Record(), session_of({})))
    assert "Other has no plots" in widget.findChildren(QLabel)[0].text()


def test_only_the_latest_of_what_is_read_is_shown(qtbot: QtBot) -> None:
    widget = QWidget()
    qtbot.addWidget(widget)
    reader, shown = BackgroundReader(widget), list[object]()
    for number in range(5):
        reader.read(lambda number=number: number, shown.append)  # type: ignore[misc]
    qtbot.waitUntil(lambda: not reader.is_busy)
    qtbot.wait(50)
    assert shown == [4]
    reader.read(lambda: 1 / 0, shown.append)
    qtbot.waitUntil(lambda: not reader.is_busy)
    assert isinstance(shown[1], ZeroDivisionError)


def test_a_thread_that_reads_knows_nothing_of_a_widget_that_may_be_deleted(qtbot: QtBot) -> None:
    widget, begun, go_on = QWidget(), threading.Event(), threading.Event()
    reader = BackgroundReader(widget)

    def work() -> None:
        begun.set()
        go_on.wait(10)

    reader.read(work, print)
    assert begun.wait(10)
    known = weakref.ref(reader)
    shiboken6.delete(widget)
    del reader, widget
    gc.collect()
    assert known() is None
    go_on.set()
    assert QThreadPool.globalInstance().waitForDone(10_000)
