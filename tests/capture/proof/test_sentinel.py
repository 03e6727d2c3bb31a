"""Sentinels of a scan: believed where they show their pattern, taken again where they do not."""

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.capture.proof.sentinel import REFUSALS, SentinelProof
from dsl_core.model.plan import Shot

SIZE = (48, 40)
RASTER = Raster(SIZE)
CHANNELS = RASTER.channels("RGGB")
SHOT = Shot(90, "sentinel", 20, 0, 10.0, 1.0)


@pytest.fixture
def pictures() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    light = rng.uniform(300, 1500, SIZE[0] * SIZE[1])
    line = np.where(np.arange(light.size) % SIZE[0] // 8 == 2, light, 0.0)
    noisy = {name: rng.poisson(at) + 60 for name, at in (("white", light), ("again", light), ("line", line))}
    noisy["black"] = rng.poisson(np.full(light.size, 4.0)) + 60
    found = {name: picture.astype(np.uint16) for name, picture in noisy.items()}
    for picture in found.values():
        picture.flags.writeable = False  # as those of a scan
    return found


def judge(pictures: dict[str, np.ndarray], seen: np.ndarray, proof: SentinelProof) -> Verdict:
    rivals = [pictures["line"], pictures["black"]]
    return proof.judge(SHOT, seen, pictures["white"], pictures["black"], rivals).verdict


def test_a_repeat_is_believed_even_if_the_light_has_changed(pictures: dict[str, np.ndarray]) -> None:
    proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
    assert judge(pictures, pictures["again"], proof) is Verdict.RIGHT
    assert judge(pictures, (0.85 * pictures["again"]).astype(np.uint16), proof) is Verdict.RIGHT


def test_another_picture_is_named_and_refused_a_few_times_only(pictures: dict[str, np.ndarray]) -> None:
    proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
    for _ in range(REFUSALS):
        assert judge(pictures, pictures["line"], proof) is Verdict.LATE
    assert judge(pictures, pictures["line"], proof) is Verdict.UNTOLD
    torn = np.concatenate([pictures["again"][:800], pictures["black"][800:]])
    other = replace(SHOT, index=91)
    found = proof.judge(other, torn, pictures["white"], pictures["black"], [pictures["black"]])
    assert found.again == (other,)


def test_saturated_pixels_do_not_hide_that_a_picture_is_blended(pictures: dict[str, np.ndarray]) -> None:
    full = Noise.of(None, 12).sensor.full_scale_dn
    bright = np.arange(SIZE[0] * SIZE[1]) < 1600
    white = np.where(bright, full, pictures["white"]).astype(np.uint16)
    # Of twice full scale, six tenths saturate as well.
    mixed = np.where(bright, full, 0.6 * pictures["white"] + 0.4 * pictures["black"]).astype(np.uint16)
    proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
    found = proof.judge(SHOT, mixed, white, pictures["black"], [pictures["black"]])
    assert found.verdict is Verdict.TORN
    found = proof.judge(SHOT, white, white, pictures["black"], [pictures["black"]])
    assert found.verdict is Verdict.RIGHT


@pytest.mark.parametrize("role", ["white", "black"])
def test_a_picture_that_is_blended_with_the_one_before_is_refused(
    pictures: dict[str, np.ndarray], role: str
) -> None:
    other = pictures["black" if role == "white" else "again"]
    for share, verdict in ((0.4, Verdict.TORN), (0.1, Verdict.RIGHT)):
        mixed = ((1 - share) * pictures[role] + share * other).astype(np.uint16)
        proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
        found = proof.judge(SHOT, mixed, pictures[role], pictures["black"], [other])
        assert found.verdict is verdict


def test_stale_rows_in_the_middle_are_refused(pictures: dict[str, np.ndarray]) -> None:
    again, line = pictures["again"], pictures["line"]
    stale = np.concatenate([again[:960], line[960:1200], again[1200:]])
    assert judge(pictures, stale, SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)) is Verdict.TORN


def test_nothing_is_said_without_the_picture_of_before(pictures: dict[str, np.ndarray]) -> None:
    proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
    found = proof.judge(SHOT, pictures["line"], None, pictures["black"], [])
    assert found.verdict is Verdict.UNTOLD


def test_a_sentinel_is_right_only_where_a_rival_can_be_told_apart(pictures: dict[str, np.ndarray]) -> None:
    proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
    white, black = pictures["white"], pictures["black"]
    assert proof.judge(SHOT, pictures["again"], white, black, []).verdict is Verdict.UNTOLD
    assert proof.judge(SHOT, pictures["again"], white, black, [white]).verdict is Verdict.UNTOLD
    assert proof.judge(SHOT, pictures["again"], white, black, [white, black]).verdict is Verdict.RIGHT
    assert proof.judge(SHOT, black, white, black, [white, black]).verdict is Verdict.OTHER


def test_two_takes_are_refused_and_the_third_is_believed(pictures: dict[str, np.ndarray]) -> None:
    proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
    found = [judge(pictures, pictures["line"], proof) for _ in range(4)]
    assert found == [Verdict.LATE, Verdict.LATE, Verdict.UNTOLD, Verdict.UNTOLD]


@pytest.mark.parametrize(("late", "colour"), [(0, "red"), (2, "blue")])
def test_a_colour_that_is_of_the_picture_before_is_refused(
    pictures: dict[str, np.ndarray], late: int, colour: str
) -> None:
    proof = SentinelProof(Noise.of(None, 12), RASTER, CHANNELS)
    seen = np.where(late == CHANNELS, pictures["line"], pictures["again"])
    rivals = [pictures["line"], pictures["black"]]
    found = proof.judge(SHOT, seen, pictures["white"], pictures["black"], rivals)
    assert (found.colour, found.again, found.detail) == (
        colour,
        (SHOT,),
        f"its {colour} was that of another pattern",
    )
    # Half of its light is gone: the white balance has changed.
    half = (np.where(late == CHANNELS, 0.6, 1) * pictures["again"]).astype(np.uint16)
    assert not proof.judge(replace(SHOT, index=91), half, pictures["white"], pictures["black"], rivals).colour
