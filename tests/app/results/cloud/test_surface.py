"""What is drawn of a cloud: surface or points, light, sides and projections."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from dsl_app.results.cloud import surface
from dsl_app.results.cloud.look import Grid, Look, Side
from dsl_app.results.cloud.render_window import RenderWindow, graphics_work
from numpy.typing import NDArray

from dsl_core.evaluation.marks import on_screen
from dsl_core.evaluation.screen import mm_per_px

SHAPE = 40, 60


@pytest.fixture(scope="module")
def cylinder() -> tuple[NDArray[np.float32], Grid]:
    """Points of a cylinder with vertical axis, 700 mm away, with a jump at the right."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    x_mm, y_mm = (x - 29.5) * 3.0, (y - 19.5) * 3.0
    depth = 800 - np.sqrt(120.0**2 - x_mm**2)
    depth[:, 50:] += 150
    points = np.stack([x_mm, y_mm, depth]).reshape(3, -1).T.astype(np.float32)
    return points, Grid(SHAPE, np.arange(points.shape[0]))


@pytest.fixture
def window() -> Iterator[RenderWindow]:
    if not graphics_work():
        pytest.skip("nothing draws in 3D here")
    made = RenderWindow()
    made.set_background("#000000")
    made.resize(160, 120)
    yield made
    made.close()


def _show(window: RenderWindow, cylinder: tuple[NDArray[np.float32], Grid]) -> None:
    points, grid = cylinder
    window.show(points, np.full((len(points), 3), 200, np.uint8), grid=grid)


def test_the_surface_has_no_holes_and_light_shows_its_shape(
    window: RenderWindow, cylinder: tuple[NDArray[np.float32], Grid]
) -> None:
    _show(window, cylinder)
    lit = window.draw().pixels[60, 20:120, 0].astype(int)
    assert (lit > 0).all()
    assert np.ptp(lit) > 10, "the side that is turned away is darker"
    window.take_look(Look(light=False))
    assert set(window.draw().pixels[60, 30:110, 0]) == {200}
    window.see_from(Side.TOP)
    from_top = window.draw().pixels[..., 0] > 0
    assert from_top.sum() < 2000, "the jump is not bridged"


def test_points_grow_with_the_zoom_and_with_the_slider(
    window: RenderWindow, cylinder: tuple[NDArray[np.float32], Grid]
) -> None:
    _show(window, cylinder)
    window.take_look(Look(surface=False))
    assert (window.draw().pixels[50:70, 40:110, 0] > 0).all()
    window.zoom(6)
    assert (window.draw().pixels[50:70, 40:110, 0] > 0).all()
    window.take_look(Look(surface=False, size=0.25))
    assert not (window.draw().pixels[50:70, 40:110, 0] > 0).all()


def test_parallel_views_keep_what_the_view_turns_about_as_large(
    window: RenderWindow, cylinder: tuple[NDArray[np.float32], Grid]
) -> None:
    _show(window, cylinder)
    look = Look(box=True)
    window.take_look(look)
    seen = window.draw()
    assert seen.box_mm is not None
    before = mm_per_px(seen.focus_mm, seen.projection, 120)
    window.take_look(replace(look, parallel=True))
    seen = window.draw()
    assert mm_per_px(seen.focus_mm, seen.projection, 120) == pytest.approx(before, rel=1e-6)
    near, far = (mm_per_px(np.array([0, 0, z]), seen.projection, 120) for z in (600.0, 900.0))
    assert near == pytest.approx(far)
    window.take_look(look)
    seen = window.draw()
    assert mm_per_px(seen.focus_mm, seen.projection, 120) == pytest.approx(before, rel=1e-6)


@pytest.mark.parametrize("side", Side)
def test_each_side_shows_all_points(
    window: RenderWindow, cylinder: tuple[NDArray[np.float32], Grid], side: Side
) -> None:
    _show(window, cylinder)
    window.turn(4, 2)
    window.see_from(side)
    seen = on_screen(cylinder[0], window.draw().projection)
    assert np.abs(seen).max() <= 1.02
    left, right = on_screen(np.array([[-80, 0, 720], [80, 0, 720.0]]), window.cloud.projection())[:, 0]
    if side in (Side.CAMERA, Side.FRONT, Side.TOP):
        assert left < right


def test_a_surface_grows_while_its_pictures_stay_quick(
    window: RenderWindow,
    cylinder: tuple[NDArray[np.float32], Grid],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(surface, "COARSE", 200)
    _show(window, cylinder)
    coarse = window.shown
    assert coarse < 400
    assert not window.grow(10.0)
    assert window.grow(0.001)
    assert window.shown == SHAPE[0] * SHAPE[1]
    assert not window.grow(0.001)
    window.take_look(Look(surface=False))
    assert window.shown == SHAPE[0] * SHAPE[1]


@pytest.mark.parametrize("is_surface_first", [True, False])
def test_points_without_neighbours_are_drawn_as_points(window: RenderWindow, is_surface_first: bool) -> None:
    x_mm = np.linspace(-30, 30, 20)
    row = np.stack([x_mm, np.zeros(20), np.full(20, 700.0)], axis=1).astype(np.float32)
    if not is_surface_first:
        window.take_look(Look(surface=False))
    _show(window, (row, Grid((1, 20), np.arange(20))))
    window.take_look(Look())
    assert not window.shows_surface
    assert window.shown == 20
    assert (window.draw().pixels[..., 0] > 100).sum() >= 20
