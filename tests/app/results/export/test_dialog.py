"""The export dialog."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.results.answers.controller import Way
from dsl_app.results.export.dialog import ExportDialog
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from dsl_core.analysis.classify import Measure
from dsl_core.io.export import formats
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench
from tests.app.support.results_controller import exports
from tests.app.support.small_result import write_small_result


def test_the_dialog_offers_every_format(bench: Bench, qtbot: QtBot) -> None:
    dialog = ExportDialog(exports(bench.control), bench.page)
    qtbot.addWidget(dialog)
    assert set(dialog.formats) == {key for key, form in formats().items() if form.listed}
    assert {"ply", "glb", "envi"} <= set(dialog.formats)


def test_the_export_dialog_warns_before_it_replaces(bench: Bench, qtbot: QtBot, tmp_path: Path) -> None:
    dialog = ExportDialog(exports(bench.control), bench.page)
    qtbot.addWidget(dialog)
    assert dialog.write.isEnabled()
    assert not dialog.formats["csv"].isEnabled()
    (tmp_path / "small.ply").write_text("mine")
    dialog.formats["png"].setChecked(True)
    assert "small.ply already exists" in dialog.text.text()
    assert not dialog.write.isEnabled()
    dialog.replace.setChecked(True)
    dialog.folder.setText("/nowhere")
    assert "not a folder" in dialog.text.text()
    dialog.folder.setText(str(tmp_path))
    dialog.write.click()
    assert (tmp_path / "small.ply").read_bytes().startswith(b"ply")
    assert (tmp_path / "small_rgb.png").exists()
    bench.window.do("export")
    opened = bench.page.findChildren(ExportDialog)
    assert opened
    for each in opened:
        each.close()


def test_the_result_that_the_dialog_was_opened_for_is_written(
    bench: Bench, qtbot: QtBot, tmp_path: Path
) -> None:
    """A reconstruction may end, and show its result, behind the dialog."""
    bench.control.marks.pin((3, 5))
    dialog = ExportDialog(exports(bench.control), bench.page)
    qtbot.addWidget(dialog)
    dialog.formats["csv"].setChecked(True)
    (tmp_path / "other").mkdir()
    bench.window.open_path(write_small_result(tmp_path / "other", spectra=False))
    assert bench.marks == ()
    dialog.write.click()
    text = (tmp_path / "small.csv").read_text("utf-8")
    assert {line.split(",")[:2] == ["3", "5"] for line in text.splitlines()[-5:]} == {True}
    assert b"scalar_" in (tmp_path / "small.ply").read_bytes()[:2000]


def test_what_was_asked_for_is_written_though_another_result_is_opened_meanwhile(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "other").mkdir()
    first, other = tmp_path / "small.zarr", write_small_result(tmp_path / "other", spectra=False)

    def choose(_parent: object, _title: str, draft: str, _kinds: str) -> tuple[str, str]:
        bench.window.open_path(other)
        return draft, ""

    monkeypatch.setattr(QFileDialog, "getSaveFileName", choose)
    page = bench.page
    for ask in (page.report, page.marks.export_spectra, page.materials.content.choose_target):
        bench.window.open_path(first)
        bench.control.marks.pin((3, 5))
        bench.control.answers.from_marks(Way(Measure.ANGLE))
        ask()
    assert not list((tmp_path / "other").glob("small_*"))
    assert "pin 1: reflectance" in (tmp_path / "small_spectra.csv").read_text("utf-8")
    assert (tmp_path / "small_materials.img").exists()
    assert "first band nm" in (tmp_path / "small_report.html").read_text("utf-8")
