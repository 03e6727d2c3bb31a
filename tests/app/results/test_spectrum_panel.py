"""The plot of spectra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.spectrum_panel import MOST_BANDS
from dsl_app.results.state import ResultView
from dsl_app.shared.widgets.spectrum_curve import SpectrumCurve

from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import NM, write_small_result


def test_the_band_line_and_the_slider_agree(bench: Bench) -> None:
    bench.control.show(ResultView.BAND)
    bench.page.bar.slider.setValue(10)
    assert bench.state.band.value == 10
    assert bench.page.spectra.content.band_line.value() == NM[10]
    bench.page.spectra.content.band_line.setValue(611.0)
    assert bench.state.band.value == 36
    assert bench.page.bar.nm.text() == "610 nm"


def test_transforms_are_drawn_with_their_deviations_and_stacked(bench: Bench) -> None:
    panel = bench.page.spectra.content
    bench.control.marks.pin((30, 5))
    bench.control.marks.pin((5, 5))
    panel.transform.setCurrentIndex(1)
    panel.transform.activated.emit(1)
    (first, _), (second, _) = panel.named_curves
    assert np.mean(first.getData()[1]) == pytest.approx(1.0)
    before = second.getData()[1]
    panel.stacked.click()
    (_, _), (second, _) = panel.named_curves
    assert (second.getData()[1] > before + 0.5).all()
    bench.control.point_at((30, 5))
    assert np.mean(panel.live.solid.getData()[1]) == pytest.approx(1.0)
    # No pixel has the values that the axis shows then.
    assert panel.item.getAxis("left").labelText == "Normalised to mean 1 + 0.62 a mark"
    panel.stacked.click()
    assert panel.item.getAxis("left").labelText == "Normalised to mean 1"


def test_numbers_of_a_derivative_do_not_touch_what_they_are(bench: Bench) -> None:
    panel = bench.page.spectra.content
    axis = panel.item.getAxis("left")
    panel.transform.setCurrentIndex(2)
    panel.transform.activated.emit(2)
    texts = axis.tickStrings([-0.005, 0.005], 1.0, 0.005)
    digits = max(panel.fontMetrics().horizontalAdvance(text) for text in texts)
    assert axis.label.boundingRect().height() + digits <= axis.fixedWidth


def test_of_many_marks_the_selected_one_alone_keeps_its_band(bench: Bench) -> None:
    panel = bench.page.spectra.content

    def has_band(curve: SpectrumCurve) -> bool:
        return curve.band is not None and bool(curve.band.isVisible())

    def with_band() -> list[str]:
        return [mark.name for mark, curve in panel._curves.values() if has_band(curve)]

    for column in range(MOST_BANDS):
        bench.control.marks.pin((column + 10, 8))
    assert len(with_band()) == MOST_BANDS
    bench.control.marks.pin((30, 5))
    assert with_band() == [f"pin {MOST_BANDS + 1}"]
    bench.state.selected.set(bench.state.marks.value[0].key)
    assert with_band() == ["pin 1"]
    bench.control.point_at((5, 5))
    assert has_band(panel.live)


def test_a_result_of_depth_only_says_why_there_are_no_curves(bench: Bench, tmp_path: Path) -> None:
    panel = bench.page.spectra.content
    assert panel.note.isHidden()
    (tmp_path / "flat").mkdir()
    bench.window.open_path(write_small_result(tmp_path / "flat", spectra=False))
    assert panel.note.text().startswith("This result has depth only.")
    assert bench.page.marks.hint.text() == panel.note.text(), "nothing can be pinned"
    assert (panel.note.isVisible(), panel.band_line.isVisible()) == (True, False)


def test_the_graph_shows_all_bands_of_a_result_after_one_of_fewer(bench: Bench, tmp_path: Path) -> None:
    whole = bench.state.result.value
    assert whole is not None
    low, high = bench.page.spectra.content.item.viewRange()[0]
    part = load_result(whole.path).sel(wavelength_nm=slice(500.0, 600.0))
    bench.window.open_path(save_result(part, tmp_path / "part.zarr"))
    assert bench.page.spectra.content.item.viewRange()[0] == pytest.approx([498, 602], abs=1)
    bench.window.open_path(whole.path)
    assert bench.page.spectra.content.item.viewRange()[0] == pytest.approx([low, high])
    assert (low < NM[0], high > NM[-1]) == (True, True)
