"""Lines add up to white in every part of a picture; where they do not, a shadow or other light came in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.lines.local_sum import LocalSum, local_sum
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts, Raster
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Sentinels, Setting, SpectralSet
from dsl_core.model.rig import Sensor
from dsl_core.patterns.multiplexed import profile

WIDE, HIGH, BLACK, WHITE = 96, 24, 300.0, 1500.0
#: What a picture of shot ``index`` shows at given places (shares of rows and columns), given its light.
Scene = Callable[[int, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def plan(every: int | None = None, spectral: SpectralSet | None = None) -> CapturePlan:
    return CapturePlan(
        camera_size_px=(WIDE, HIGH),
        projector_size_px=(WIDE, 18),
        code=GrayCode(rows=False),
        spectral=spectral or ScanLines(width_px=2, step_px=2),
        settings=(Setting(exposure_ms=10.0, level=1.0),),
        code_settings=(0,),
        sentinels=None if every is None else Sentinels(every=every),
    )


def found(scene: Scene, every: int | None = None, spectral: SpectralSet | None = None) -> LocalSum | None:
    """Of a scene where each column of the camera sees that of the projector."""
    wanted, rng, kept = plan(every, spectral), np.random.default_rng(5), dict[int, Counts]()
    raster = Raster((WIDE, HIGH))
    column = np.tile(np.arange(WIDE), HIGH)
    down, across = np.repeat(np.arange(HIGH), WIDE) / HIGH, column / WIDE
    for shot in wanted.shots():
        first = wanted.original(shot)
        role = first.role
        line = np.ones(column.size)
        if role == "spectral":
            line = profile(wanted.spectral, WIDE, first.pattern)[column, 1]
        light = WHITE * {"white": 1.0, "black": 0.0, "code": 0.5, "spectral": 1.0}[role] * line
        light = scene(shot.index, light, down, across)
        kept[shot.index] = np.rint(light + BLACK + rng.normal(0, 1.5, column.size)).astype(np.uint16)
    black, white = np.full(column.size, np.float32(BLACK)), np.full(column.size, np.float32(WHITE))
    lit = Lit(np.arange(column.size), (3 * column).astype(np.intp), black, white, np.ones_like(black))
    return local_sum(wanted, 0, kept, lit, Noise.of(Sensor(), 12), raster)


def test_a_shadow_on_some_rows_of_some_lines_is_told_with_its_frames() -> None:
    def shadow(
        at: int, light: NDArray[np.float64], down: NDArray[np.float64], _: object
    ) -> NDArray[np.float64]:
        return light * np.where((40 <= at < 52) & (down < 0.5), 0.8, 1.0)

    seen = found(shadow)
    assert seen is not None
    assert seen.share == pytest.approx(0.8, abs=0.02)
    assert not seen.all_rows
    assert 38 <= seen.shots[0].index <= 44
    assert 48 <= seen.shots[1].index <= 54
    first, last = (shot.index + 1 for shot in seen.shots)
    assert f"In parts of the picture, lines between frame {first} and frame {last} have" in seen.sentence


def test_lines_that_are_dim_in_all_rows_are_of_a_projector_that_dims() -> None:
    seen = found(lambda at, light, *_: light * (0.8 if 40 <= at < 52 else 1.0))
    assert seen is not None
    assert seen.all_rows
    assert seen.sentence.startswith(f"Lines between frame {seen.shots[0].index + 1} and frame ")
    assert "the light of the projector changed for them (eco mode" in seen.sentence


@pytest.mark.parametrize(("share", "is_told"), [(0.92, True), (1.08, True), (0.96, False)])
def test_little_is_told_where_all_rows_of_several_parts_beside_each_other_have_it(
    share: float, is_told: bool
) -> None:
    """Haze, or the last lines of a lamp that dims; less than a single part has to have."""
    seen = found(lambda at, light, *_: light * (share if 40 <= at < 52 else 1.0))
    assert (seen is not None) == is_told
    if seen is not None:
        assert seen.share == pytest.approx(share, abs=0.02)
        assert seen.all_rows
        assert 38 <= seen.shots[0].index <= 44
        assert 48 <= seen.shots[1].index <= 54


def test_little_is_not_told_of_one_part_nor_of_some_that_differ_both_ways() -> None:
    assert found(lambda at, light, *_: light * (0.92 if 45 <= at < 47 else 1.0)) is None
    assert found(lambda at, light, *_: light * (1 + 0.08 * (-1) ** (at // 2))) is None


@pytest.mark.parametrize(("light_of_lines", "is_told"), [(0.88, True), (0.94, False)])
def test_a_few_lines_that_lie_in_two_parts_are_told_by_both_together(
    light_of_lines: float, is_told: bool
) -> None:
    """A kettle takes some light from the mains now and then; neither part has lost enough to tell."""
    seen = found(lambda at, light, *_: light * (light_of_lines if 36 <= at < 38 else 1.0))
    assert (seen is not None) == is_told


def test_more_is_told_of_one_part_alone() -> None:
    """The last few lines of a small picture, for which a lamp dims, light no more than that."""
    seen = found(lambda at, light, *_: light * (0.85 if 45 <= at < 47 else 1.0))
    assert seen is not None
    assert seen.all_rows
    assert seen.share == pytest.approx(0.85, abs=0.03)


def test_frames_are_named_where_several_lines_are_shown_at_once() -> None:
    def shadow(
        at: int, light: NDArray[np.float64], down: NDArray[np.float64], _: object
    ) -> NDArray[np.float64]:
        return light * np.where((at in (18, 19)) & (down < 0.5), 0.7, 1.0)

    seen = found(shadow, spectral=LineComb(width_px=2, step_px=2, period_px=24))
    assert seen is not None
    # Parts have whole columns, of the lines before and after as well.
    assert (seen.shots[0].index, seen.shots[1].index) == (17, 20)


@pytest.mark.parametrize("share", [1.0, 0.97, 0.7])
def test_lines_that_are_dimmer_everywhere_are_of_no_part(share: float) -> None:
    assert found(lambda at, light, *_: light * (share if at > 15 else 1.0)) is None


def test_light_of_the_room_that_came_on_for_a_few_lines_is_told() -> None:
    def door(
        at: int, light: NDArray[np.float64], _: object, across: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return light + (60.0 * (1 - across) if 30 <= at < 42 else 0.0)

    assert found(door) is not None
    # All pixels alike: that is seen by the light of all lines together.
    assert found(lambda at, light, *_: light + (5.0 if at > 15 else 0.0)) is None


def test_light_that_white_shows_to_have_drifted_is_no_shadow() -> None:
    def drift(at: int, light: NDArray[np.float64], *_: object) -> NDArray[np.float64]:
        return light * (1 - 0.4 * max(at - 14, 0) / 60)

    assert found(drift) is not None
    assert found(drift, every=8) is None


@pytest.mark.parametrize("all_rows", [True, False])
@pytest.mark.parametrize(("share", "is_room"), [(-0.67, True), (-0.1, False), (0.67, False)])
def test_less_light_than_none_is_no_projector_that_dims(share: float, is_room: bool, all_rows: bool) -> None:
    """Sun that went while lines were captured was told as an eco mode of the projector."""
    shots = list(plan().shots())
    said = LocalSum(share, 0.1, (shots[-9], shots[-5]), all_rows).sentence
    assert ("less than none" in said and "light of the room (sun, lamps)" in said) == is_room
    assert ("eco mode" in said) == (all_rows and not is_room)
