"""Looking for a spectrum in the whole picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from dsl_app.results.search.controller import SearchController
from dsl_app.results.search.panel import HINT, search_text
from dsl_app.results.state import Mark, SearchMode
from dsl_app.shared.spectrum import Spectrum

from tests.app.support.doubles import ManualRunner, RecordingNotifier
from tests.app.support.results_controller import Bench
from tests.app.support.results_controller import bench as bench
from tests.app.support.results_controller import lacking as lacking
from tests.app.support.small_result import BLUE, NM, write_reference


def test_looking_for_a_spectrum_finds_its_material(bench: Bench) -> None:
    bench.control.search.start(SearchMode.SPECTRUM)
    assert "Select a pin" in bench.told
    bench.control.point_at((30, 5))
    bench.control.search.start(SearchMode.SPECTRUM)
    search = bench.state.search.value
    assert search is not None
    assert search.name == "pixel 30, 5"
    assert search.found[:, 18:].all()
    assert not search.found[:, :18].any()
    bench.control.search.set_limits(2.0, 2.0)
    assert bench.state.search.value is not None
    assert bench.state.search.value.found[0].all()
    bench.control.search.set_mode(SearchMode.METAMERS)
    assert not bench.state.search.value.found.any()
    bench.control.search.clear()
    assert bench.state.search.value is None


def test_a_reference_of_part_of_the_range_is_not_looked_for(bench: Bench, tmp_path: Path) -> None:
    short = tmp_path / "short.csv"
    short.write_text("\n".join(f"{nm},{nm / 1000}" for nm in range(400, 551, 10)))
    bench.control.open(short)
    bench.control.search.start(SearchMode.SPECTRUM)
    assert "400 to 550 nm" in bench.told
    assert "430 to 660 nm" in bench.told
    assert bench.state.search.value is None


def test_a_reference_is_averaged_over_the_bands_of_the_result(bench: Bench, tmp_path: Path) -> None:
    fine = np.arange(400.0, 701.0)
    # Lines of 1 nm right at the bands, which their means hardly see.
    values = np.interp(fine, NM, BLUE) - 0.09 * (fine % 20 == 10)
    lines = tmp_path / "lines.csv"
    lines.write_text("\n".join(f"{nm},{value}" for nm, value in zip(fine, values, strict=True)))
    bench.control.open(lines)
    bench.control.search.start(SearchMode.SPECTRUM)
    search = bench.state.search.value
    assert search is not None
    assert search.likeness.angle_rad[3, 3] < 0.04


def test_the_share_found_is_of_pixels_with_a_spectrum(bench: Bench) -> None:
    bench.control.point_at((30, 5))
    bench.control.search.start(SearchMode.SPECTRUM)
    search = bench.state.search.value
    assert search is not None
    assert search.share == 18 * 24 / (36 * 24 - 1)
    nowhere = replace(search.likeness, angle_rad=np.full_like(search.likeness.angle_rad, np.nan))
    assert replace(search, likeness=nowhere).share is None
    # Near infrared, no pixel has a colour that others could look like; spectra are compared all the same.
    invisible = replace(search.likeness, delta_e=nowhere.angle_rad)
    assert "has a colour" in search_text(replace(search, likeness=invisible, mode=SearchMode.METAMERS))
    without_colour = replace(search, likeness=invisible)
    assert without_colour.share == search.share
    assert without_colour.noise_of_alike_rad > 0


def test_what_was_found_is_said_in_a_sentence(bench: Bench) -> None:
    assert search_text(None) == HINT
    bench.control.point_at((30, 5))
    bench.control.search.start(SearchMode.SPECTRUM)
    search = bench.state.search.value
    assert search is not None
    assert search_text(search) == (
        "50.06 % of the pixels with a spectrum have the spectrum of pixel 30, 5 (angle up to 0.05 rad)."
    )
    metamers = replace(search, mode=SearchMode.METAMERS, within_rad=0.1)
    assert search_text(metamers) == (
        "0.00 % of the pixels with a spectrum look like pixel 30, 5 (ΔE00 up to 2) but differ by more than"
        " 0.1 rad."
    )
    nowhere = replace(search.likeness, angle_rad=np.full_like(search.likeness.angle_rad, np.nan))
    assert search_text(replace(search, likeness=nowhere)) == "No pixel of this result has a spectrum."


def test_a_mark_without_spectrum_is_not_searched_for(bench: Bench) -> None:
    mark = Mark("pin", "lost", 0, Spectrum(NM, BLUE), pixel=(3, 3), trouble="Its pixel has no spectrum.")
    bench.state.marks.set((mark,))
    bench.state.selected.set(mark.key)
    bench.control.search.start(SearchMode.SPECTRUM)
    assert "Select a pin" in bench.told
    assert bench.state.search.value is None


def test_a_search_that_ends_after_another_result_was_opened_is_dropped(bench: Bench, tmp_path: Path) -> None:
    runner, notifier = ManualRunner(), RecordingNotifier()
    search = SearchController(bench.state, runner, notifier)
    bench.control.point_at((30, 5))
    search.start(SearchMode.SPECTRUM)
    bench.control.open(tmp_path / "small.zarr")
    runner.run_all()
    assert bench.state.search.value is None


def test_the_search_that_was_asked_for_last_is_shown(bench: Bench) -> None:
    """Jobs end in any order, and none comes back once the search is cleared."""
    runner = ManualRunner()
    search = SearchController(bench.state, runner, RecordingNotifier())
    for pixel in ((10, 10), (30, 5)):
        bench.control.point_at(pixel)
        search.start(SearchMode.SPECTRUM)
    runner.waiting.reverse()
    runner.run_all()
    assert bench.state.search.value is not None
    assert bench.state.search.value.name == "pixel 30, 5"
    search.start(SearchMode.SPECTRUM)
    search.clear()
    runner.run_all()
    assert bench.state.search.value is None


def test_a_band_that_no_pixel_has_hides_no_spectrum(lacking: Bench, tmp_path: Path) -> None:
    lacking.control.point_at((30, 5))
    lacking.control.search.start(SearchMode.SPECTRUM)
    search = lacking.state.search.value
    assert search is not None
    assert search.found[:, 18:].all()
    lacking.control.open(write_reference(tmp_path / "tile.csv", BLUE))
    lacking.control.search.start(SearchMode.SPECTRUM)
    search = lacking.state.search.value
    assert search is not None
    assert search.found[3, 3]
    assert not search.found[:, 18:].any()
