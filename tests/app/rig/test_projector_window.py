from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from dsl_app.rig.projector_window import SETTLE_MS, ProjectorWindow, ScreenProjector, pixel_size
from PySide6.QtCore import QRect
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
    assert "lost: The projector's screen PROJECTOR was disconnected or mirrored." in done.stdout


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


class _Scaled:
    """A screen whose geometry is rounded as Qt rounds it."""

    def __init__(self, width: int, height: int, ratio: float) -> None:
        self._size, self._ratio = (width, height), ratio

    def devicePixelRatio(self) -> float:
        return self._ratio

    def geometry(self) -> QRect:
        return QRect(0, 0, *(int(size / self._ratio + 0.5) for size in self._size))


@pytest.mark.parametrize("ratio", [1.0, 1.25, 1.5, 1.75, 2.0])
@pytest.mark.parametrize(
    "size",
    [(608, 684), (854, 480), (912, 1140), (1280, 720), (1280, 800), (1366, 768), (1400, 1050), (1680, 1050),
     (1920, 1080), (1920, 1200), (2560, 1600), (3840, 2160)],
)  # fmt: skip
def test_a_scaled_screen_keeps_its_number_of_pixels(size: tuple[int, int], ratio: float) -> None:
    assert pixel_size(cast(QScreen, _Scaled(*size, ratio))) == size


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


def test_the_window_leaves_a_screen_that_comes_to_show_the_desktop(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, told, overlapping = ProjectorWindow(), list[str](), list[QScreen]()
    qtbot.addWidget(window)
    monkeypatch.setattr("dsl_app.rig.projector_window.mirrors", lambda _screen: overlapping)
    window.lost.connect(told.append)
    screen = QGuiApplication.primaryScreen()
    window.arm(screen, alone=True)
    screen.geometryChanged.emit(screen.geometry())
    qtbot.wait(2 * SETTLE_MS)
    assert window.is_armed
    overlapping.append(screen)
    screen.geometryChanged.emit(screen.geometry())
    qtbot.waitUntil(lambda: told == [screen.name()])
    assert (window.isVisible(), window.lost_screen) == (False, screen.name())
