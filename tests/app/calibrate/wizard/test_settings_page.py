"""Settings and boards are edited as fields."""

from __future__ import annotations

from dsl_app.calibrate.wizard.settings import setting_rows
from dsl_app.calibrate.wizard.settings_page import BoardEdit, SettingsPage
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QLabel,
    QLineEdit,
)
from pytestqt.qtbot import QtBot

from dsl_core.campaign.recipes import load_recipe
from dsl_core.io.campaign_folder import CampaignFolder
from tests.app.calibrate.page_stage import Stage, click


def test_settings_are_typed_and_wrong_ones_explained(stage: Stage) -> None:
    wizard = stage.wizard("selftest")
    wizard.steps.setCurrentRow(wizard.steps.count() - 1)
    stage.wait(lambda: wizard.stack.currentWidget() is wizard.settings)
    field = wizard.settings.fields["scale"]
    assert isinstance(field, QLineEdit)
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, "much")
    click(wizard.buttons.back)
    QTest.keyClick(field, Qt.Key.Key_Tab)
    stage.wait(lambda: "Scale must be a number" in wizard.settings._trouble.text())
    assert wizard.stack.currentWidget() is wizard.settings
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, "3")
    QTest.keyClick(field, Qt.Key.Key_Tab)
    stage.idle()
    assert CampaignFolder.open(stage.bench.campaign).info.settings == {"selftest": {"scale": "3"}}
    assert not wizard.settings._trouble.isVisible()


def test_a_list_with_a_decimal_comma_is_seen_to_be_two_values(qtbot: QtBot) -> None:
    page = SettingsPage()
    qtbot.addWidget(page)
    for text, read in (("166.7", ""), ("166,7", " Read as 2 values: 166 and 7.")):
        settings = {"wanted_ms": text}
        page.show_settings(setting_rows(load_recipe("selftest", settings), settings))
        docs = [line.text() for line in page.findChildren(QLabel)]
        assert f"The exposures that scans should use.{read}" in docs


def test_boards_are_edited_as_fields(qtbot: QtBot) -> None:
    edit = BoardEdit("Board")
    qtbot.addWidget(edit)
    told: list[str] = []
    edit.edited.connect(told.append)
    edit.show_text('{"kind":"checkerboard","columns":9,"rows":6,"square_mm":25.0}')
    assert (edit.columns.value(), edit.rows.value(), edit.square.value()) == (9, 6, 25.0)
    assert told == []
    edit.columns.setValue(10)
    assert told == ['{"kind":"checkerboard","columns":10,"rows":6,"square_mm":25.0}']
    edit.kind.setCurrentIndex(1)
    edit.kind.activated.emit(1)
    assert '"marker_mm":15.0' in told[-1]
    assert not edit.marker.isHidden()
