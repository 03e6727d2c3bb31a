from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.plan import CapturePlan, Setting, Shot
from dsl_core.reconstruction.merge import Exposed, MergedScan, check_source
from tests.cases.small_rig import small_rig


class Source:
    """A scan of which only the plan is asked for."""

    def __init__(self, **sizes: tuple[int, int]) -> None:
        self.plan = CapturePlan().model_copy(update=sizes)

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        raise NotImplementedError


def test_a_calibration_for_another_size_is_refused_with_both_sizes() -> None:
    rig, source = small_rig(), Source()
    assert check_source(source, rig) is source.plan
    with pytest.raises(DecodeError, match=r"camera of 445 x 290 pixels.* 'small' is for 890 x 580"):
        check_source(Source(camera_size_px=(445, 290)), rig)
    with pytest.raises(DecodeError, match=r"projector of 1024 x 768 pixels.* is for 640 x 360"):
        check_source(Source(projector_size_px=(1024, 768)), rig)


class Flat:
    """Pictures of one count each, by their shot."""

    plan = CapturePlan(
        camera_size_px=(8, 6), settings=(Setting(exposure_ms=10, level=1), Setting(exposure_ms=40, level=1))
    )

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        black = round(SENSOR.black_level_dn)
        return np.full(
            (6, 8), black + (0 if shot.role == "black" else 5 * round(shot.exposure_ms)), np.uint16
        )


SENSOR = small_rig().sensor


@pytest.mark.parametrize("compares", [True, False])
def test_settings_of_a_pattern_are_compared_as_it_is_merged(
    compares: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = list[tuple[int, list[float]]]()

    def noted(raws: list[Any], blacks: list[Any], gains: list[float], sensor: object) -> tuple[None, ...]:
        asked.append((len(raws), gains))
        assert len(blacks) == len(raws)
        return (None,) * len(raws)

    monkeypatch.setattr("dsl_core.reconstruction.merge.compare_settings", noted)
    merged = MergedScan(Flat(), small_rig(), compares=compares)
    found = merged.merge("white", 0)
    assert float(np.median(found.radiance)) == pytest.approx(5.0, rel=1e-3)
    assert [count for count, _ in asked] == [2] * compares
    assert all(gains == merged.gains_ms.tolist() for _, gains in asked)
    assert set(merged.ratios) == ({("white", 0)} if compares else set())


def test_a_pattern_of_one_setting_is_compared_with_nothing() -> None:
    merged = MergedScan(Flat(), small_rig())
    merged._shots["white", 0] = merged._shots["white", 0][1:]
    assert float(np.median(merged.merge("white", 0).radiance)) == pytest.approx(5.0, rel=1e-3)
    assert merged.ratios == {}


def test_light_of_a_shot_that_was_too_strong_is_divided_out() -> None:
    levels = np.ones(Flat.plan.shot_count)
    for shot in Flat.plan.shots():
        levels[shot.index] = 1.25 if shot.role == "white" else 1.0
    merged = MergedScan(Flat(), small_rig(), Exposed(levels, 0 * levels, 0 * levels))
    assert float(np.median(merged.merge("white", 0).radiance)) == pytest.approx(4.0, rel=1e-3)


def test_black_that_a_shot_has_gained_is_taken_off() -> None:
    gained = np.zeros(Flat.plan.shot_count)
    usual = MergedScan(Flat(), small_rig())
    for shot in Flat.plan.shots():
        gained[shot.index] = 10.0 * (1 + shot.setting) if shot.role == "white" else 0.0
    light, black = usual.merge("white", 0), gained[[shot.index for shot in usual.shots_of("white", 0)]]
    merged = MergedScan(Flat(), small_rig(), Exposed(np.ones_like(gained), gained, 0 * gained)).merge(
        "white", 0
    )
    less, apart = light.radiance - merged.radiance, black / usual.gains_ms
    assert 0.99 * apart.min() < less.min() <= less.max() < 1.01 * apart.max()
