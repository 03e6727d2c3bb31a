"""Marks that could not be saved, as on a full disk, are written all the same, kept, and saved later."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.result.annotations_file import Annotations, load_annotations
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import write_small_result


@pytest.fixture
def full(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A page with a result next to which nothing can be written any more."""

    def fails(*_: object) -> None:
        raise StoreError("The disk is full: marks could not be written.")

    monkeypatch.setattr("dsl_app.results.marks.storage.save_annotations", fails)
    return bench


def pinned(bench: Bench) -> list[tuple[int, int] | None]:
    return [mark.pixel for mark in bench.state.marks.value]


def test_a_report_has_the_marks_that_are_listed(
    full: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    reported: list[Annotations] = []

    def keep(name: object, result: object, marks: Annotations, *_: object) -> None:
        reported.append(marks)

    target = tmp_path / "report.html"
    monkeypatch.setattr("dsl_core.analysis.session_report.session_content", keep)
    monkeypatch.setattr("dsl_core.analysis.session_report.write_report", lambda *_, **__: target)
    monkeypatch.setattr("dsl_app.results.page.ask_target", lambda *_: (target, False))
    full.control.marks.pin((3, 5))
    assert "The marks could not be saved" in full.window.toasts.shown[-1].text
    full.page.report()
    assert [pin.pixel for pin in reported[0].pins] == [(3, 5)]


def test_marks_that_cannot_be_saved_are_not_lost_with_the_window(
    full: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def stay(parent: object, title: str, text: str, **_: str) -> bool:
        asked.append(text)
        return False

    monkeypatch.setattr("dsl_app.shell.paged_window.confirm", stay)
    full.control.marks.pin((3, 5))
    assert not full.window.close()
    assert asked == [
        "The marks of small are not saved: The disk is full: marks could not be written. Quit without them?"
    ]
    monkeypatch.undo()
    result = full.state.result.value
    assert result is not None
    assert full.window.close(), "there is room again"
    assert [pin.pixel for pin in load_annotations(result.path).pins] == [(3, 5)]


def test_marks_that_cannot_be_saved_are_there_when_their_result_is_opened_again(
    full: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    full.control.marks.pin((3, 5))
    result = full.state.result.value
    assert result is not None
    (tmp_path / "other").mkdir()
    full.control.open(write_small_result(tmp_path / "other"))
    assert pinned(full) == []
    full.control.open(result.path)
    assert pinned(full) == [(3, 5)]
    monkeypatch.undo()
    full.control.marks.pin((8, 8))
    assert [pin.pixel for pin in load_annotations(result.path).pins] == [(3, 5), (8, 8)]
    assert full.control.marks.save_again() == ""
