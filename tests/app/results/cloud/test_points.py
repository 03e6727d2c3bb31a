from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dsl_app.results.cloud.points import COARSE, SLOW_S, PointsActor, spacing


class Actor:
    """What VTK would draw."""

    def __init__(self) -> None:
        self.is_visible, self.size_px = True, 0

    def SetVisibility(self, on: bool) -> None:
        self.is_visible = bool(on)

    def GetProperty(self) -> Actor:
        return self

    def SetPointSize(self, size_px: int) -> None:
        self.size_px = size_px


class Plotter:
    """Keeps meshes by actor."""

    def __init__(self) -> None:
        self.meshes: dict[Actor, Any] = {}

    def add_mesh(self, mesh: Any, **_: object) -> Actor:
        actor = Actor()
        self.meshes[actor] = mesh
        return actor

    def remove_actor(self, actor: Actor, **_: object) -> None:
        del self.meshes[actor]

    @property
    def drawn(self) -> int:
        return sum(mesh.n_points for actor, mesh in self.meshes.items() if actor.is_visible)


def make(count: int) -> tuple[PointsActor, Plotter, Any, Any]:
    plotter = Plotter()
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
    return PointsActor(plotter), plotter, points, np.zeros((count, 3), np.uint8)


def test_a_quick_machine_gets_all_points_in_few_steps() -> None:
    cloud, plotter, points, colours = make(500_000)
    assert cloud.show(points, colours)
    assert plotter.drawn == COARSE
    steps = 0
    while cloud.grow(0.005):
        steps += 1
    assert plotter.drawn == 500_000
    assert steps <= 12


def test_a_slow_machine_keeps_its_pictures_quick() -> None:
    cloud, plotter, points, colours = make(500_000)
    cloud.show(points, colours)
    a_point_s = SLOW_S / 100_000
    while cloud.grow(plotter.drawn * a_point_s):
        assert plotter.drawn * a_point_s <= SLOW_S
    assert plotter.drawn == pytest.approx(100_000, rel=0.25)
    assert not cloud.grow(1.0)


def test_a_small_cloud_is_whole_at_once() -> None:
    cloud, plotter, points, colours = make(700)
    cloud.show(points, colours)
    assert plotter.drawn == 700
    assert not cloud.grow(0.001)
    cloud.be_coarse(True)
    assert plotter.drawn == 700


def test_few_points_while_it_turns_and_all_colours_follow() -> None:
    cloud, plotter, points, colours = make(120_000)
    cloud.show(points, colours)
    cloud.grow(0.001)
    cloud.be_coarse(True)
    assert plotter.drawn == COARSE
    cloud.grow(0.001)
    assert plotter.drawn == COARSE, "what comes in while it turns stays hidden"
    cloud.be_coarse(False)
    while cloud.grow(0.001):
        pass
    assert plotter.drawn == 120_000
    assert not cloud.show(points, colours + 9)
    assert plotter.drawn == COARSE, "colours come in step by step as well"
    while cloud.grow(0.001):
        pass
    assert plotter.drawn == 120_000
    assert all((mesh["colours"] == 9).all() for mesh in plotter.meshes.values())


def test_another_cloud_takes_the_place_of_the_old_one() -> None:
    cloud, plotter, points, colours = make(90_000)
    cloud.show(points, colours)
    cloud.grow(0.001)
    assert cloud.show(points[:50], colours[:50])
    assert plotter.drawn == 50


def test_a_cloud_without_points_can_be_coloured_again() -> None:
    cloud, plotter, points, colours = make(3)
    cloud.show(points[:0], colours[:0])
    assert cloud._points is not None
    assert cloud.show(cloud._points, colours[:0]) is False
    assert cloud.shown == 0
    assert plotter.drawn == 1, "one that is far away"


def test_points_of_a_single_row_are_as_far_apart_as_they_are() -> None:
    row = np.array([[x_mm, 0.0, 700.0] for x_mm in range(0, 60, 3)], np.float32)
    assert spacing(row) == pytest.approx(3.0)
