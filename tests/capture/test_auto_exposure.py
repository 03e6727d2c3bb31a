from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.auto_exposure import FILL, MOST_FRAMES, ExposureSearch

FULL = 4095
CYCLE_MS = 1000 / 60


def scene(dn_per_ms: float, black_dn: float = 200.0, noise_dn: float = 3.0, seed: int = 0) -> object:
    """A camera that looks at an even scene with a glint in a thousandth of it."""
    rng = np.random.default_rng(seed)

    def snap(exposure_ms: float) -> NDArray[np.uint16]:
        signal = np.full((60, 80), black_dn + dn_per_ms * exposure_ms)
        signal[0, :4] *= 50
        return np.asarray((signal + rng.normal(0, noise_dn, signal.shape)).clip(0, FULL), np.uint16)

    return snap


def find(
    dn_per_ms: float, start_ms: float, cycle_ms: float | None = CYCLE_MS
) -> tuple[ExposureSearch, float]:
    snap = scene(dn_per_ms)
    assert callable(snap)
    search = ExposureSearch((0.02, 5000.0), FULL, cycle_ms, black_level_dn=200.0)
    exposure_ms = search.start_from(start_ms)
    while not search.is_over:
        exposure_ms = search.judge(snap(exposure_ms), exposure_ms)
    return search, exposure_ms


@pytest.mark.parametrize("dn_per_ms", [1.0, 4.0, 20.0])
@pytest.mark.parametrize("start_ms", [0.1, 166.0, 4000.0])
def test_it_ends_below_the_limit_at_whole_cycles(dn_per_ms: float, start_ms: float) -> None:
    search, exposure_ms = find(dn_per_ms, start_ms)
    assert search.found, search.trouble
    cycles = exposure_ms / CYCLE_MS
    assert cycles == pytest.approx(round(cycles))
    share = dn_per_ms * exposure_ms / (FULL - 200)
    assert share < FILL + 0.02
    assert share + dn_per_ms * CYCLE_MS / (FULL - 200) > 0.8


def test_without_a_cycle_any_exposure_will_do() -> None:
    search, exposure_ms = find(700.0, 100.0, cycle_ms=None)
    assert search.found
    assert 0.8 <= 700.0 * exposure_ms / (FULL - 200) <= FILL + 0.02


def test_what_no_exposure_can_mend_is_said() -> None:
    bright, _ = find(1000.0, 100.0)
    assert "Close the aperture" in bright.trouble
    dark, _ = find(0.01, 100.0)
    assert "too dark: even 5 s of exposure" in dark.trouble
    assert "Open the aperture" in dark.trouble
    assert (bright.is_too_bright, bright.is_too_dark) == (True, False)
    assert (dark.is_too_bright, dark.is_too_dark) == (False, True)


def test_light_that_flickers_ends_the_search() -> None:
    search = ExposureSearch((1.0, 5000.0), FULL, CYCLE_MS)
    exposure_ms, bright = 100.0, False
    while not search.is_over:
        bright = not bright
        exposure_ms = search.judge(np.full((4, 4), FULL if bright else 50, np.uint16), exposure_ms)
    assert "Hold everything still" in search.trouble


def test_a_saturated_frame_quarters_the_exposure_and_a_black_one_lengthens_it_sixteenfold() -> None:
    search = ExposureSearch((0.02, 5000.0), FULL, None, black_level_dn=200.0)
    assert search.judge(np.full((6, 8), FULL, np.uint16), 160.0) == pytest.approx(40.0)
    assert search.judge(np.full((6, 8), 200, np.uint16), 10.0) == pytest.approx(160.0)
    assert not search.is_over


def judged(share: float, exposure_ms: float = 100.0) -> tuple[ExposureSearch, float]:
    """The exposure after an even frame that bright, and the search."""
    search = ExposureSearch((1.0, 1000.0), 1000, None)
    return search, search.judge(np.full((10, 10), round(1000 * share), np.uint16), exposure_ms)


@pytest.mark.parametrize(
    ("share", "is_found"), [(0.79, False), (0.8, True), (0.9, True), (0.91, False), (0.999, False)]
)
def test_a_frame_near_the_wanted_brightness_ends_the_search(share: float, is_found: bool) -> None:
    search, following = judged(share)
    assert search.found == is_found
    assert following == pytest.approx(100.0 if is_found else 100 * 0.9 / share)


@pytest.mark.parametrize(("share", "is_found"), [(0.09, False), (0.11, True)])
def test_the_longest_exposure_is_enough_from_a_tenth_of_full_scale(share: float, is_found: bool) -> None:
    search, following = judged(share, 1000.0)
    assert search.found == is_found
    assert bool(search.trouble) != is_found
    assert following == 1000.0


def test_saturation_at_the_shortest_exposure_is_trouble_and_above_it_is_not() -> None:
    assert judged(1.0, 1.0)[0].trouble
    search, following = judged(1.0, 1.1)
    assert (search.trouble, following) == ("", 1.0)


@pytest.mark.parametrize(("glints", "level"), [(4, 0.5), (5, 1.0)])
def test_half_a_percent_of_pixels_may_be_brighter(glints: int, level: float) -> None:
    search = ExposureSearch((1.0, 1000.0), 1000, None, 200.0)
    pixels = np.full(1000, 600, np.uint16)
    pixels[:glints] = 1000
    assert search._brightness(pixels) == level
    pixels[:glints] = 100
    assert search._brightness(np.full(9, 100, np.uint16)) == 0.0, "below black"


def test_large_frames_are_judged_by_an_even_part_of_their_pixels() -> None:
    search = ExposureSearch((1.0, 1000.0), 1000, None)
    pixels = np.zeros(400_000, np.uint16)
    pixels[1::3] = 900
    assert search._brightness(pixels) == 0.0
    assert search._brightness(pixels[:399_999]) == 0.9


@pytest.mark.parametrize("site", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_every_colour_of_a_large_mosaic_is_judged(site: tuple[int, int]) -> None:
    frame = np.full((600, 800), 1000, np.uint16)
    frame[site[0] :: 2, site[1] :: 2] = FULL
    search = ExposureSearch((0.02, 5000.0), FULL, CYCLE_MS)
    assert search.judge(frame, 100.0) < 50.0
    assert not search.found


def test_the_twelfth_frame_is_the_last() -> None:
    search, asked = ExposureSearch((1.0, 5000.0), 1000, None), 0
    while not search.is_over:
        asked += 1
        search.judge(np.full((4, 4), 1000 if asked % 2 else 50, np.uint16), 100.0)
    assert asked == MOST_FRAMES == 12


def test_exposures_are_whole_cycles_within_the_range() -> None:
    search = ExposureSearch((12.0, 47.0), 1000, 10.0)
    assert [search.start_from(ms) for ms in (1.0, 20.0, 29.9, 30.0 - 1e-6, 36.0, 99.0)] == [
        20,
        20,
        20,
        30,
        30,
        40,
    ]
    # Where the range holds no whole cycle, the camera could follow none.
    assert ExposureSearch((12.0, 15.0), 1000, 10.0).start_from(1.0) == 12.0
    assert ExposureSearch((1.0, 2.0), 1000, 10.0).start_from(1.5) == 1.5
    # Nor does it go beyond its range by a hair.
    assert ExposureSearch((20.0 + 1e-9, 50.0 - 1e-9), 1000, 10.0).start_from(1.0) == 20.0 + 1e-9
    assert ExposureSearch((20.0 + 1e-9, 50.0 - 1e-9), 1000, 10.0).start_from(99.0) == 50.0 - 1e-9


@pytest.mark.parametrize("dn_per_ms", [50.0, 150.0, 3000.0])
@pytest.mark.parametrize("longest_ms", [30.0, 3 * CYCLE_MS - 1e-9])
def test_a_camera_of_short_exposures_finds_one_in_steady_light(dn_per_ms: float, longest_ms: float) -> None:
    snap = scene(dn_per_ms)
    assert callable(snap)
    search = ExposureSearch((0.05, longest_ms), FULL, 1000 / 24 if longest_ms == 30 else CYCLE_MS, 200.0)
    # The camera's limits apply to whatever is asked of it.
    exposure_ms = min(search.start_from(16.7), longest_ms)
    while not search.is_over:
        exposure_ms = min(max(search.judge(snap(exposure_ms), exposure_ms), 0.05), longest_ms)
    assert "changes" not in search.trouble


def test_too_much_light_is_told_from_too_little() -> None:
    assert judged(1.0, 1.0)[0].is_too_bright
    assert not judged(0.05, 1000.0)[0].is_too_bright
