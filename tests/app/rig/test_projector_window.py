from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from dsl_app.rig.projector_window import ProjectorWindow, ScreenProjector, pixel_size
from PySide6.QtGui import QGuiApplication, QScreen
from pytestqt.qtbot import QtBot

from dsl_core.devices.base import ProjectorInfo
from dsl_core.errors import DeviceError
from tests.app.support.two_screens import missing_programs, two_screens

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
@pytest.mark.skipif(bool(missing_programs()), reason=f"needs {', '.join(missing_programs())}")
@pytest.mark.parametrize("scale", ["1", "1.5"])
def test_pixels_are_exact_and_the_window_survives_unplugging(scale: str) -> None:
    with two_screens() as display:
        done = subprocess.run(
            [sys.executable, "-m", "tests.app.rig.projector_on_screen", display],
            env={
                **os.environ,
                "DISPLAY": display,
                "QT_QPA_PLATFORM": "xcb",
                "QT_SCALE_FACTOR": scale,
                "PYTHONPATH": str(ROOT),
            },
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=110,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "differing pixels at 1:1: 0" in done.stdout
    assert "differing pixels at 1:2: 0" in done.stdout
    assert "mirrored: The screen" in done.stdout
    assert "lost: The projector's screen PROJECTOR was disconnected." in done.stdout


class _Armed:
    """A window on a screen, without one."""

    is_armed, lost_screen = True, ""

    def __init__(self) -> None:
        self.shown: list[tuple[int, ...]] = []

    def screen(self) -> QScreen:
        return QGuiApplication.primaryScreen()

    def factor(self, width: int, height: int) -> int:
        return ProjectorWindow.factor(cast(ProjectorWindow, self), width, height)

    def show_pixels(self, image: np.ndarray) -> None:
        self.shown.append(image.shape)

    def repaint(self) -> None:
        """Nothing is painted."""


def test_a_pattern_that_the_screen_would_cut_is_refused(qtbot: QtBot) -> None:
    window = _Armed()
    across, down = pixel_size(window.screen())
    projector = ScreenProjector(cast(ProjectorWindow, window), latency_ms=0.0)
    projector.show(np.zeros((down, across), np.uint8))
    assert window.shown == [(down, across, 3)]

    class Large(ScreenProjector):
        @property
        def info(self) -> ProjectorInfo:
            return replace(super().info, width_px=across + 1)

    with pytest.raises(DeviceError, match=f"has {across} × {down} px, and patterns have {across + 1} ×"):
        Large(cast(ProjectorWindow, window)).show(np.zeros((down, across + 1), np.uint8))
