from pathlib import Path

import pytest
from dsl_app.shared.settings import RecentFiles, Settings
from dsl_app.shared.theme import LIGHT, style_sheet
from dsl_app.start.examples import EXAMPLES
from dsl_app.start.page import StartPage
from dsl_app.start.unfinished import Unfinished, UnfinishedController
from PySide6.QtCore import QRect
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from dsl_core.resources import resource_path
from tests.app.support.doubles import InlineRunner

#: Width of the rail at the left of the window.
RAIL_PX = 84


def make_page(qtbot: QtBot, recent: RecentFiles) -> tuple[StartPage, list[object]]:
    asked: list[object] = []
    page = StartPage(
        recent,
        asked.append,
        asked.append,
        lambda: asked.append("live"),
        lambda: asked.append("rig"),
        lambda: asked.append("file"),
        lambda: asked.append("captures"),
        UnfinishedController(list, InlineRunner(), asked.append),
    )
    qtbot.addWidget(page)
    page.resize(1200, 700)
    page.show()
    return page, asked


def test_each_button_asks_for_what_it_says(qtbot: QtBot) -> None:
    page, asked = make_page(qtbot, RecentFiles(Settings()))
    for button in (*page.examples.values(), page.live, page.connect_rig, page.choose, page.captures):
        button.click()
    assert asked == [*(each.key for each in EXAMPLES), "live", "rig", "file", "captures"]
    primary = [b for b in (*page.examples.values(), page.live) if b.property("role") == "primary"]
    assert primary == [page.examples["color-checker"]]


def test_what_was_interrupted_comes_before_an_example(qtbot: QtBot) -> None:
    page, _ = make_page(qtbot, RecentFiles(Settings()))
    found = page.unfinished._control.found
    lines = [Unfinished(Path(f"{name}.dsl"), f"{name} was interrupted.", "Resume scan…") for name in "ab"]
    found.set(tuple(lines))
    blue = [each for each in page.findChildren(QPushButton) if each.property("role") == "primary"]
    assert [each.text() for each in blue] == ["Resume scan…"]
    found.set(())
    page.unfinished._control.is_resuming.set(True)
    assert page.examples["color-checker"].property("role") == ""
    page.unfinished._control.is_resuming.set(False)
    assert page.examples["color-checker"].property("role") == "primary"


@pytest.mark.parametrize("height_px", [600, 800, 1300])
def test_nothing_moves_when_something_unfinished_is_found(
    qtbot: QtBot, tmp_path: Path, height_px: int
) -> None:
    recent = RecentFiles(Settings())
    for name in "abcdef":
        recent.add(tmp_path / name)
    page, _ = make_page(qtbot, recent)
    page.setStyleSheet(style_sheet(LIGHT))
    page.resize(1200, height_px)
    QTest.qWait(0)
    parts = (*page.findChildren(QPushButton), page.files.files)

    def places() -> list[QRect]:
        return [QRect(part.mapTo(page, part.rect().topLeft()), part.size()) for part in parts]

    before = places()
    lines = [Unfinished(Path(f"{name}.dsl"), f"{name} was interrupted.", "Resume scan…") for name in "ghij"]
    page.unfinished._control.found.set(tuple(lines))
    QTest.qWait(0)
    assert page.unfinished.isVisible()
    assert places() == before


def test_all_cards_fit_the_smallest_window(qtbot: QtBot) -> None:
    page, _ = make_page(qtbot, RecentFiles(Settings()))
    page.resize(1024 - RAIL_PX, 600)
    right = page.connect_rig.mapTo(page, page.connect_rig.rect().topRight()).x()
    assert right < page.width() - 16


def test_recent_files_are_there_only_if_there_are_any(qtbot: QtBot, tmp_path: Path) -> None:
    recent = RecentFiles(Settings())
    page, asked = make_page(qtbot, recent)
    assert not page.files.files.isVisible()
    recent.add(tmp_path)
    assert page.files.files.isVisible()
    page.files.files.itemActivated.emit(page.files.files.item(0))
    assert asked == [tmp_path]
    page.release()


def test_every_example_comes_with_the_program() -> None:
    for each in EXAMPLES:
        assert resource_path(f"examples/{each.key}.zarr").is_dir()
