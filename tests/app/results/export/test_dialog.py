"""The export dialog."""

from __future__ import annotations

from pathlib import Path

from dsl_app.results.export.dialog import ExportDialog
from pytestqt.qtbot import QtBot

from dsl_core.io.export import formats
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench


def test_the_dialog_offers_every_format(bench: Bench, qtbot: QtBot) -> None:
    result = bench.state.result.value
    assert result is not None
    dialog = ExportDialog(result, bench.control.export, bench.page)
    qtbot.addWidget(dialog)
    assert set(dialog.formats) == {key for key, form in formats().items() if form.listed}
    assert {"ply", "glb", "envi"} <= set(dialog.formats)


def test_the_export_dialog_warns_before_it_replaces(bench: Bench, qtbot: QtBot, tmp_path: Path) -> None:
    result = bench.state.result.value
    assert result is not None
    dialog = ExportDialog(result, bench.control.export, bench.page)
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
