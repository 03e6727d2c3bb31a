"""The controls of how the live picture is shown, and the picture that follows."""

from __future__ import annotations

import numpy as np
from dsl_app.rig.display_row import DisplayRow
from dsl_app.rig.live_view import LiveView
from pytestqt.qtbot import QtBot

from dsl_core.capture.display import FIRST, Display, Tone
from dsl_core.devices.base import CameraInfo
from dsl_core.model.frames import Frame


def test_what_is_chosen_is_told(qtbot: QtBot) -> None:
    row, told = DisplayRow(), list[Display]()
    qtbot.addWidget(row)
    row.changed.connect(lambda: told.append(row.display))
    # At first black is black and grey is grey.
    assert row.display == Display(stretch=row.stretch.isChecked(), balance=row.balance.isChecked()) == FIRST
    row.tone.setCurrentIndex(row.tone.findData(Tone.LOG))
    row.tone.activated.emit(row.tone.currentIndex())
    row.stretch.setChecked(False)
    row.balance.setChecked(False)
    row.gain.setValue(8)
    assert told[-1] == Display(Tone.LOG, stretch=False, gain=4.0, balance=False)
    assert row._factor.text() == "× 4"


def test_the_picture_follows_and_what_is_read_does_not(qtbot: QtBot) -> None:
    view = LiveView()
    qtbot.addWidget(view)
    view.set_camera(CameraInfo("test", "1", 16, 12, "RGGB", 12, (0.01, 1000.0)))
    view.show_frame(Frame(np.full((12, 16), 64, np.uint16), 10.0, 0.0))
    view._read = (4, 3)
    # An even picture is black where black is fitted to what is there.
    assert view._item.image.max() == 0
    view.display.stretch.setChecked(False)
    before = view._item.image.mean()
    view.display.gain.setValue(view.display.gain.maximum())
    assert view._item.image.mean() > 3 * before
    assert view._pixel.text() == "column 4 px, row 3 px: 64 DN, green pixel"
    assert [label.text for _, label in view.histogram.content.legend.items] == ["red", "green", "blue"]
