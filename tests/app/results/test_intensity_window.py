"""The intensity graph of a pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dsl_app.results.intensity_window import graph_text, ticks
from dsl_app.shared.theme import DARK, LIGHT

from dsl_core.workflows.inspection import IntensityGraph
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import NM


def test_the_intensity_graph_shows_orders_in_nm(bench: Bench) -> None:
    frames = np.linspace(60.0, 110.0, NM.size)
    measured = np.zeros((3, 200))
    measured[:, 150], measured[1, 80] = 100.0, 2.0
    graph = IntensityGraph((4, 5), measured, measured + 0.1, 1.2 * measured, 150.0, {1: frames}, NM)
    bench.state.graph.set(graph)
    window = bench.page.graph
    assert window.isVisible()
    assert "4, 5" in window.windowTitle()
    assert "First order +1 reaches the pixel" in window.text.text()
    both = graph_text(replace(graph, orders={1: frames, -1: frames - 50.0}))
    assert both.startswith("First orders +1 and −1 reach the pixel.")
    assert [text for _, text in ticks(graph)] == ["450", "500", "550", "600", "650", "zero order"]
    # The first frame is 1, as everywhere else.
    x, y = window.measured[0].getData()
    assert (x[0], x[y == 100.0].tolist()) == (1, [window.zero.value()])
    assert ticks(graph)[-1][0] == 151.0
    assert window.item.viewRange()[1][1] < 5
    beside = bench.page.mapToGlobal(bench.page.rect().bottomRight()) - window.geometry().bottomRight()
    assert beside.manhattanLength() < 10, "it hides the picture"
    # The legend stands above the brightest signal, be it measured or modelled, in the colour of the theme.
    place = window.item.legend.mapRectToParent(window.item.legend.boundingRect())
    room = window.item.vb.boundingRect()
    share = 2.4 / window.item.viewRange()[1][1]
    assert place.bottom() < (1 - share) * room.height()
    for theme in (DARK, LIGHT):
        window.apply_theme(theme)
        assert all(theme.text in text.item.toHtml() for _, text in window.item.legend.items)
    window.faint.setChecked(False)
    assert window.item.viewRange()[1][1] > 100
    bench.state.graph.set(replace(graph, model=None, orders={}, zero=None))
    assert "no model" in window.text.text()
    bench.state.graph.set(None)
    assert not window.isVisible()


def test_a_monochrome_camera_has_one_curve_without_a_colour(bench: Bench) -> None:
    frames, measured = np.linspace(60.0, 110.0, NM.size), np.full((3, 200), 2.0)
    colour = IntensityGraph((4, 5), measured, measured, measured, 150.0, {1: frames}, NM)
    mono = replace(colour, measured=measured[:1], std=measured[:1], model=measured[:1])
    window = bench.page.graph

    def legend() -> list[str]:
        return [text.text for _, text in window.item.legend.items]

    for graph, names in ((mono, [""]), (colour, ["R ", "G ", "B "]), (mono, [""])):
        bench.state.graph.set(graph)
        assert legend() == [f"{name}{what}" for what in ("measured", "model") for name in names]
        assert len(window.measured) == len(window.model) == len(names)
        assert ("colours" in window.text.text()) == (graph is colour)


def test_without_its_scan_a_graph_is_refused_in_words(bench: Bench) -> None:
    bench.window.do("intensity_graph")
    assert "Point at a pixel" in bench.window.toasts.shown[-1].text
    bench.control.point_at((3, 3))
    bench.window.do("intensity_graph")
    assert "is not in" in bench.window.toasts.shown[-1].text
