"""What is said of the screen as a projector, before any is opened."""

from __future__ import annotations

import importlib
import importlib.util
import subprocess
import sys

import pytest

from dsl_core.devices.drivers import screen


def test_the_window_is_not_told_to_install_its_own_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr("dsl_core.extras.has_package", lambda name: False)
        assert importlib.reload(screen).DRIVER.brings == screen.BRINGS
    is_here = importlib.util.find_spec("PySide6") is not None
    assert importlib.reload(screen).DRIVER.brings == ("" if is_here else screen.BRINGS)


def test_a_projector_whose_window_has_died_is_closed_all_the_same() -> None:
    code = 'import sys; print(\'{"width_px": 4, "height_px": 3}\', flush=True)'
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    process.wait(60)
    assert process.stdin is not None
    process.stdin.write(b"x" * 10)
    projector = screen.ScreenProjector.__new__(screen.ScreenProjector)
    projector._process = process
    projector.close()
    projector.close()
    assert process.returncode == 0
