from __future__ import annotations

import ctypes.util

import pytest
import vtkmodules.vtkRenderingCore

from app.panels.easel import graphics_work


@pytest.mark.parametrize(
    ("chosen", "library", "works"),
    [
        ("vtkEGLRenderWindow", None, True),
        ("vtkOSOpenGLRenderWindow", None, False),
        ("vtkOSOpenGLRenderWindow", "libOSMesa.so.8", True),
    ],
)
def test_what_vtk_takes_unseen_must_be_there(
    monkeypatch: pytest.MonkeyPatch, chosen: str, library: str | None, works: bool
) -> None:
    class Window:
        def GetClassName(self) -> str:
            return chosen

    monkeypatch.setattr(vtkmodules.vtkRenderingCore, "vtkRenderWindow", Window)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: library)
    assert graphics_work() is works
