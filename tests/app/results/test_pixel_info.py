"""The values under the cursor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dsl_app.results.pixel_info import pixel_text
from pytestqt.qtbot import QtBot

from tests.app.support.results_bench import Bench, move
from tests.app.support.results_bench import bench as bench
from tests.app.support.small_result import DARK, NM, RED, UNREACHED


def test_pointing_shows_the_pixel_and_its_spectrum(bench: Bench, qtbot: QtBot) -> None:
    move(bench.view, bench.at((20, 7)))
    move(bench.view, bench.at((20, 8)))
    qtbot.waitUntil(lambda: bench.state.cursor.value == (20, 8))
    text = bench.page.pixel_info.values.text().replace(chr(0xA0), " ")
    assert "pixel 20, 8" in text
    assert "z 710.00 ± 0.25 mm" in text
    assert "545 nm  0.400 ± 0.010" in text
    x, y = bench.page.spectra.content.live.solid.getData()
    assert x.tolist() == NM.tolist()
    np.testing.assert_allclose(y, RED, atol=1e-4)


def test_a_bad_pixel_says_why(bench: Bench) -> None:
    bench.control.point_at(DARK)
    assert (
        bench.page.pixel_info.values.text()
        .replace(chr(0xA0), " ")
        .endswith("no depth   ·   545 nm  no reflectance")
    )
    assert "too little projector light" in bench.page.pixel_info.reasons.text()
    assert not bench.page.spectra.content.live.solid.isVisible()
    bench.control.point_at(UNREACHED)
    assert "430–445 nm" in bench.page.pixel_info.reasons.text()
    _, dashed = bench.page.spectra.content.live.dashed.getData()
    assert np.isfinite(dashed).sum() == 5
    bench.control.point_at((9, 9))
    assert "has no flags" in bench.page.pixel_info.reasons.text()


def test_a_deviation_that_is_known_is_not_told_as_zero(bench: Bench) -> None:
    result = bench.state.result.value
    assert result is not None
    tiny = {name: result[name] * np.float32(1e-3) for name in ("depth_std_mm", "reflectance_std")}
    text = pixel_text(replace(result, arrays={**result.arrays, **tiny}), (20, 8), 23)
    assert text.endswith("z 710.00 ± 0.01 mm   ·   545 nm  0.400 ± 0.001")
    unknown = {name: result[name] * np.float32(np.nan) for name in tiny}
    text = pixel_text(replace(result, arrays={**result.arrays, **unknown}), (20, 8), 23)
    assert text.endswith("z 710.00 ± – mm   ·   545 nm  0.400 ± –")
