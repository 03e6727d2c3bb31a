"""Marks that could not be saved, as on a full disk, are part of what is written all the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.result.annotations_file import Annotations
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench


@pytest.fixture
def full(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A page with a result next to which nothing can be written any more."""

    def fails(*_: object) -> None:
        raise StoreError("The disk is full: marks could not be written.")

    monkeypatch.setattr("dsl_app.results.marks.storage.save_annotations", fails)
    return bench


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
