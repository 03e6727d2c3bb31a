"""The tables of the selected mark."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from dsl_app.results.marks.comparison import comparison_html
from dsl_app.results.marks.spectra import shown_spectra
from dsl_app.shared.theme import LIGHT

from tests.app.support.results_controller import SQUARE, Bench
from tests.app.support.results_controller import bench as bench
from tests.app.support.small_result import BLUE, write_reference


def select(bench: Bench, place: int) -> str:
    bench.state.selected.set(bench.state.marks.value[place].key)
    return comparison_html(bench.state, LIGHT)


def test_a_pin_is_compared_with_references_and_measured_to_other_pins(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((3, 3))
    assert select(bench, 0) == ""
    bench.control.marks.pin((3, 13))
    bench.control.marks.add_reference(write_reference(tmp_path / "double.csv", 2 * BLUE))
    html = select(bench, 0).replace(chr(0x200A), " ")
    # Half as bright, but of the same shape: scaled by two, it has no error left.
    assert "double" in html
    assert f"{np.sqrt(np.mean(BLUE**2)):.4f} ± 0.0028" in html
    assert "0.000 ± 0.019" in html
    assert html.count("2.000 ± 0.013") == 1
    assert "noise alone</span></td><td align='right'>0.0100</td>" in html, "what is stated for the pixel"
    assert "one deviation, from those stated for the bands of one pixel" in html
    # Ten rows of 701.5 mm depth at 1/100 of it each.
    assert "70.150 ± 0.023 mm" in html
    bench.control.marks.show(False, bench.state.marks.value[2].key)
    assert "double" not in select(bench, 0)


def test_pins_say_whether_they_differ_by_more_than_their_deviations(bench: Bench) -> None:
    bench.control.marks.pin((3, 3))
    bench.control.marks.pin((3, 13))
    assert "not shown" in select(bench, 0)
    bench.control.marks.pin((30, 5))
    html = select(bench, 0)
    assert "pin 1 minus" in html
    assert html.count("not shown") == 1
    assert html.count("yes") == 1
    assert "±" in html


def test_regions_have_no_distance(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.add_outline(SQUARE)
    bench.control.marks.pin((3, 3))
    bench.control.marks.add_reference(write_reference(tmp_path / "same.csv", BLUE))
    assert "distance" not in select(bench, 0)
    assert "same" in select(bench, 0)


def test_a_reference_is_compared_with_all_that_is_measured_as_soon_as_it_is_added(
    bench: Bench, tmp_path: Path
) -> None:
    bench.control.marks.add_reference(write_reference(tmp_path / "other.csv", BLUE))
    assert select(bench, 0) == "", "nothing is measured yet"
    bench.control.marks.add_outline(SQUARE)
    bench.control.marks.pin((3, 3))
    bench.control.marks.add_reference(write_reference(tmp_path / "double.csv", 2 * BLUE))
    html = comparison_html(bench.state, LIGHT)
    assert "double against" in html
    assert [name in html for name in ("region 1", "pin 1", "other")] == [True, True, False]
    # Both are half as bright, whichever way they are compared.
    assert html.count("2.000") == 2
    assert html.count(f"{np.sqrt(np.mean(BLUE**2)):.4f}") == 2


def test_a_short_reference_says_its_range(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((30, 5))
    short = tmp_path / "short.csv"
    short.write_text("\n".join(f"{nm},0.5" for nm in range(500, 551, 5)))
    bench.control.marks.add_reference(short)
    html = select(bench, 0)
    assert "only 500–550 nm, scaled by" in html
    assert html.count("<td align='right'>–</td>") == 3, "so few wavelengths have no colour"


def test_a_region_says_how_its_pixels_differ_and_what_is_stated_for_one(bench: Bench) -> None:
    bench.control.marks.add_outline(SQUARE)
    region = bench.state.selected_mark
    assert region is not None
    assert region.spectrum.std is not None
    assert region.pixel_std is not None
    bench.state.band.set(1)
    html = comparison_html(bench.state, LIGHT)
    assert f"region 1, {region.spectrum.nm[1]:g} nm" in html
    assert "20 of 20 pixels" in html
    for value in (region.spectrum.mean[1], region.spectrum.std[1], region.pixel_std[1]):
        assert f">{value:.4f}<" in html


def test_a_region_of_one_pixel_has_the_deviation_stated_for_that(bench: Bench) -> None:
    bench.control.marks.add_outline(((2.6, 2.6), (3.4, 2.6), (3.4, 3.4), (2.6, 3.4)))
    region = bench.state.selected_mark
    assert region is not None
    assert region.pixel_std is not None
    np.testing.assert_array_equal(region.spectrum.std, region.pixel_std)
    assert (region.pixel_std > 0).all()
    assert ">–<" in comparison_html(bench.state, LIGHT), "a single pixel shows no spread"
    (exported,) = shown_spectra([region], bench.state.result.value)
    assert exported.deviation is None
    assert exported.uncertainty is region.pixel_std
