"""A line of text that is cut off says so."""

from __future__ import annotations

from dsl_app.shared.widgets.clipped_label import ClippedLabel
from pytestqt.qtbot import QtBot

TEXT = "445 x 290 px, /a/long/folder/of/scans/color-checker.zarr"


def test_the_end_of_a_clipped_line_is_an_ellipsis(qtbot: QtBot) -> None:
    label = ClippedLabel()
    qtbot.addWidget(label)
    label.setText(TEXT)
    whole_px = label.fontMetrics().horizontalAdvance(TEXT)
    label.resize(whole_px + 10, 30)
    dots = [label.dots]
    label.resize(whole_px // 2, 30)
    dots.append(label.dots)
    unclipped, area = dots
    assert unclipped is None
    assert area is not None
    assert area.right() == label.contentsRect().right()
    picture = label.grab().toImage()
    ground = label.palette().window().color()
    # Nothing of the text is left between the ellipsis and the dots' left edge but the ground.
    assert picture.pixelColor(area.left(), area.center().y()) == ground
    assert any(
        picture.pixelColor(x, y) != ground
        for x in range(area.left(), area.right())
        for y in range(area.top(), area.bottom())
    )
    # What is copied, and read to the blind, is the whole text.
    assert label.text() == TEXT
