from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.preview import IntensityGraphs, line_positions
from dsl_core.capture.sink import MemorySink, WatchedSink
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, NoSpectral, ScanLines, Setting, Shot
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels

PLAN = CapturePlan(
    camera_size_px=(18, 10),
    projector_size_px=(20, 8),
    spectral=ScanLines(width_px=5, step_px=5),
    settings=(Setting(exposure_ms=100, level=0.2), Setting(exposure_ms=200, level=0.8)),
)


def lines(setting: int) -> list[Shot]:
    return [shot for shot in PLAN.shots() if shot.role == "spectral" and shot.setting == setting]


@pytest.mark.parametrize("bayer", ["RGGB", "GBRG"])
def test_a_graph_fills_frame_by_frame(bayer: BayerPattern) -> None:
    graphs = IntensityGraphs(PLAN, bayer)
    mosaic = np.asarray((40, 30, 20), np.uint16)[bayer_channels(bayer, 10, 18)]
    graphs.add(lines(1)[2], mosaic)
    graph = graphs.graph((3, 4))
    assert graph is not None
    assert graph.position_px.tolist() == [0, 5, 10, 15]
    assert graph.mean_dn.shape == (2, 4, 3)
    assert graph.mean_dn[1, 2].tolist() == [40, 30, 20]
    assert np.isfinite(graph.mean_dn).sum() == 3


def test_blocks_are_means_and_grow_until_the_budget_holds() -> None:
    graphs = IntensityGraphs(PLAN, "RGGB", budget_bytes=2000)
    assert graphs.block_px == 4
    mosaic = np.zeros((10, 18), np.uint16)
    mosaic[0::2, 0::2] = np.arange(9) * 10
    graphs.add(lines(0)[0], mosaic)
    graph = graphs.graph((15, 7))
    assert graph is not None
    assert graph.block_px == 4
    assert graph.mean_dn[0, 0].tolist() == [65, 0, 0]


def test_other_frames_and_places_outside_give_nothing() -> None:
    graphs = IntensityGraphs(PLAN, "RGGB")
    graphs.add(next(PLAN.shots()), np.full((10, 18), 7, np.uint16))
    inside = graphs.graph((0, 0))
    assert inside is not None
    assert np.isnan(inside.mean_dn).all()
    assert graphs.graph((18, 0)) is None
    none = PLAN.model_copy(update={"spectral": NoSpectral()})
    assert IntensityGraphs(none, "RGGB").graph((0, 0)) is None


def test_patterns_without_lines_are_counted() -> None:
    assert line_positions(CapturePlan())[:3].tolist() == [0, 2, 4]


def test_who_watches_sees_stored_frames_and_cannot_stop_a_scan(caplog: pytest.LogCaptureFixture) -> None:
    inner, seen = MemorySink(PLAN), []

    def watch(shot: Shot, frame: Frame) -> None:
        seen.append(shot.index in inner.frames)
        raise ValueError("odd")

    sink = WatchedSink(inner, watch)
    sink.write(next(PLAN.shots()), Frame(np.zeros((10, 18), np.uint16), 100.0))
    assert seen == [True]
    assert next(sink.missing()).index == 1
    assert "goes on" in caplog.text
