"""The drawing of a placement shows film, filter, distance and turns, and says the same in words."""

from __future__ import annotations

import pytest
from dsl_app.calibrate.wizard.placement_drawing import PlacementDrawing, colour_of_light
from dsl_app.calibrate.wizard.placement_scene import Face, in_words
from dsl_app.shared.theme import DARK, LIGHT, Theme
from PySide6.QtGui import QColor, QImage
from pytestqt.qtbot import QtBot

from dsl_core.campaign.geometry.board_poses import default_poses, outline_mm
from dsl_core.model.board import Checkerboard
from dsl_core.model.placement import Placement
from dsl_core.optics.pinhole import project
from dsl_core.simulation.published_rig import published_rig

BOARD = Checkerboard(columns=11, rows=7, square_mm=20.0)
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


def test_the_target_looks_as_the_camera_will_see_it() -> None:
    lens = published_rig().camera
    for pose in default_poses(BOARD, published_rig(), 12):
        face = Face.of(pose.placement(BOARD))
        assert face is not None
        half = (120.0, 80.0)
        column, row = project(lens, *outline_mm(pose, BOARD))
        seen = [face.in_picture(x * half[0], y * half[1]) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        for (x, y), true_x, true_y in zip(seen, column / 890, row / 580, strict=True):
            assert x == pytest.approx(true_x, abs=0.02)
            assert y == pytest.approx(true_y, abs=0.02)


def test_the_placement_is_said_in_words(qtbot: QtBot) -> None:
    drawing = PlacementDrawing()
    qtbot.addWidget(drawing)
    drawing.show_placement(FILTERED)
    assert drawing.accessibleDescription() == (
        "A white target 65.5 cm from the camera, facing it. The film is mounted before the projector."
        " A filter of 640 nm before the camera."
    )
    turned = Placement(
        target="board", film=False, options={"depth_mm": 600.0, "tilt_x_deg": -25.0, "roll_deg": 8.0}
    )
    assert in_words(turned) == (
        "A printed board 60 cm from the camera, upper edge away by 25°, turned clockwise by 8°."
        " The film is off. No filter before the camera."
    )
    assert in_words(Placement(film=False)).startswith("The target stays as it is. The film is off.")
    assert drawing.accessibleName()


def test_every_placement_fits_into_the_smallest_size(qtbot: QtBot) -> None:
    drawing = PlacementDrawing()
    qtbot.addWidget(drawing)
    assert (drawing.minimumWidth(), drawing.minimumHeight()) == (260, 200)
    for target in ("as it is", "nothing", "board", "spectralon", "color-checker"):
        for depth in (300.0, 2000.0):
            drawing.show_placement(Placement(target=target, options={"depth_mm": depth}))
            assert not drawing.grab().isNull()
