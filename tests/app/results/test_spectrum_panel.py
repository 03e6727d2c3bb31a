"""The plot of spectra."""

from __future__ import annotations

from dsl_app.results.state import ResultView

from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import NM


def test_the_band_line_and_the_slider_agree(bench: Bench) -> None:
    bench.control.show(ResultView.BAND)
    bench.page.bar.slider.setValue(10)
    assert bench.state.band.value == 10
    assert bench.page.spectra.content.band_line.value() == NM[10]
    bench.page.spectra.content.band_line.setValue(611.0)
    assert bench.state.band.value == 36
    assert bench.page.bar.nm.text() == "610 nm"
