"""The depth test: planes of flat targets, and how straight their distances follow a stage."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.evaluation.seen_target import Region, SeenTarget, find_target
from dsl_core.evaluation.stage_test import StageTest, stage_table, stage_test
from tests.cases.stage_series import LEAN, SHAPE, flat_arrays

POSITIONS = (695.2, 718.6, 742.1, 765.5, 788.9, 812.3, 835.8, 859.2)


def target(position_mm: float, region: Region | None = None, **details: Any) -> SeenTarget:
    arrays = flat_arrays(position_mm, **details)
    return find_target(arrays["points_mm"], arrays["flags"], region)


def test_a_plane_is_found_beside_a_background_and_without_limited_pixels() -> None:
    found = target(700.0, noise_mm=0.1)
    assert found.plane.rms_mm == pytest.approx(0.1, rel=0.1)
    background, limited = SHAPE[0] * 4, 3
    assert found.left_out == pytest.approx(background + limited, abs=5)
    assert not np.isfinite(found.residual_mm[:, -4:]).any()
    assert not np.isfinite(found.residual_mm[1, :3]).any()
    depth, std = found.depth_at(0.0, 0.0)
    assert depth == pytest.approx(700.0, abs=4 * std)
    assert 0.0005 < std < 0.02


def test_the_deviation_of_a_distance_is_that_of_many_repeats() -> None:
    place = target(700.0, noise_mm=0.3).middle_mm
    seen = [target(700.0, noise_mm=0.3, seed=seed).depth_at(*place) for seed in range(40)]
    spread = np.std([depth for depth, _ in seen], ddof=1)
    assert np.mean([std for _, std in seen]) == pytest.approx(spread, rel=0.4)


def test_what_lies_farther_is_behind_the_plane() -> None:
    arrays = flat_arrays(700.0, noise_mm=0.05)
    arrays["points_mm"][2, 20, 20] += 0.15
    found = find_target(arrays["points_mm"], arrays["flags"])
    assert found.residual_mm[20, 20] > 0.05


def test_errors_of_scale_show_only_where_the_slope_is_fixed() -> None:
    targets = [target(1.002 * position, seed=i) for i, position in enumerate(POSITIONS)]
    found = stage_test(POSITIONS, targets)
    assert found.free.scale == pytest.approx(1.002, abs=4 * found.free.scale_std)
    assert found.free.scale_std < 2e-4
    assert found.free.rms_mm < 0.02
    assert found.fixed.scale == 1.0
    assert found.fixed.rms_mm == pytest.approx(0.002 * np.std(POSITIONS), rel=0.1)
    assert found.fixed.worst_mm > found.fixed.rms_mm
    leans = LEAN * np.mean([each.middle_mm[0] for each in targets])
    assert found.fixed.offset_mm == pytest.approx(0.002 * np.mean(POSITIONS) + leans, abs=0.05)
    assert found.pixel_rms_mm == pytest.approx(0.1, rel=0.1)
    assert found.patch_rms_mm is not None
    assert found.free.rms_mm < found.patch_rms_mm < found.pixel_rms_mm


def test_one_position_off_the_line_is_the_worst() -> None:
    targets = [target(position, bend_mm=0.5 * (i == 3)) for i, position in enumerate(POSITIONS)]
    found = stage_test(POSITIONS, targets)
    assert int(np.argmax(np.abs(found.free.deviations_mm))) == 3
    assert found.free.worst_mm == pytest.approx(0.5, rel=0.25)
    rows = {row.figure: row for row in stage_table(found)}
    worst = rows["Worst deviation, slope free"]
    assert float(worst.value) == pytest.approx(found.free.worst_mm, abs=1e-4)
    assert found.free.worst_std_mm == found.std_mm[3]
    assert "±" in worst.words
    assert "±" in rows["Slope of distance over position"].words
    assert rows["Positions"].value == "8"


def test_deviations_of_straightness_are_those_of_many_repeats() -> None:
    def repeat(seed: int) -> StageTest:
        rng = np.random.default_rng(seed)
        off_mm = rng.normal(0.0, 0.3, len(POSITIONS))
        targets = [
            target(position + off, noise_mm=0.1, seed=100 * seed + i)
            for i, (position, off) in enumerate(zip(POSITIONS, off_mm, strict=True))
        ]
        return stage_test(POSITIONS, targets)

    found = [repeat(seed) for seed in range(30)]
    for lines in ([test.free for test in found], [test.fixed for test in found]):
        spread = np.std([line.rms_mm for line in lines], ddof=1)
        assert np.mean([line.rms_std_mm for line in lines]) == pytest.approx(spread, rel=0.35)
    pixels = np.std([test.pixel_rms_mm for test in found], ddof=1)
    assert np.mean([test.pixel_rms_std_mm or 0.0 for test in found]) == pytest.approx(pixels, rel=0.5)


def test_three_points_that_lie_straight_by_chance_are_no_surer_than_their_planes() -> None:
    # The same noise three times: the distances lie on a line to the last digit.
    targets = [target(position, noise_mm=0.5) for position in (700.0, 700.0, 700.0)]
    found = stage_test((700.0, 720.0, 740.0), targets)
    assert found.free.rms_mm < 1e-6
    assert found.free.offset_std_mm == pytest.approx(found.std_mm[0] / np.sqrt(3))


def test_a_region_is_all_that_counts() -> None:
    found = target(700.0, region=(10, 6, 24, 20))
    known = np.argwhere(np.isfinite(found.residual_mm))
    assert known.min(axis=0).tolist() == [6, 10]
    assert known.max(axis=0).tolist() == [25, 33]
    assert found.left_out < 3
    with pytest.raises(DecodeError, match="is not inside the picture of 48 x 36 px"):
        target(700.0, region=(30, 0, 24, 20))
    points = flat_arrays(700.0)["points_mm"]
    points[:, 8:], points[:, :, 12:] = np.nan, np.nan
    with pytest.raises(DecodeError, match="visible in 2 of 48 patches"):
        find_target(points)


def test_what_cannot_be_tested_is_refused_in_a_sentence() -> None:
    three = [target(position) for position in (700.0, 720.0, 740.0)]
    with pytest.raises(DecodeError, match="needs 3 positions of the stage to be tested, there are 2"):
        stage_test((700.0, 720.0), three[:2])
    with pytest.raises(DecodeError, match="All positions of the stage are 700 mm"):
        stage_test((700.0, 700.0, 700.0), three)
    with pytest.raises(DecodeError, match="is not a number"):
        stage_test((700.0, float("nan"), 740.0), three)
    with pytest.raises(DecodeError, match="3 results and 2 positions"):
        stage_test((700.0, 720.0), three)
    half = flat_arrays(760.0)
    smaller = find_target(half["points_mm"][:, :, :40])
    with pytest.raises(DecodeError, match="40 x 36 and 48 x 36 pixels"):
        stage_test((700.0, 720.0, 760.0), [*three[:2], smaller])
    nothing = flat_arrays(700.0)
    with pytest.raises(DecodeError, match="has no depth"):
        find_target(np.full_like(nothing["points_mm"], np.nan))
    with pytest.raises(DecodeError, match="are limited"):
        find_target(nothing["points_mm"], np.full(SHAPE, 16, np.uint16))
