"""The live picture in the colours of a theme."""

from __future__ import annotations

import numpy as np
from dsl_app.rig.live_view import LiveView
from dsl_app.shared.theme import DARK, LIGHT
from pytestqt.qtbot import QtBot

from dsl_core.devices.base import CameraInfo
from dsl_core.model.conditions import BayerPattern
from dsl_core.model.frames import Frame


def test_the_legend_can_be_read_in_either_theme(qtbot: QtBot) -> None:
    view = LiveView()
    qtbot.addWidget(view)
    for theme in (DARK, LIGHT):
        view.apply_theme(theme)
        names = [text.item.toHtml() for _, text in view.histogram.content.legend.items]
        assert [theme.muted in name for name in names] == [True] * 3


def test_a_picture_that_was_made_is_shown_unless_settings_have_changed(qtbot: QtBot) -> None:
    view = LiveView()
    qtbot.addWidget(view)
    without_camera = view.draw.value
    assert without_camera is None
    view.set_camera(CameraInfo("test", "1", 16, 12, "RGGB", 12, (0.01, 1000.0)))
    draw = view.draw.value
    assert draw is not None
    frame = Frame(np.full((12, 16), 64, np.uint16), 10.0, 0.0)
    made = np.full((6, 8, 3), 77, np.uint8)
    view.show_frame(frame, (draw, made))
    assert (view._item.image == made).all()
    view.display.stretch.setChecked(False)
    assert view.draw.value is not draw
    view.show_frame(frame, (draw, made))
    assert view._item.image.max() < 77
    # The histogram is made later than the picture, and shows the same frame.
    assert view.histogram.made is None
    curves = view.histogram.content.curves
    assert all(curve.getData()[1].any() for curve in curves)
    view.set_camera(None)
    assert [curve.getData()[1] for curve in curves] == [None] * 3, "no counts of a camera that is gone"


def test_a_camera_without_colours_has_one_curve_and_one_share(qtbot: QtBot) -> None:
    view = LiveView()
    qtbot.addWidget(view)
    pixels = np.full((12, 16), 64, np.uint16)
    pixels[0] = 4095
    cases: tuple[tuple[BayerPattern, list[int], str], ...] = (
        ("MONO", [0, 0, 0, 192], "saturated  8.33 %"),
        ("RGGB", [48, 96, 48, 0], "saturated  R 16.67 %  G 8.33 %  B 0.00 %"),
    )
    for bayer, counts, text in cases:
        view.set_camera(CameraInfo("test", "1", 16, 12, bayer, 12, (0.01, 1000.0)))
        draw = view.draw.value
        assert draw is not None
        view._figures_at = 0.0
        frame = Frame(pixels, 10.0, 0.0)
        view.show_frame(frame, (draw, draw(frame.pixels)))
        assert view._saturated.text() == text
        shown = view.histogram.content
        data = [curve.getData()[1] for curve in (*shown.curves, shown.grey)]
        assert [0 if each is None else each.sum() for each in data] == counts
        assert shown.legend.isVisible() == (bayer != "MONO")


def test_a_camera_that_ends_below_its_bits_is_saturated_there(qtbot: QtBot) -> None:
    view = LiveView()
    qtbot.addWidget(view)
    camera = CameraInfo("test", "1", 16, 12, "RGGB", 12, (0.01, 1000.0))
    frame = Frame(np.full((12, 16), 3900, np.uint16), 10.0, 0.0)
    for full_scale_dn, share in ((None, "0.00"), (3900, "100.00")):
        view.set_camera(camera, full_scale_dn)
        draw = view.draw.value
        assert draw is not None
        view._figures_at = 0.0  # figures follow frames a few times a second only
        view.show_frame(frame, (draw, draw(frame.pixels)))
        assert f"R {share} %" in view._saturated.text()
