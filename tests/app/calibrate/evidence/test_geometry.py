"""The evidence of a geometry: corners, bars and rows of its poses, and a fit without some of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dsl_app.shared.theme import Theme
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QStyle, QStyleOptionViewItem
from pytestqt.qtbot import QtBot

from dsl_core.campaign.geometry.recipe import GeometryRecipe
from dsl_core.campaign.recipes import load_recipe
from dsl_core.model.board import Checkerboard
from dsl_core.model.calibration.geometry import (
    Flatness,
    GeometryCalibration,
    LeftOut,
    LensDeviation,
    PoseDeviation,
    PoseQuality,
)
from dsl_core.simulation.published_rig import published_rig
from tests.app.calibrate.evidence_bench import THEMES, bars, points, row_texts, session_of, shown

FLAT = Flatness(square_mm=20.004, square_std_mm=0.03, plane_rms_mm=0.041)
LENS = LensDeviation(fx_px=1, fy_px=1, cx_px=1, cy_px=1, distortion=(0, 0, 0, 0, 0))
STEPS = {f"pose-{i:02d}": f"Pose {i}" for i in range(1, 7)}


def pose(number: int, used: bool = True, corners: bool = True) -> PoseQuality:
    spots = [(100.0 * number + x, 50.0 * number + y) for x in (0, 20) for y in (0, 20)]
    return PoseQuality(
        name=f"Pose {number}",
        corners=4,
        outliers=number % 2,
        used=used,
        camera_rms_px=0.1 * number,
        projector_rms_px=0.2 * number,
        distance_mm=600 + number,
        tilt_deg=10 * number,
        measured=FLAT,
        corners_px=tuple(spots) if corners else (),
    )


def calibration(**changes: Any) -> GeometryCalibration:
    rig = published_rig()
    made = GeometryCalibration(
        board=Checkerboard(columns=11, rows=7, square_mm=20.0),
        camera=rig.camera,
        projector=rig.projector,
        pose=rig.pose,
        camera_deviation=LENS,
        projector_deviation=LENS,
        pose_deviation=PoseDeviation(rotation_deg=(0, 0, 0), translation_mm=(0, 0, 0)),
        camera_rms_px=0.25,
        projector_rms_px=0.5,
        rms_px=0.4,
        rms_with_outliers_px=0.5,
        camera_coverage=0.25,
        projector_coverage=0.25,
        squares=FLAT,
        poses=(pose(1), pose(2), pose(4, used=False), pose(5)),
        left_out=(
            LeftOut(name="Pose 3", reason="The board was not found."),
            LeftOut(name="Pose 6", reason="Left out by hand.", by_hand=True),
        ),
        warnings=("Pose 2 is blurred: focus.",),
    )
    return made.model_copy(update=changes)


@pytest.mark.parametrize("theme", THEMES)
def test_every_pose_has_its_corners_bars_and_row(qtbot: QtBot, theme: Theme) -> None:
    widget = shown(qtbot, "geometry", calibration(), session_of(STEPS), theme)
    assert np.array_equal(points(widget.coverage)[1], calibration().poses[1].corners_px)
    camera, projector = bars(widget.errors)
    assert camera == pytest.approx([0.1, 0.2, 0.4, 0.5])
    assert projector == pytest.approx([0.2, 0.4, 0.8, 1.0])
    assert [row_texts(widget.table, row)[0] for row in range(6)] == list(STEPS.values())
    assert row_texts(widget.table, 0) == [
        "Pose 1", "4 (1 off)", "0.100", "0.200", "601", "10", "20.004 ± 0.030", "0.041", "used"
    ]  # fmt: skip
    assert row_texts(widget.table, 2)[-1] == "The board was not found."
    assert row_texts(widget.table, 3)[-1] == "does not fit the others"
    assert widget.diagnosis.text() == "Pose 2 is blurred: focus."
    assert "covered, 25 % of the cells" in widget.coverage.legend.text().replace("&nbsp;", " ")


def tick(widget: Any, row: int) -> None:
    """Click a row's box with the mouse."""
    index = widget.table.model().index(row, 0)
    option = QStyleOptionViewItem()
    widget.table.initViewItemOption(option)
    option.rect = widget.table.visualRect(index)
    option.features |= QStyleOptionViewItem.ViewItemFeature.HasCheckIndicator
    box = widget.table.style().subElementRect(
        QStyle.SubElement.SE_ItemViewItemCheckIndicator, option, widget.table
    )
    at = box.center() if box.isValid() else option.rect.topLeft() + QPoint(12, 11)
    QTest.mouseClick(widget.table.viewport(), Qt.MouseButton.LeftButton, pos=at)


def test_unticked_poses_are_left_out_when_solved_again(qtbot: QtBot) -> None:
    widget = shown(qtbot, "geometry", calibration(), session_of(STEPS))
    checked = [item.checkState() == Qt.CheckState.Checked for item in widget._names()]
    assert checked == [True, True, False, True, True, False]
    assert not widget.again.isEnabled()
    tick(widget, 3)
    assert widget.again.isEnabled()
    assert widget.again.text() == "Solve again with 3 poses"
    with qtbot.waitSignal(widget.settings_requested) as heard:
        QTest.mouseClick(widget.again, Qt.MouseButton.LeftButton)
    recipe = load_recipe("geometry", heard.args[0])
    assert isinstance(recipe, GeometryRecipe)
    assert recipe.left_out == ("pose-04", "pose-06")


def test_too_few_poses_are_not_solved_again(qtbot: QtBot) -> None:
    widget = shown(qtbot, "geometry", calibration(), session_of(STEPS))
    for row in (0, 1):
        widget.table.setCurrentCell(row, 0)
        QTest.keyClick(widget.table, Qt.Key.Key_Space)
    assert not widget.again.isEnabled()
    assert widget.diagnosis.text() == "At least 3 poses are needed; tick more of them."
    widget.table.setCurrentCell(5, 0)
    QTest.keyClick(widget.table, Qt.Key.Key_Space)
    assert widget.again.isEnabled()


def test_the_selected_pose_stands_out_in_the_picture(qtbot: QtBot) -> None:
    widget = shown(qtbot, "geometry", calibration(), session_of(STEPS))
    widget.table.selectRow(1)
    assert "Pose&nbsp;2" in widget.coverage.legend.text()


def test_a_record_of_before_corners_were_kept_says_so(qtbot: QtBot) -> None:
    old = calibration(poses=(pose(1, corners=False), pose(2, corners=False), pose(5, corners=False)))
    widget = shown(qtbot, "geometry", old, session_of(STEPS))
    assert widget.coverage.sentence.isVisible()
    assert "before corners were kept" in widget.coverage.sentence.text()
