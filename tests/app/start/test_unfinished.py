"""What was interrupted is offered on the Start page, and resumed by its button."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.shared.evented import Value
from dsl_app.start.unfinished import Unfinished, UnfinishedController, unfinished_in, worth_a_look
from dsl_app.start.unfinished_list import UnfinishedList
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from dsl_core.model.options import Options
from dsl_core.workflows import unfinished
from dsl_core.workflows.unfinished import UnfinishedResult, UnfinishedScan
from tests.app.support.doubles import InlineRunner, ManualRunner
from tests.cases.small_rig import small_rig

SCAN = UnfinishedScan(Path("x/leaf.dsl"), 383, 716, ("twin", {"scene": "sphere"}))
RESULT = UnfinishedResult(Path("x/cup.zarr"), Path("x/cup.dsl"), 3, 8, small_rig(), Options())


@pytest.fixture
def found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which a scan and a reconstruction were interrupted."""
    (tmp_path / "leaf.dsl").mkdir()
    monkeypatch.setattr(unfinished, "unfinished_scans", lambda folder: (SCAN,))
    monkeypatch.setattr(unfinished, "unfinished_results", lambda folder: (RESULT,))
    return tmp_path


def test_what_was_interrupted_is_said_in_words(found: Path) -> None:
    result, scan = unfinished_in([found])
    assert scan.words == (
        "The scan leaf was interrupted: 383 of 716 frames are safe. Rig: twin, scene sphere."
    )
    assert result.words == "The reconstruction of cup was interrupted: 3 of 8 parts are safe."
    assert (result.button, scan.button) == ("Resume reconstruction", "Resume scan…")


def test_a_scan_is_opened_and_a_reconstruction_continued(
    found: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Path] = []
    runner = ManualRunner()
    control = UnfinishedController(lambda: [found, found], runner, opened.append)
    control.look()
    runner.run_next()
    result, scan = control.found.value
    control.resume(scan)
    assert opened == [Path("x/leaf.dsl")]
    monkeypatch.setattr(unfinished, "resume_result", lambda begun, progress: begun.target)
    control.resume(result)
    assert control.found.value == (scan,), "it is offered although it runs"
    resuming = [control.is_resuming.value]
    runner.run_all()
    assert [*resuming, control.is_resuming.value] == [True, False]
    assert opened[-1] == Path("x/cup.zarr")


def test_nothing_is_read_where_there_are_no_scans(tmp_path: Path) -> None:
    runner = ManualRunner()
    control = UnfinishedController(lambda: [tmp_path, tmp_path / "gone"], runner, print)
    control.look()
    assert runner.waiting == []
    assert not worth_a_look(tmp_path)


def test_the_list_has_a_button_each_and_is_gone_when_empty(qtbot: QtBot) -> None:
    opened: list[Path] = []
    control = UnfinishedController(list, InlineRunner(), opened.append)
    shown = UnfinishedList(control)
    qtbot.addWidget(shown)
    assert shown.isHidden()
    control.found.set((Unfinished(Path("x/leaf.dsl"), "The scan leaf was interrupted.", "Resume scan…"),))
    assert not shown.isHidden()
    (button,) = shown.findChildren(QPushButton)
    assert "The scan leaf was interrupted." in [each.text() for each in shown.findChildren(QLabel)]
    button.click()
    assert opened == [Path("x/leaf.dsl")]
    control.found.set(())
    assert shown.isHidden()


def test_another_next_step_takes_the_blue_from_what_is_unfinished(qtbot: QtBot, found: Path) -> None:
    comes_second = Value(True)
    control = UnfinishedController(lambda: [found], InlineRunner(), print, comes_second)
    listed = UnfinishedList(control)
    qtbot.addWidget(listed)
    control.look()

    def roles() -> list[str]:
        return [button.property("role") or "" for button in listed.findChildren(QPushButton)]

    assert roles() == ["", ""]
    comes_second.set(False)
    assert sorted(roles()) == ["", "primary"]
