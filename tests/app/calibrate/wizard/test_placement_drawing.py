"""The drawing of a placement shows film, filter and target in every size."""

from __future__ import annotations

import pytest
from dsl_app.calibrate.wizard.placement_drawing import PlacementDrawing, colour_of_light
from dsl_app.shared.theme import DARK, LIGHT, Theme
from PySide6.QtGui import QColor, QImage
from pytestqt.qtbot import QtBot

from dsl_core.model.placement import Placement

FILTERED = Placement(target="spectralon", filter_nm=640.0, options={"depth_mm": 655.0})


def count(picture: QImage, colour: str) -> int:
    """Pixels of exactly this colour."""
    wanted = QColor(colour).rgb()
    return sum(picture.pixel(x, y) == wanted for y in range(picture.height()) for x in range(picture.width()))


def drawn(qtbot: QtBot, placement: Placement, theme: Theme = LIGHT) -> QImage:
    drawing = PlacementDrawing()
    qtbot.addWidget(drawing)
    drawing.resize(300, 220)
    drawing.apply_theme(theme)
    drawing.show_placement(placement)
    return drawing.grab().toImage()


@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_film_and_filter_are_drawn_where_they_are_wanted(qtbot: QtBot, theme: Theme) -> None:
    filtered, red = drawn(qtbot, FILTERED, theme), colour_of_light(640.0)
    off = drawn(qtbot, FILTERED.model_copy(update={"film": False, "filter_nm": None}), theme)
    assert count(filtered, theme.warn) > 60
    assert count(filtered, red) > 40
    assert count(off, theme.warn) == count(off, red) == 0


def test_the_chart_is_drawn_with_its_patches(qtbot: QtBot) -> None:
    picture = drawn(qtbot, Placement(target="color-checker", film=False))
    assert all(count(picture, colour) > 20 for colour in ("#735244", "#e7c71f", "#343434"))


def test_every_placement_fits_into_the_smallest_size(qtbot: QtBot) -> None:
    drawing = PlacementDrawing()
    qtbot.addWidget(drawing)
    assert (drawing.minimumWidth(), drawing.minimumHeight()) == (260, 200)
    for target in ("as it is", "nothing", "board", "spectralon", "color-checker"):
        for depth in (300.0, 2000.0):
            drawing.show_placement(Placement(target=target, options={"depth_mm": depth}))
            assert not drawing.grab().isNull()
