"""Every calibration has its evidence, made without the heavy libraries and with names for everybody."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest
from dsl_app.calibrate.evidence.base import BackgroundReader, PlainEvidence, make_evidence
from dsl_app.calibrate.evidence.charts import ChartBox
from dsl_app.calibrate.evidence.tables import NumberTable, with_spread
from dsl_app.calibrate.wizard.fit_page import FitPage
from dsl_app.calibrate.wizard.state import Fit, WizardState
from dsl_app.shared.widgets.deferred import PAUSE_MS
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QTableWidget, QTabWidget, QWidget
from pytestqt.qtbot import QtBot

from dsl_core.campaign.recipes import recipe_names
from dsl_core.campaign.session import CalibrationSession
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
    wanted = (QPushButton, QTabWidget, QTableWidget)
    own = [child for child in widget.findChildren(QWidget) if isinstance(child, wanted)]
    assert [child for child in own if not child.accessibleName()] == []
    assert [child for child in own if isinstance(child, QPushButton) and not child.toolTip()] == []


def test_a_calibration_without_evidence_says_so(qtbot: QtBot) -> None:
    widget = make_evidence("of another package")
    qtbot.addWidget(widget)
    widget.show_fit(AcceptedCalibration(name="other", title="Other"), Record(), session_of({}))
    assert "Other has nothing to draw" in widget.findChildren(QLabel)[0].text()


def test_captures_without_a_fit_are_shown_where_that_helps(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[object] = []

    class Helpful(PlainEvidence):
        def show_captures(self, session: CalibrationSession) -> bool:
            seen.append(session)
            return True

    for kind, helps in ((Helpful, True), (PlainEvidence, False)):
        monkeypatch.setattr("dsl_app.calibrate.wizard.fit_page.make_evidence", lambda name, kind=kind: kind())
        state = WizardState("color-checker", "Color Checker")
        page = FitPage(state)
        qtbot.addWidget(page)
        page.show()
        session = session_of({})
        state.misfit.set(session)
        assert page.evidence is not None
        assert page.evidence.isVisible() == helps
        assert not page.figures.isVisible()
    assert len(seen) == 1


def test_evidence_waits_until_the_page_is_seen(qtbot: QtBot) -> None:
    state = WizardState("another", "Another")
    fitted = AcceptedCalibration(name="another", title="Another")
    state.fit.set(Fit(fitted, Record(), session_of({})))
    page = FitPage(state)
    qtbot.addWidget(page)
    assert page.findChildren(PlainEvidence) == []
    page.show()
    assert page.findChildren(PlainEvidence) == []
    qtbot.waitUntil(lambda: bool(page.findChildren(PlainEvidence)))
    assert page.findChildren(PlainEvidence)[0].isVisible()
    state.fit.set(None)
    assert not page.findChildren(PlainEvidence)[0].isVisible()


def test_between_two_charts_the_window_comes_round(qtbot: QtBot) -> None:
    page = QWidget()
    qtbot.addWidget(page)
    row, rounds, drawn = QHBoxLayout(page), list[None](), list[int]()
    clock = QTimer(page)
    clock.timeout.connect(lambda: rounds.append(None))
    clock.start(0)

    def draw() -> None:
        drawn.append(len(rounds))
        time.sleep(2.5e-3 * PAUSE_MS)

    boxes = [ChartBox(f"Chart {i}", "A chart", "y", "x") for i in range(3)]
    for box in boxes:
        row.addWidget(box)
        box.draw(draw)
    page.show()
    qtbot.waitUntil(lambda: len(drawn) == 3)
    assert len(set(drawn)) == 3
    boxes[1].hide()
    for box in boxes:
        box.draw(draw)
    qtbot.waitUntil(lambda: len(drawn) == 5)
    boxes[1].show()
    qtbot.waitUntil(lambda: len(drawn) == 6)


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


def test_numbers_are_written_as_people_do(qtbot: QtBot) -> None:
    assert with_spread(210.8184, 0.0204) == "210.818 ± 0.020"
    assert with_spread(2.06581, 0.000024) == "2.0658 ± 0.0001"
    assert with_spread(1234.5, 123.0) == "1234 ± 123"
    table = NumberTable("Numbers", [("Name", "Words"), ("Value", "Number")])
    qtbot.addWidget(table)
    table.fill([["a-b", "-1.5"]])
    assert table.row_texts(0) == ["a-b", "−1.5"]


def test_what_nobody_sees_is_not_drawn(qtbot: QtBot) -> None:
    box, drawn = ChartBox("A chart", "Tip", "Left", "Bottom"), list[str]()
    qtbot.addWidget(box)
    box.draw(lambda: drawn.append("first"))
    box.draw(lambda: drawn.append("latest"))
    assert drawn == []
    box.show()
    qtbot.waitUntil(lambda: drawn == ["latest"])
    box.draw(lambda: drawn.append("while it is seen"))
    qtbot.waitUntil(lambda: drawn[1:] == ["while it is seen"])
    box.draw(lambda: drawn.append("never"))
    box.say("There is nothing to draw.")
    assert box.plot is not None
    assert "never" not in drawn
