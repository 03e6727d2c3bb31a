"""The Calibrate page by mouse: campaigns, everything, names and tips."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dsl_app.calibrate.campaign_box import NewCampaignDialog
from dsl_app.calibrate.state import ABOUT
from dsl_app.calibrate.wizard.settings_page import SettingsPage
from dsl_app.shared.theme import DARK
from dsl_app.shared.widgets.open_dialog import OpenDialog
from PySide6.QtCore import QPoint
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QWidget,
)
from pytestqt.qtbot import QtBot

from tests.app.calibrate.page_stage import Stage, cell, click


def test_a_campaign_is_begun_and_opened_from_the_page(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Stage(qtbot, tmp_path)
    assert "No campaign is open" in stage.page.head.place.text()
    (tmp_path / "taken").mkdir()

    def fill(dialog: NewCampaignDialog) -> int:
        dialog.name.setText("taken")
        assert not dialog.begin.isEnabled()
        dialog.name.setText("first")
        assert dialog.begin.isEnabled()
        return 1

    monkeypatch.setattr(NewCampaignDialog, "exec", fill)
    stage.page.page_actions()["calibrate_selftest"]()  # a campaign is begun on the way
    stage.wait(lambda: bool(stage.windows))
    stage.windows[-1].reject()
    assert (tmp_path / "first" / "campaign.json").is_file()
    stage.idle()
    monkeypatch.setattr(OpenDialog, "ask", lambda *_, **__: tmp_path / "taken")
    click(stage.page.head.open)
    assert "is not a campaign" in stage.bench.told
    assert stage.bench.state.campaign.value is not None
    assert stage.bench.state.campaign.value.path.name == "first"
    stage.finish()


def test_the_calibration_that_runs_is_in_view(stage: Stage) -> None:
    page, state = stage.page, stage.bench.state
    page.resize(1100, 420)

    def is_seen(name: str) -> bool:
        row, view = page.rows[name], page.area.viewport()
        top, bottom = (
            row.mapTo(view, corner).y() for corner in (row.rect().topLeft(), row.rect().bottomLeft())
        )
        return bool(top >= 0 and bottom <= view.height())

    names = list(page.rows)
    stage.wait(lambda: is_seen(names[0]) and not is_seen(names[-1]))
    for name in (names[-1], names[0]):
        state.running.set(name)
        stage.wait(lambda name=name: is_seen(name))  # type: ignore[misc]
    state.running.set("")


def test_another_rigs_campaign_offers_to_connect_its_rig(stage: Stage) -> None:
    other = replace(stage.bench.rig.state.choice.value, options=(("scene", "plane"), ("size", "48x32")))
    stage.bench.rig.connect(other)
    stage.wait(lambda: "is connected. Connect the campaign's rig" in stage.page.banner.text)
    assert not stage.page.head.everything.isEnabled()
    stage.idle()
    click(stage.page.banner.action)
    stage.wait(lambda: not stage.page.banner.isVisible())


def test_a_campaign_without_a_rig_offers_to_connect_it(stage: Stage) -> None:
    stage.bench.rig.disconnect()
    stage.wait(lambda: "No rig is connected" in stage.page.banner.text)
    assert not any(row.run.property("role") == "primary" for row in stage.page.rows.values())
    stage.idle()
    click(stage.page.banner.action)
    stage.wait(lambda: not stage.page.banner.isVisible())


def test_everything_by_one_button_and_the_library_shows_it(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert stage.page.head.everything.isEnabled()
    click(stage.page.head.everything)
    assert stage.page.head.cancel.isVisible()
    assert not stage.page.rows["selftest"].run.isEnabled()
    stage.wait(lambda: "Everything is calibrated" in stage.bench.state.outcome.value.text)
    stage.idle()
    # How it ended is said where it was started, not in the library below.
    assert stage.page.head.progress.text() == stage.bench.state.outcome.value.text
    assert not stage.bench.state.note.value
    library = stage.page.library
    assert cell(library.table, 0, 0) == "campaign"
    assert cell(library.table, 0, 3) == "TWIN-C, 32 × 24 px"
    assert "Brightest" in library.details.toPlainText()
    shown: list[str] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda url: shown.append(url.toLocalFile()))
    click(library.report)
    stage.wait(lambda: bool(shown))
    assert Path(shown[0]).name == "campaign.html"
    # The campaign is in the library: scans use it next, by the blue button there.
    assert library.use.property("role") == "primary"
    assert stage.page.head.keep.property("role") != "primary"
    click(library.use)
    stage.wait(lambda: stage.bench.state.in_use.value == "campaign")
    assert library.use.property("role") != "primary"
    assert cell(library.table, 0, 2) == "scans"
    assert not library.restore.isEnabled()
    # And then there is nothing left to do here.
    asked: list[bool] = []
    stage.page.scan_requested.connect(lambda: asked.append(True))
    assert stage.page.head.scan.property("role") == "primary"
    click(stage.page.head.scan)
    assert asked == [True]


def test_a_figure_of_two_lines_does_not_part_a_title_from_its_purpose(stage: Stage) -> None:
    row = stage.page.rows["selftest"]
    gaps = set()
    for words in ("Short", "A figure of several lines. " * 12):
        row.figure.setText(words)
        row.figure.show()
        stage.qtbot.wait(5)
        gaps.add(row._purpose.mapTo(row, QPoint()).y() - row._title.mapTo(row, QPoint()).y())
    assert len(gaps) == 1


def test_every_control_has_a_name_and_a_tip(stage: Stage) -> None:
    wizard = stage.wizard("selftest")
    wizard.apply_theme(DARK)
    kinds = (QAbstractButton, QLineEdit, QAbstractSpinBox, QComboBox)
    for top in (stage.page, wizard, SettingsPage()):
        for kind in kinds:
            for control in top.findChildren(kind):
                if not control.objectName().startswith("qt_"):
                    text = control.text() if isinstance(control, QAbstractButton) else ""
                    assert control.accessibleName() or text, control
                    assert control.toolTip(), (control, text)


def test_the_page_names_every_calibration() -> None:
    from dsl_core.campaign.recipes import recipe_names

    assert tuple(ABOUT) == recipe_names()


@pytest.mark.parametrize(
    ("folder", "name", "told"),
    [
        ("~no-such-user/campaigns", "first", "~no-such-user is not a home folder"),
        ("", "ä" * 130, "The name is too long"),
    ],
)
def test_a_campaign_is_not_begun_where_it_cannot_be(
    qtbot: QtBot, tmp_path: Path, folder: str, name: str, told: str
) -> None:
    host = QWidget()
    qtbot.addWidget(host)
    dialog = NewCampaignDialog(tmp_path, "twin", host)
    assert dialog.begin.isEnabled()
    dialog.folder.setText(folder or str(tmp_path))
    dialog.name.setText(name)
    assert not dialog.begin.isEnabled()
    assert told in dialog._text.text()


def test_a_campaign_that_lost_its_file_is_begun_again_with_its_captures(qtbot: QtBot, tmp_path: Path) -> None:
    host = QWidget()
    qtbot.addWidget(host)
    step = tmp_path / "lab" / "geometry" / "pose-01"
    step.mkdir(parents=True)
    (step / "capture.json").write_text("{}")
    dialog = NewCampaignDialog(tmp_path, "twin", host)
    dialog.name.setText("lab")
    assert dialog.begin.isEnabled()
    assert "begins again with them" in dialog._text.text()
    (tmp_path / "lab" / "campaign.json").write_text("{}")
    dialog._check()
    assert not dialog.begin.isEnabled()
