"""What the frames of a scan say of its light, on pictures made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.plan import Shot
from dsl_core.optics.sensor import bayer_channels
from dsl_core.reconstruction.light import witnesses
from dsl_core.reconstruction.light.setting_ratios import Ratio
from dsl_core.reconstruction.light.witnesses import (
    ColoursAgain,
    colours_of_whites,
    of_lines,
    of_settings,
    of_whites,
)
from tests.cases.scan_light import COUNT, PLAN, levels_of, scan_of, shots_of


def test_lines_witness_the_shot_of_their_last_setting_and_share_a_slope_over_the_picture() -> None:
    lines = levels_of()
    heard = list(of_lines(scan_of(), lines))
    for k, (each, log, std) in enumerate(zip(heard, lines.log, lines.std, strict=True)):
        assert each.shot == shots_of("spectral", k)[-1].index
        assert (each.against, each.log, each.setting) == (None, log, None)
        assert each.std == pytest.approx(np.hypot(std, 0.004))
        assert each.slope == pytest.approx((k + 0.5) / (COUNT / 2) - 1)
    assert list(of_lines(scan_of(), None)) == []


def test_settings_witness_each_other() -> None:
    scan = scan_of()
    scan.ratios = {
        ("spectral", 1): (Ratio(0.03, 0.01), Ratio(0.0, 0.0)),
        ("spectral", 0): (None, Ratio(0, 0)),
    }
    (heard,) = of_settings(scan)
    first, last = shots_of("spectral", 1)
    assert (heard.shot, heard.against, heard.log, heard.std) == (first.index, last.index, 0.03, 0.01)
    assert heard.setting == 0


def test_whites_are_compared_where_both_are_bright_and_neither_is_saturated() -> None:
    sensor, full = scan_of().rig.sensor, scan_of().rig.sensor.full_scale_dn
    shot, old = shots_of("white", 0)[0], shots_of("white", 0)[-1]
    rng = np.random.default_rng(3)
    first = rng.uniform(0.3, 0.5, (6, 10)) * full
    now = 1.04 * first
    used = np.ones(first.shape, bool)
    for place, (a, b) in {(0, 0): (0.91, 0.5), (0, 1): (0.5, 0.91), (0, 2): (0.1, 0.02)}.items():
        first[place], now[place], used[place] = a * full, b * full, False
    first[0, 3] = now[0, 3] = 0.28 * np.percentile(first, 95)
    first[0, 4] = now[0, 4] = 0.88 * full
    first[0, 5], used[0, 5] = 0.24 * np.percentile(first, 95), False
    now[0, 5] = first[0, 5]
    found = witnesses._compared(scan_of(), shot, old, first, now)
    sums = now[used].sum(), first[used].sum()
    assert (found.shot, found.against) == (shot.index, old.index)
    assert found.log == pytest.approx(np.log(sums[0] / sums[1]))
    noise = [
        each / sensor.electrons_per_dn + used.sum() * (sensor.read_noise_dn**2 + 1 / 12) for each in sums
    ]
    assert found.std == pytest.approx(np.sqrt(noise[0] / sums[0] ** 2 + noise[1] / sums[1] ** 2))
    # Of the dark nothing is known, and nothing is divided by zero.
    dark = witnesses._compared(scan_of(), shot, old, 0 * first, 0 * now)
    assert (dark.log, dark.std) == (0.0, 0.0)


def test_noise_does_not_choose_the_pixels_in_which_whites_are_compared() -> None:
    """Those that it made bright enough in the first white would be darker in the second."""
    rng = np.random.default_rng(4)
    light = rng.uniform(20, 320, (100, 100))
    first, now = (light + rng.normal(0, 80, light.shape) for _ in range(2))
    shots = shots_of("white", 0)
    assert abs(witnesses._compared(scan_of(), shots[0], shots[-1], first, now).log) < 0.01


def test_white_is_compared_with_white_less_the_black_next_to_each(monkeypatch: pytest.MonkeyPatch) -> None:
    def read(shot: Shot) -> NDArray[np.uint16]:
        return np.full((2, 2), shot.index, np.uint16)

    heard = list[tuple[Shot, Shot, float, float]]()

    def compared(scan: Any, shot: Shot, old: Shot, first: NDArray[Any], now: NDArray[Any]) -> None:
        heard.append((shot, old, float(first[0, 0]), float(now[0, 0])))

    monkeypatch.setattr(witnesses, "_compared", compared)
    list(of_whites(scan_of(source=SimpleNamespace(read=read))))
    again = [shot for shot in PLAN.shots() if shot.role == "sentinel"]
    whites = [shot for shot in again if PLAN.original(shot).role == "white"]
    assert [each[0] for each in heard] == whites
    assert whites
    for shot, old, first, now in heard:
        assert old == PLAN.original(shot)
        black = shots_of("black", 0)[old.setting]
        near = [b for b in again if PLAN.original(b).role == "black" and abs(b.index - shot.index) < 4]
        assert first == old.index - black.index
        assert now == shot.index - near[0].index


def test_white_is_compared_colour_by_colour_and_something_before_a_part_of_it_is_no_colour() -> None:
    """Blue loses a tenth everywhere; then a shadow falls on a red wall at the side."""
    rng = np.random.default_rng(2)
    channels = bayer_channels("RGGB", 40, 60)
    white = rng.uniform(900, 1100, channels.shape)
    white[:, :20] *= np.array([1.0, 0.4, 0.4])[channels[:, :20]]
    shade = np.where(np.arange(60) < 15, 0.5, 1.0)

    def found(now: NDArray[np.float64]) -> ColoursAgain:
        def read(shot: Shot) -> NDArray[np.uint16]:
            role = PLAN.original(shot).role if shot.role == "sentinel" else shot.role
            light = now if shot.role == "sentinel" else white
            counts = 200 + (0 if role == "black" else light)
            return np.rint(rng.normal(counts, 3, channels.shape)).astype(np.uint16)

        return next(colours_of_whites(scan_of(source=SimpleNamespace(read=read))))

    bluish = found(white * np.array([1.0, 1.0, 0.9])[channels])
    assert bluish.log == pytest.approx((0.0, 0.0, np.log(0.9)), abs=0.004)
    assert bluish.apart == pytest.approx(-np.log(0.9), abs=0.004)
    assert bluish.std < 0.002
    shaded = found(white * shade)
    assert shaded.apart < max(0.004, 4 * shaded.std)


@pytest.mark.parametrize("shape", [(1, 300), (300, 1)])
def test_a_picture_that_lacks_a_colour_says_nothing_of_colours(shape: tuple[int, int]) -> None:
    def read(shot: Shot) -> NDArray[np.uint16]:
        role = PLAN.original(shot).role if shot.role == "sentinel" else shot.role
        return np.full(shape, 200 if role == "black" else 1200, np.uint16)

    assert list(colours_of_whites(scan_of(source=SimpleNamespace(read=read)))) == []
