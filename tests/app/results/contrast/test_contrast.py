"""Three bands as colours, and contrast that is dragged on a histogram."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from dsl_app.results.contrast.controller import ContrastController, apart
from dsl_app.results.contrast.histogram import histogram_of
from dsl_app.results.layers import Layers, rgb_of
from dsl_app.results.state import QualityMap, ResultsState, ResultView
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtTest import QTest

from dsl_core.io.result.result_arrays import ResultArrays, load_arrays
from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.results_bench import Bench, move
from tests.app.support.results_bench import bench as bench
from tests.app.support.results_controller import exports
from tests.app.support.small_result import BLUE, DARK, RED, write_small_result


class Look:
    """A state with a result, its controller, and what is painted of it."""

    def __init__(self, result: ResultArrays) -> None:
        self.state, self.layers = ResultsState(), Layers(result)
        self.state.result.set(result)
        self.state.picture.set(np.full((*result.shape, 4), (51, 102, 204, 255), np.uint8))
        self.control = ContrastController(self.state)

    def painted(self, x: int, y: int) -> list[int]:
        layer = self.layers.layer(self.state)
        assert layer is not None
        return [int(value) for value in rgb_of(layer)[y, x]]


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> ResultArrays:
    return load_arrays(write_small_result(tmp_path_factory.mktemp("contrast")))


@pytest.fixture
def look(result: ResultArrays) -> Look:
    return Look(result)


def test_three_bands_begin_with_natural_ones_and_each_can_be_chosen(look: Look) -> None:
    look.control.show_three_bands(True)
    assert look.state.bands.value == (44, 24, 4)
    for channel, band in enumerate((0, 46, 46)):
        look.control.choose_band(channel, band)
    look.control.choose_band(0, 47)
    assert look.state.bands.value == (0, 46, 46)
    look.control.set_levels("bands", (0.0, 0.8))
    for x, spectrum in ((3, BLUE), (30, RED)):
        wanted = [255 * spectrum[band] / 0.8 for band in (0, 46, 46)]
        assert look.painted(x, 8) == pytest.approx(wanted, abs=0.51)
    look.control.show_three_bands(False)
    assert look.painted(3, 8) == [51, 102, 204]


def test_levels_stretch_true_colours_and_stay_with_their_picture(look: Look) -> None:
    look.control.set_levels("rgb", (0.6, 0.2))
    assert look.painted(3, 8) == pytest.approx([0, 128, 255], abs=1)
    look.state.view.set(ResultView.BAND)
    before = look.painted(3, 8)
    look.control.set_levels("reflectance", (0.0, 1.4))
    assert look.painted(3, 8)[0] < before[0]
    look.control.set_levels("reflectance", None)
    assert look.painted(3, 8) == before
    assert look.state.levels.value == {"rgb": (0.2, 0.6)}
    assert apart((0.3, 0.3))[1] > 0.3


def test_other_limits_of_depth_begin_with_levels_of_their_own(look: Look) -> None:
    look.state.view.set(ResultView.DEPTH)
    look.state.depth_limits.set((702.0, 712.0))
    found = histogram_of(look.layers.layer(look.state))
    assert found is not None
    look.control.set_levels(found.key, (703.0, 704.0))
    layer = look.layers.layer(look.state)
    assert layer is not None
    assert layer.levels == (703.0, 704.0)
    look.state.depth_limits.set((700.0, 712.0))
    layer = look.layers.layer(look.state)
    assert layer is not None
    assert layer.levels == (700.0, 712.0)


def test_a_histogram_counts_each_channel_within_reach(look: Look) -> None:
    colours = histogram_of(look.layers.layer(look.state))
    assert colours is not None
    assert (colours.edges[0], colours.edges[-1], colours.can_reset) == (0.0, 1.0, False)
    assert [colours.edges[heights.argmax()] for heights in colours.heights] == pytest.approx(
        [0.2, 0.4, 0.8], abs=1 / 160
    )
    look.state.view.set(ResultView.DEPTH)
    look.control.set_levels("depth_mm", (600.0, 710.0))
    depth = histogram_of(look.layers.layer(look.state))
    assert depth is not None
    assert (depth.edges[0], depth.unit, depth.can_reset) == (600.0, "mm", True)
    assert depth.heights.max() == 1.0
    look.state.view.set(ResultView.QUALITY)
    assert histogram_of(look.layers.layer(look.state)) is None


def test_contrast_is_dragged_with_the_mouse_kept_exported_and_reset(bench: Bench, tmp_path: Path) -> None:
    QTest.mouseClick(bench.page.bar.contrast, Qt.MouseButton.LeftButton)
    bench.control.show(ResultView.BAND)
    panel = bench.page.contrast
    assert panel is not None
    QTest.qWait(20)
    box, viewport = panel.plot.getPlotItem().getViewBox(), panel.plot.viewport()

    def at(value: float) -> QPoint:
        point = panel.plot.mapFromScene(box.mapViewToScene(QPointF(value, 0.5)))
        return QPoint(point.x(), point.y())

    left = Qt.MouseButton.LeftButton
    high = panel.high.value()
    move(viewport, at(high))
    QTest.mousePress(viewport, left, pos=at(high))
    for value in (0.6, 0.5, 0.4):
        move(viewport, at(value), left)
    QTest.mouseRelease(viewport, left, pos=at(0.4))
    low, high = bench.state.levels.value["reflectance"]
    assert low == 0
    assert high == pytest.approx(0.4, abs=0.03)
    assert panel.high.value() == pytest.approx(high, abs=1e-3)
    exports(bench.control).write({"png": tmp_path / "a.png"}, overwrite=False)
    exported = np.asarray(cv2.imread(str(next(tmp_path.glob("a_*nm.png")))))
    shown = bench.page.image.content.image
    assert shown.levels.tolist() == [low, high]
    value = bench.page.image.content.image.image[8, 3]
    assert exported[8, 3, 0] == pytest.approx(255 * min(value / high, 1), abs=1)
    assert exported[DARK[1], DARK[0]].tolist() == [96, 0, 0]
    QTest.mouseDClick(viewport, left, pos=at(0.3))
    assert bench.state.levels.value == {}


def test_three_bands_are_exported_as_they_are_shown(bench: Bench, tmp_path: Path) -> None:
    bench.page.bar.colours.setCurrentIndex(1)
    bench.page.bar.colours.activated.emit(1)
    assert [box.currentText() for box in bench.page.bar.bands] == ["650 nm", "550 nm", "450 nm"]
    bench.page.bar.bands[2].activated.emit(46)
    assert not bench.page.bar.light.isVisible()
    exports(bench.control).write({"png": tmp_path / "a.png"}, overwrite=False)
    exported = np.asarray(cv2.imread(str(tmp_path / "a_650_550_660nm.png")))[..., ::-1]
    shown = bench.page.image.content.image.image
    np.testing.assert_allclose(
        exported[shown[..., 3] > 0], shown[shown[..., 3] > 0, :3].astype(float), atol=1
    )


def test_contrast_of_small_deviations_is_typed_in_figures_that_they_have(
    bench: Bench, tmp_path: Path
) -> None:
    result = load_result(write_small_result(tmp_path / "other")).load()
    result["reflectance_std"][:] = 3e-4
    bench.control.open(save_result(result, tmp_path / "small deviations.zarr"))
    bench.control.show(ResultView.QUALITY)
    bench.state.quality.set(QualityMap.SPREAD)
    bench.state.contrast.set(True)
    panel = bench.page.contrast
    assert panel is not None
    high = panel.high.value()
    assert high > 0
    panel.low.setValue(1e-4)
    assert bench.state.levels.value["reflectance_std"] == pytest.approx((1e-4, high))
