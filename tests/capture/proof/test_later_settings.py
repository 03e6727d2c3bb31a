"""Pictures of a later setting follow from those of the first, by the plan or by what has been measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.capture.proof.later_settings import LaterSettings
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Counts
from dsl_core.simulation.published_rig import published_rig
from tests.cases.proof_rules import PLAN, SHOTS

LINE, LATER_BLACK, LATER_LINE = SHOTS[13], SHOTS[27], SHOTS[29]
RIG = published_rig()
NOISE = Noise(RIG.sensor)
LEVEL_DN, FULL_DN = round(RIG.sensor.black_level_dn), RIG.sensor.full_scale_dn


def counts(value: int) -> Counts:
    return np.full(4, value, np.uint16)


def later(kept: dict[int, Counts] | None = None, is_calibrated: bool = True) -> LaterSettings:
    return LaterSettings(PLAN, 0, RIG if is_calibrated else None, NOISE, {} if kept is None else kept)


def test_a_picture_that_the_first_setting_lacks_is_not_known() -> None:
    known = later({index: counts(index) for index in range(16)})
    assert known.earlier(LATER_LINE) is not None
    assert known.earlier(replace(SHOTS[0], pattern=99)) is None


def test_light_of_a_setting_is_that_of_its_exposure_and_level_until_it_is_measured() -> None:
    radiance = RIG.projector_response.radiance
    ratio = (radiance(0.5) - radiance(0.0)) / (radiance(1.0) - radiance(0.0))
    known = later()
    assert known.scale(LATER_LINE) == pytest.approx(3 * float(ratio))
    assert known.scale(LINE) == pytest.approx(1.0)
    assert later(is_calibrated=False).scale(LATER_LINE) == pytest.approx(3 * 0.5**2.2)
    assert not known.is_measured(LATER_LINE)
    known.measure(LATER_LINE, 1.25)
    assert known.scale(LATER_LINE) == pytest.approx(1.25 * 3 * float(ratio))
    assert (known.is_measured(LATER_LINE), known.is_measured(LINE)) == (True, False)


@pytest.mark.parametrize(
    ("old_dn", "is_calibrated", "wanted_dn"),
    [
        (LEVEL_DN + 7, True, LEVEL_DN + 21),
        (FULL_DN, True, FULL_DN),
        (LEVEL_DN + 7, False, LEVEL_DN + 7),  # nobody knows how much of it is light
    ],
)
def test_black_follows_from_the_first_by_the_exposure_until_it_is_taken(
    old_dn: int, is_calibrated: bool, wanted_dn: int
) -> None:
    kept = {11: counts(old_dn)}
    known = later(kept, is_calibrated)
    black = known.black(LATER_LINE)
    assert black is not None
    assert black.counts == pytest.approx(np.full(4, RIG.sensor.black_level_dn + wanted_dn - LEVEL_DN), abs=1)
    assert black.variance.tolist() == NOISE.variance(counts(old_dn)).tolist()
    kept[27] = counts(333)
    taken, itself = known.black(LATER_LINE), known.black(LATER_BLACK)
    assert taken is not None
    assert itself is not None
    assert taken.counts.tolist() == [333.0] * 4
    assert itself.counts.tolist() == black.counts.tolist(), "a black is not compared with itself"


def test_nothing_is_expected_of_what_was_not_seen_at_the_first_setting() -> None:
    kept: dict[int, Counts] = {}
    known = later(kept)
    assert known.black(LATER_LINE) is None
    kept[13] = counts(900)
    assert known.expected(LATER_LINE, LATER_LINE) is None, "black is missing"
    kept[11], kept[27] = counts(300), counts(310)
    assert known.white(LATER_LINE) is None
    known.measure(LATER_LINE, 0.5 / known.scale(LATER_LINE))
    found = known.expected(LATER_LINE, LATER_LINE)
    assert found is not None
    assert found.counts.tolist() == [310 + 0.5 * 600] * 4
    brighter = LaterSettings(
        PLAN, 0, RIG, NOISE, kept, lambda shot, seen: np.float32(shot.pattern * seen[0] / 9)
    )
    brighter.measure(LATER_LINE, 0.5 / brighter.scale(LATER_LINE))
    without = brighter.expected(LATER_LINE, LATER_LINE)
    assert without is not None
    assert without.counts.tolist() == [310 + 0.5 * (600 - 100)] * 4, (
        "what black had gained in the old picture"
    )
    dimmer = LaterSettings(PLAN, 0, RIG, NOISE, kept, level=lambda shot: 0.8 if shot.index == 13 else 1.0)
    dimmer.measure(LATER_LINE, 0.5 / dimmer.scale(LATER_LINE))
    in_usual_light = dimmer.expected(SHOTS[13], LATER_LINE)
    assert in_usual_light is not None
    assert in_usual_light.counts.tolist() == [310 + 0.5 * 600 / 0.8] * 4, "the old picture had less light"
    kept[10] = counts(1300)
    white = known.white(LATER_LINE)
    assert white is not None
    assert white.counts.tolist() == [310 + 0.5 * 1000] * 4
    assert known.earlier(LATER_LINE) is kept[13]
