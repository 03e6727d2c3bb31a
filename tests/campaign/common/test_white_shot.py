"""A test shot of white: what it measures, and the exposures that suit it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.common.white_shot import (
    FILL,
    LONGEST_MS,
    WhiteLevel,
    bracket,
    bright_setting,
    film_light,
    note_of_filter,
    require_filter,
    shoot_white,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.figure import failures
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from tests.cases.film_bench import film_bench, place
from tests.cases.small_rig import small_rig

RIG = small_rig()
RANGE_DN = RIG.sensor.full_scale_dn - RIG.sensor.black_level_dn


@pytest.fixture(scope="module")
def bench() -> Bench:
    found = film_bench(Path(), 4, ("camera", "projector", "pose", "emission", "sensor", "flat_field"))
    place(found, Placement(target="spectralon", film=True))
    return found


def white(cycles: float, ambient: float = 0.0) -> WhiteLevel:
    """White that fills the range in so many LED cycles."""
    rate = RANGE_DN / (cycles * RIG.frame_period_ms)
    return WhiteLevel(rate, np.full(3, rate), ambient, False)


def light_of(rig: Rig, level: float) -> float:
    return float(rig.projector_response.radiance(level) - rig.projector_response.radiance(0.0))


def test_the_projector_alone_waits_for_its_latency(bench: Bench) -> None:
    waits: list[float] = []
    shot = shoot_white(replace(bench, devices=replace(bench.devices, sleep=waits.append)))
    assert waits == []
    assert shot.brightest > shot.mean.max() > 0
    assert not shot.saturated
    assert not failures(film_light(shot, bench.rig))


def test_a_monochrome_camera_has_the_mean_of_its_one_colour(bench: Bench) -> None:
    place(bench, Placement(target="spectralon", film=True))
    sensor = bench.rig.sensor.model_copy(update={"bayer": "MONO"})
    shot = shoot_white(replace(bench, rig=bench.rig.model_copy(update={"sensor": sensor})))
    assert shot.mean == pytest.approx([0.0, shot.picture.mean(), 0.0])


def test_another_filter_and_none_are_refused(bench: Bench) -> None:
    place(bench, Placement(target="spectralon", film=True))
    open_white = shoot_white(bench)
    place(bench, Placement(target="spectralon", film=True, filter_nm=600.0))
    note, seen = note_of_filter(bench.devices, 600.0), shoot_white(bench)
    require_filter(bench.rig, seen, note, "Red", open_white.brightest)
    with pytest.raises(CalibrationError, match="Red: the picture is about as bright as without a filter"):
        require_filter(bench.rig, open_white, note, "Red", open_white.brightest)
    other = note_of_filter(bench.devices, 450.0)
    with pytest.raises(CalibrationError, match=r"Blue: the colours are those of a filter of about \d+ nm"):
        require_filter(bench.rig, seen, other, "Blue", open_white.brightest)


@pytest.mark.parametrize(("cycles", "expected"), [(10.0, 9), (1.2, 1), (1e4, None)])
def test_the_bright_setting_is_whole_cycles_at_full_drive(cycles: float, expected: int | None) -> None:
    found = bright_setting(RIG, white(cycles), "It")
    longest = int(LONGEST_MS / RIG.frame_period_ms)
    assert found.level == 1.0
    assert found.exposure_ms / RIG.frame_period_ms == pytest.approx(expected or longest)


def test_white_that_fills_one_cycle_is_dimmed(bench: Bench) -> None:
    found = bright_setting(RIG, white(0.6), "It")
    assert found.exposure_ms == pytest.approx(RIG.frame_period_ms)
    assert light_of(RIG, found.level) / 0.6 <= FILL < light_of(RIG, 1.0) / 0.6


def test_a_bracket_has_one_level_and_the_ratio_of_exposures() -> None:
    short, long = bracket(RIG, white(30.0), "It", 6.0)
    assert short.level == long.level == 1.0
    assert long.exposure_ms == pytest.approx(6 * short.exposure_ms)
    assert short.exposure_ms / RIG.frame_period_ms == pytest.approx(27)
    dimmed, _ = bracket(RIG, white(2.0), "It", 6.0)
    cycles = dimmed.exposure_ms / RIG.frame_period_ms
    assert cycles >= 6
    assert cycles * light_of(RIG, dimmed.level) / 2.0 <= FILL
    assert len(bracket(RIG, white(30.0), "It", 1.0)) == 1


def test_light_that_is_too_weak_or_not_the_projectors_is_told() -> None:
    with pytest.raises(CalibrationError, match="It is too dark: in 4 s white reaches"):
        bracket(RIG, white(1e5), "It", 6.0)
    assert [figure.name for figure in failures(film_light(white(10.0, 0.3), RIG))] == ["ambient light"]


def test_a_look_finds_too_dark_what_a_capture_would_refuse() -> None:
    for cycles in (10.0, 1e5):
        seen, _ = film_light(white(cycles), RIG)
        try:
            bracket(RIG, white(cycles), "It", 1.0)
        except CalibrationError:
            assert not seen.passed
        else:
            assert str(seen) == "brightness of white in up to 4 s 100 % of the camera's range"
    assert seen.limits == "at least 2 % of the camera's range"
