from __future__ import annotations

import ctypes.util

import numpy as np
import pytest
import vtkmodules.vtkRenderingCore
from dsl_app.results.cloud.render_window import RenderWindow, graphics_work


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
    class FoundWindow:
        def GetClassName(self) -> str:
            return chosen

    monkeypatch.setattr(vtkmodules.vtkRenderingCore, "vtkRenderWindow", FoundWindow)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: library)
    assert graphics_work() is works


def test_a_mark_is_seen_whole_on_a_noisy_depth_and_behind_it() -> None:
    if not graphics_work():
        pytest.skip("nothing draws in 3D here")
    window = RenderWindow()
    window.set_background("#000000")
    window.resize(400, 300)
    rng = np.random.default_rng(0)
    x, y, z = rng.uniform(-100, 100, 40_000), rng.uniform(-75, 75, 40_000), rng.normal(600, 20, 40_000)
    window.show(np.stack([x, y, z], axis=1).astype(np.float32), np.full((40_000, 3), 90, np.uint8))
    red, size_px = np.array([[255, 0, 0]], np.uint8), 14
    for depth_mm in (520.0, 600.0, 680.0):
        window.marks.show("marker", np.array([[0, 0, depth_mm]], np.float32), red, size_px)
        pixels = window.draw().pixels
        assert (pixels[..., 0] > 200).sum() == pytest.approx(size_px**2, rel=0.2), depth_mm
    window.close()
