"""Frames as people watch them: pictures, statistics, and the intensity graphs of a scan as they grow."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.preview import (
    BlockGraphs,
    channels,
    line_positions,
    quick_picture,
    site_colour,
    statistics,
)
from dsl_core.capture.sink import WatchedSink
from dsl_core.errors import DecodeError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, NoSpectral, ScanLines, Setting, Shot
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels
from tests.cases.memory_sink import MemorySink

PATTERNS: tuple[BayerPattern, ...] = ("RGGB", "BGGR", "GRBG", "GBRG")


def mosaic_of(colour: tuple[int, int, int], bayer: BayerPattern, shape: tuple[int, int]) -> np.ndarray:
    return np.asarray(colour, np.uint16)[bayer_channels(bayer, *shape)]


@pytest.mark.parametrize("bayer", PATTERNS)
def test_colours_come_out_whatever_the_mosaic(bayer: BayerPattern) -> None:
    mosaic = mosaic_of((4095, 1024, 0), bayer, (6, 8))
    picture = quick_picture(mosaic, bayer, 4095)
    assert picture.shape == (3, 4, 3)
    assert (picture == (255, 128, 0)).all()
    figures = statistics(mosaic, bayer, 4095)
    assert figures.saturated == (1.0, 0.0, 0.0)
    assert figures.mean_dn == (4095.0, 1024.0, 0.0)
    assert figures.histogram.sum(1).tolist() == [12, 24, 12]
    assert figures.histogram[0, 255] == 12
    assert figures.histogram[1, 64] == 24


@pytest.mark.parametrize("full_scale_dn", [255, 1023, 4095, 65535])
def test_a_histogram_spans_the_counts_of_any_camera(full_scale_dn: int) -> None:
    mosaic = mosaic_of((full_scale_dn, (full_scale_dn + 1) // 4, 0), "RGGB", (6, 8))
    histogram = statistics(mosaic, "RGGB", full_scale_dn).histogram
    assert (histogram[0, 255], histogram[1, 64], histogram[2, 0]) == (12, 24, 12)


def test_one_saturated_pixel_shows_its_cell_in_red() -> None:
    mosaic = np.full((4, 4), 100, np.uint16)
    mosaic[3, 2] = 4095
    picture = quick_picture(mosaic, "RGGB", 4095, show_saturation=True)
    red = (picture == (255, 0, 0)).all(2)
    assert red.tolist() == [[False, False], [False, True]]


def test_focus_rises_with_sharp_edges_and_not_with_exposure() -> None:
    columns = np.arange(64)
    sharp = np.where(columns % 16 < 8, 1000, 3000)
    soft = np.convolve(np.pad(sharp, 4, mode="wrap"), np.ones(9) / 9, "valid")
    scores = [
        statistics(np.tile(row, (32, 1)).astype(np.uint16), "RGGB", 4095).focus
        for row in (sharp, soft, sharp // 2)
    ]
    assert scores[0] > 3 * scores[1]
    assert scores[2] == pytest.approx(scores[0], rel=1e-3)


def test_an_odd_row_and_column_are_left_out() -> None:
    mosaic = np.arange(35, dtype=np.uint16).reshape(5, 7)
    whole = mosaic[:4, :6].copy()
    assert quick_picture(mosaic, "RGGB", 4095).tolist() == quick_picture(whole, "RGGB", 4095).tolist()
    assert quick_picture(mosaic, "BGGR", 4095).shape == (2, 3, 3)
    assert statistics(mosaic, "BGGR", 4095).mean_dn == statistics(whole, "BGGR", 4095).mean_dn


def test_focus_is_the_mean_squared_step_of_green_over_its_squared_mean() -> None:
    mosaic = np.zeros((8, 8), np.uint16)
    # First greens of every second row of cells: 10, 20, 40, 50; the others do not count.
    mosaic[0::4, 1::2] = 10, 20, 40, 50
    mosaic[2::4, 1::2] = 999
    assert statistics(mosaic, "RGGB", 4095).focus == pytest.approx((100 + 400 + 100) / 3 / 30**2)
    assert statistics(np.zeros((4, 4), np.uint16), "RGGB", 4095).focus == 0.0
    assert statistics(np.full((4, 2), 9, np.uint16), "RGGB", 4095).focus == 0.0


def test_a_picture_of_one_row_is_told() -> None:
    with pytest.raises(DecodeError, match="at least 2 x 2"):
        statistics(np.zeros((1, 8), np.uint16), "RGGB", 4095)


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
    graphs = BlockGraphs(PLAN, bayer)
    mosaic = np.asarray((40, 30, 20), np.uint16)[bayer_channels(bayer, 10, 18)]
    graphs.add(lines(1)[2], mosaic)
    graph = graphs.graph((3, 4))
    assert graph is not None
    assert graph.position_px.tolist() == [0, 5, 10, 15]
    assert graph.mean_dn.shape == (2, 4, 3)
    assert graph.mean_dn[1, 2].tolist() == [40, 30, 20]
    assert np.isfinite(graph.mean_dn).sum() == 3


def test_a_monochrome_camera_has_one_curve() -> None:
    graphs = BlockGraphs(PLAN, "MONO")
    mosaic = np.tile(np.array([[10, 20], [30, 60]], np.uint16), (5, 9))
    graphs.add(lines(1)[2], mosaic)
    graph = graphs.graph((3, 4))
    assert graph is not None
    assert graph.mean_dn.shape == (2, 4, 1)
    assert graph.mean_dn[1, 2].tolist() == [30]
    assert np.isfinite(graph.mean_dn).sum() == 1


def test_blocks_are_means_and_grow_until_the_budget_holds() -> None:
    graphs = BlockGraphs(PLAN, "RGGB", budget_bytes=2000)
    assert graphs.block_px == 4
    mosaic = np.zeros((10, 18), np.uint16)
    mosaic[0::2, 0::2] = np.arange(9) * 10
    graphs.add(lines(0)[0], mosaic)
    graph = graphs.graph((15, 7))
    assert graph is not None
    assert graph.block_px == 4
    assert graph.mean_dn[0, 0].tolist() == [65, 0, 0]


def test_graphs_fill_their_budget_and_no_more() -> None:
    finest = BlockGraphs(PLAN, "RGGB")
    assert finest.block_px == 2
    exactly = finest._means.nbytes
    assert BlockGraphs(PLAN, "RGGB", budget_bytes=exactly).block_px == 2
    assert BlockGraphs(PLAN, "RGGB", budget_bytes=exactly - 1).block_px == 4


def test_graphs_of_a_large_camera_are_coarser() -> None:
    large = PLAN.model_copy(update={"camera_size_px": (9000, 7000)})
    assert BlockGraphs(large, "RGGB").block_px > 2


def test_other_frames_and_places_outside_give_nothing() -> None:
    graphs = BlockGraphs(PLAN, "RGGB")
    graphs.add(next(PLAN.shots()), np.full((10, 18), 7, np.uint16))
    inside = graphs.graph((0, 0))
    assert inside is not None
    assert np.isnan(inside.mean_dn).all()
    assert graphs.graph((18, 0)) is None
    none = PLAN.model_copy(update={"spectral": NoSpectral()})
    assert BlockGraphs(none, "RGGB").graph((0, 0)) is None


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
    assert "continues" in caplog.text


def test_a_monochrome_picture_is_grey_at_edges_too() -> None:
    picture = np.zeros((4, 8), np.uint16)
    picture[:, 3:] = 4000
    shown = quick_picture(picture, "MONO", 4095)
    assert (shown == shown[..., :1]).all()
    assert statistics(picture, "MONO", 4095).saturated == (0, 0, 0)


def test_a_pixel_has_the_colour_of_its_site() -> None:
    seen = {bayer: [site_colour(x, y, bayer) for y in (6, 7) for x in (4, 5)] for bayer in PATTERNS}
    assert seen["RGGB"] == ["red", "green", "green", "blue"]
    assert seen["BGGR"] == ["blue", "green", "green", "red"]
    assert seen["GRBG"] == ["green", "red", "blue", "green"]
    assert seen["GBRG"] == ["green", "blue", "red", "green"]
    assert site_colour(0, 0, "MONO") == ""
    names = {"R": "red", "G": "green", "B": "blue"}
    for bayer in PATTERNS:
        for y, x in np.ndindex(6, 6):
            assert site_colour(x, y, bayer) == names[bayer[2 * (y % 2) + x % 2]]


def test_cells_of_a_monochrome_camera_keep_their_places() -> None:
    mosaic = np.array([[1, 20], [30, 400]], np.uint16)
    first, middle, last = channels(mosaic, "MONO")
    assert (first.item(), middle.item(), last.item()) == (1, 25, 400)


@pytest.mark.parametrize("site", [(2, 2), (2, 3), (3, 2), (3, 3)])
def test_any_saturated_pixel_of_a_cell_shows_it(site: tuple[int, int]) -> None:
    mosaic = np.full((4, 4), 100, np.uint16)
    mosaic[site] = 4095
    picture = quick_picture(mosaic, "RGGB", 4095, show_saturation=True)
    assert (picture == (255, 0, 0)).all(2).tolist() == [[False, False], [False, True]]


def test_counts_beyond_the_last_bin_are_in_it() -> None:
    # Bins of 16 counts, as a full scale of 4000 takes 12 bits: 5000 would be bin 312.
    histogram = statistics(mosaic_of((5000, 800, 16), "RGGB", (6, 8)), "RGGB", 4000).histogram
    assert (histogram[0, 255], histogram[1, 50], histogram[2, 1]) == (12, 24, 12)
    assert histogram.sum() == 48


def test_two_columns_of_green_have_a_focus() -> None:
    mosaic = np.zeros((2, 4), np.uint16)
    mosaic[0, 1::2] = 10, 30
    assert statistics(mosaic, "RGGB", 4095).focus == pytest.approx(400 / 20**2)
