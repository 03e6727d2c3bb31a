"""The controls above the picture say what is shown, also where a result or a light comes late."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest
from dsl_app.results.controller import ResultsController
from dsl_app.results.state import QualityMap, ResultsState, ResultView
from dsl_app.results.view_bar import ViewBar, controls_for
from dsl_app.session.parts import restore_result, results_part
from dsl_app.shared.undo import UndoStack
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.doubles import RecordingNotifier, WaitingRunner
from tests.app.support.small_result import write_small_result


class Bench:
    """The bar with a controller whose jobs that compute light wait."""

    def __init__(self, qtbot: QtBot) -> None:
        self.state, self.runner, self.notifier = ResultsState(), WaitingRunner("Light"), RecordingNotifier()
        self.control = ResultsController(self.state, self.runner, self.notifier, UndoStack())
        self.bar = ViewBar(self.state, self.control)
        qtbot.addWidget(self.bar)

    def choose(self, light: str) -> None:
        self.bar.light.setCurrentIndex(self.bar.light.findData(light))
        self.bar.light.activated.emit(self.bar.light.currentIndex())

    @property
    def shown(self) -> tuple[str, bool]:
        return self.bar.light.currentData(), self.bar.adapted.isChecked()

    @property
    def band(self) -> tuple[int, int, str]:
        return self.bar.slider.maximum(), self.bar.slider.value(), self.bar.nm.text()

    @property
    def picture(self) -> bytes:
        assert self.state.picture.value is not None
        return self.state.picture.value.tobytes()


@pytest.fixture
def bench(qtbot: QtBot, tmp_path: Path) -> Bench:
    made = Bench(qtbot)
    made.control.open(write_small_result(tmp_path))
    return made


@pytest.fixture
def few(bench: Bench, tmp_path: Path) -> Path:
    """A result of twelve bands, 430 to 485 nm."""
    path = tmp_path / "small.zarr"
    return save_result(load_result(path).load().isel(wavelength_nm=slice(12)), tmp_path / "few.zarr")


def test_results_with_other_numbers_of_bands_open_at_their_middle(bench: Bench, few: Path) -> None:
    small = few.with_name("small.zarr")
    assert bench.band == (46, 23, "545 nm")
    bench.control.step_band(99)
    bench.control.open(few)
    assert (bench.state.band.value, *bench.band) == (6, 11, 6, "460 nm")
    bench.control.step_band(99)
    assert bench.band == (11, 11, "485 nm")
    bench.control.open(small)
    assert (bench.state.band.value, *bench.band) == (23, 46, 23, "545 nm")


def test_no_band_is_asked_of_a_result_that_lacks_it(bench: Bench, few: Path) -> None:
    def look(_: object) -> None:
        result = bench.state.result.value
        assert result is not None
        result.wavelengths_nm[bench.state.band.value]

    for value in (bench.state.band, bench.state.result, bench.state.picture, bench.state.search):
        value.changed.connect(look)
    for path in (few, few.with_name("small.zarr"), few):
        bench.control.step_band(99)
        bench.control.open(path)
        assert bench.state.busy.value == ""


def test_of_two_quick_lights_the_last_is_shown(bench: Bench) -> None:
    bench.choose("A")
    bench.choose("D50")
    assert bench.shown == ("D50", True)
    bench.runner.run(1)
    last = bench.picture
    bench.runner.run(0)
    assert bench.picture == last
    assert bench.state.light.value == "D50"


def test_a_light_that_comes_after_another_result_is_left_out(bench: Bench, few: Path) -> None:
    bench.choose("A")
    bench.control.open(few)
    before = bench.picture
    bench.runner.run()
    assert bench.picture == before
    assert bench.shown == ("D65", True)


@pytest.mark.parametrize("way", ["cancelled", "failed"])
def test_a_light_that_does_not_come_is_not_claimed(
    bench: Bench, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.choose("D50")
    bench.runner.run()
    before = bench.picture
    bench.bar.adapted.click()
    bench.choose("A")
    if way == "cancelled":
        for job in bench.runner.waiting:
            job.cancel()
    else:
        monkeypatch.setattr("dsl_app.results.controller.rgba_of_colours", _no_memory)
    bench.runner.run()
    assert bench.shown == ("A", False)
    bench.runner.run()
    assert bench.shown == (bench.state.light.value, bench.state.adapted.value) == ("D50", True)
    assert bench.picture == before


def _no_memory(_: object) -> None:
    raise MemoryError("no memory is left")


def test_what_eyes_were_adapted_to_comes_back_with_its_tick(
    bench: Bench, qtbot: QtBot, few: Path, tmp_path: Path
) -> None:
    bench.bar.adapted.click()
    bench.control.step_band(3)
    part = results_part(bench.state)
    assert part is not None
    again = Bench(qtbot)
    restore_result(part, again.control)
    assert again.shown == ("D65", False)
    assert again.bar.nm.text() == "560 nm"
    again.control.open(few)
    assert again.bar.nm.text() == "460 nm"


@pytest.mark.parametrize(
    ("view", "cloud_by", "quality", "shown"),
    [
        (ResultView.COLOUR, ResultView.BAND, QualityMap.SHARE, {"colours", "light", "colour_row"}),
        (ResultView.BAND, ResultView.COLOUR, QualityMap.FLAGS, {"band", "colour_row"}),
        (ResultView.DEPTH, ResultView.COLOUR, QualityMap.SHARE, {"depth_row"}),
        (ResultView.QUALITY, ResultView.COLOUR, QualityMap.FLAGS, {"quality", "colour_row"}),
        (ResultView.QUALITY, ResultView.COLOUR, QualityMap.SPREAD, {"quality", "band", "colour_row"}),
        (ResultView.QUALITY, ResultView.COLOUR, QualityMap.DEPTH_SPREAD, {"quality", "colour_row"}),
        (
            ResultView.CLOUD,
            ResultView.COLOUR,
            QualityMap.SHARE,
            {"colours", "light", "cloud", "depth_row", "colour_row"},
        ),
        (ResultView.CLOUD, ResultView.DEPTH, QualityMap.SHARE, {"cloud", "depth_row"}),
    ],
)
def test_a_view_has_the_controls_it_needs(
    view: ResultView, cloud_by: ResultView, quality: QualityMap, shown: set[str]
) -> None:
    found = asdict(controls_for(view, cloud_by, quality))
    assert {name for name, is_shown in found.items() if is_shown} == shown


def test_a_result_of_depth_alone_offers_neither_colours_nor_bands(bench: Bench, tmp_path: Path) -> None:
    bar, state = bench.bar, bench.state
    needy = (ResultView.COLOUR, ResultView.BAND)
    assert all(bar.views[view].isEnabled() for view in ResultView)
    tips = [bar.views[view].toolTip() for view in needy]
    bench.control.open(write_small_result(tmp_path / "flat", spectra=False))
    assert [view for view in ResultView if not bar.views[view].isEnabled()] == list(needy)
    assert all(bar.views[view].toolTip().startswith("This result has depth only") for view in needy)
    assert (state.view.value, state.cloud_by.value) == (ResultView.DEPTH, ResultView.DEPTH)
    model = bar.cloud_by.model()
    flags = {bar.cloud_by.itemData(row): model.flags(model.index(row, 0)) for row in range(model.rowCount())}
    assert [view for view, flag in flags.items() if not flag & Qt.ItemFlag.ItemIsEnabled] == list(needy)
    bench.control.open(tmp_path / "small.zarr")
    assert [bar.views[view].toolTip() for view in needy] == tips
    assert state.cloud_by.value is ResultView.COLOUR
    assert all(bar.views[view].isEnabled() for view in ResultView)


@pytest.mark.parametrize("scale", [1e-3, 300.0])
def test_depth_limits_hold_nearly_all_depths_in_metres_and_far_away(
    bench: Bench, tmp_path: Path, scale: float
) -> None:
    result = load_result(tmp_path / "small.zarr").load()
    result["depth_mm"] = result["depth_mm"] * scale
    bench.control.open(save_result(result, tmp_path / "scaled.zarr"))
    bench.bar.automatic.click()
    limits = bench.state.depth_limits.value
    assert limits is not None
    assert limits == pytest.approx((700 * scale, 717.5 * scale), abs=0.1 * scale)
    assert bench.notifier.told == []
