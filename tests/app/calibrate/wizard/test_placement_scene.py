"""A placement as the camera sees it, and in words."""

from __future__ import annotations

import pytest
from dsl_app.calibrate.wizard.placement_drawing import PlacementDrawing
from dsl_app.calibrate.wizard.placement_scene import Face, in_words
from pytestqt.qtbot import QtBot

from dsl_core.campaign.geometry.board_poses import default_poses, outline_mm
from dsl_core.model.board import Checkerboard
from dsl_core.model.placement import Placement
from dsl_core.optics.pinhole import project
from dsl_core.simulation.published_rig import published_rig

BOARD = Checkerboard(columns=11, rows=7, square_mm=20.0)
FILTERED = Placement(target="spectralon", filter_nm=640.0, options={"depth_mm": 655.0})


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
        "A white target 65.5 cm from the camera, facing it. The film is mounted in front of the projector."
        " A filter of 640 nm is on the camera."
    )
    turned = Placement(
        target="board", film=False, options={"depth_mm": 600.0, "tilt_x_deg": -25.0, "roll_deg": 8.0}
    )
    assert in_words(turned) == (
        "A printed board 60 cm from the camera, upper edge away by 25°, turned clockwise by 8°."
        " The film is off. No filter is on the camera."
    )
    assert in_words(Placement(film=False)).startswith("The target stays as it is. The film is off.")
    assert drawing.accessibleName()
