"""Results of other programs, which hold less than ours: what is there is shown, what is missing is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from dsl_app.results.state import QualityMap, ResultView

from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.results_bench import Bench
from tests.app.support.results_bench import bench as bench

#: What each kind of result keeps of ours.
KEPT = {
    "spectra alone": lambda full: full[["reflectance"]],
    "depth alone": lambda full: full[["depth_mm"]],
    "spectra and depth": lambda full: full[["reflectance", "depth_mm"]],
    "one band": lambda full: full.isel(wavelength_nm=slice(9, 10)),
    "nothing finite": lambda full: full.map(lambda each: each * np.nan if each.dtype.kind == "f" else each),
    "4 x 3 pixels": lambda full: full.isel(y=slice(6, 9), x=slice(16, 20)),
    "a pixel, a band": lambda full: full.isel(y=slice(6, 7), x=slice(6, 7), wavelength_nm=slice(3, 4)),
}


@pytest.mark.parametrize("kind", KEPT)
def test_every_view_shows_what_there_is(bench: Bench, tmp_path: Path, kind: str) -> None:
    full: xr.Dataset = load_result(tmp_path / "small.zarr", lazy=False)
    stored = save_result(KEPT[kind](full), tmp_path / "foreign.zarr")
    state, control = bench.state, bench.control
    control.show(ResultView.QUALITY)
    state.quality.set(QualityMap.DEPTH_SPREAD)
    bench.window.open_path(stored)
    result = state.result.value
    assert result is not None
    assert result.path == stored
    # Of a view that shows nothing of it, too, it is fitted.
    (left, right), _ = bench.page.image.content.box.viewRange()
    assert left < 0 <= result.shape[1] - 1 < right
    control.show(ResultView.QUALITY)
    image = bench.page.image.content
    for what in QualityMap:
        state.quality.set(what)
        assert image._layers is not None
        lacks = image._layers.lacks(what)
        assert not lacks or (image.legend.isVisible() and image.legend.text() == lacks)
    for view in (ResultView.DEPTH, ResultView.BAND, ResultView.COLOUR):
        control.show(view)
    height, width = result.shape
    for pixel in ((width // 2, height // 2), (0, 0)):
        control.point_at(pixel)
        control.marks.pin(pixel)
        control.search.start(bench.page.search.content.mode.itemData(0))
    if "band" in kind and state.marks.value:
        (curve, _), *_ = bench.page.spectra.content.named_curves
        assert len(curve.getData()[0]) == 2
    control.relight("A", False)
    control.answers.from_marks(bench.page.materials.content.way)
    assert bench.page.pixel_info.values.text()
    told = bench.page.warning.text()
    assert ("standard deviation of depth" in told) == (" alone" in kind or kind == "spectra and depth")
    assert ("deviation of reflectance" in told) == kind.startswith("spectra")
    assert not [toast.text for toast in bench.window.toasts.shown if "Unexpected" in toast.text]
