"""What is said of the screen as a projector, before any is opened."""

from __future__ import annotations

import importlib
import importlib.util

import pytest

from dsl_core.devices.drivers import screen


def test_the_window_is_not_told_to_install_its_own_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr("dsl_core.extras.has_package", lambda name: False)
        assert importlib.reload(screen).DRIVER.brings == screen.BRINGS
    is_here = importlib.util.find_spec("PySide6") is not None
    assert importlib.reload(screen).DRIVER.brings == ("" if is_here else screen.BRINGS)
