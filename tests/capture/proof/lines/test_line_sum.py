"""All lines of a setting together are white; where they are not, a projector dims some pictures."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.lines.line_sum import LineSum, line_sum
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.prediction import Lit
from dsl_core.capture.proof.raster import Counts
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Sentinels, Setting, SpectralSet
from dsl_core.model.rig import Sensor

PIXELS, BLACK, WHITE = 200, 300.0, 2000.0


def plan(spectral: SpectralSet | None = None, every: int | None = None) -> CapturePlan:
    return CapturePlan(
        camera_size_px=(20, 10),
        projector_size_px=(64, 18),
        code=GrayCode(rows=False),
        spectral=spectral or ScanLines(width_px=2, step_px=2),
        settings=(Setting(exposure_ms=10.0, level=1.0),),
        code_settings=(0,),
        sentinels=None if every is None else Sentinels(every=every),
    )


def total(plan: CapturePlan, lines: float = 1.0, drift: float = 0.0, black_dn: float = 0.0) -> LineSum | None:
    """Of lines with so many times their light; all light falls and black rises steadily to the end."""
    rng, kept = np.random.default_rng(7), dict[int, Counts]()
    for shot in plan.shots():
        role = plan.original(shot).role
        share = {"white": 1.0, "spectral": lines * 2 / 64, "code": 0.5, "black": 0.0}[role]
        since = max(shot.index - 14, 0) / plan.shot_count
        light = (WHITE * share) * (1 - drift * since) + BLACK + black_dn * since
        kept[shot.index] = np.rint(light + rng.normal(0, 2, PIXELS)).astype(np.uint16)
    at = np.arange(PIXELS)
    black, white, ones = (np.full(PIXELS, np.float32(each)) for each in (BLACK, WHITE, 1))
    return line_sum(plan, 0, kept, Lit(at, at, black, white, ones), Noise.of(Sensor(), 12))


def share(plan: CapturePlan, lines: float = 1.0, drift: float = 0.0, black_dn: float = 0.0) -> float:
    found = total(plan, lines, drift, black_dn)
    assert found is not None
    return found.share


@pytest.mark.parametrize(("lines", "is_told"), [(1.0, False), (1.02, False), (0.8, True), (1.25, True)])
def test_lines_with_another_share_of_the_light_than_white_are_told(lines: float, is_told: bool) -> None:
    found = total(plan(), lines)
    assert found is not None
    assert found.share == pytest.approx(lines, abs=0.01)
    assert found.is_off is is_told


def test_lines_that_a_dynamic_iris_dims_by_a_twelfth_are_told() -> None:
    dimmed, sound = total(plan(every=8), 0.92), total(plan(every=8))
    assert dimmed is not None
    assert sound is not None
    assert dimmed.is_off
    assert abs(sound.share - 1) < sound.allowed / 5


def test_what_white_and_black_show_when_taken_once_more_is_taken_off() -> None:
    assert share(plan(), drift=0.3) < 0.9
    assert share(plan(every=8), drift=0.3) == pytest.approx(1, abs=0.01)
    assert share(plan(), black_dn=10.0) > 1.05
    assert share(plan(every=8), black_dn=10.0) == pytest.approx(1, abs=0.01)


def test_without_black_taken_once_more_less_is_told() -> None:
    alone, watched = total(plan()), total(plan(every=8))
    assert alone is not None
    assert watched is not None
    assert alone.allowed - watched.allowed == pytest.approx(0.9 * 32 / WHITE, abs=0.004)


def test_a_lamp_that_came_on_at_some_time_between_two_blacks_is_no_light_of_the_lines() -> None:
    found, usual = total(plan(every=40), black_dn=40.0), total(plan(every=40))
    assert found is not None
    assert usual is not None
    assert found.allowed > usual.allowed + 0.5 * 20 * 32 / WHITE
    assert not found.is_off


def test_lines_that_leave_columns_out_say_nothing() -> None:
    assert total(plan(ScanLines(width_px=2, step_px=4, sparse=True))) is None
    assert total(plan(LineComb(width_px=2, step_px=2, period_px=16))) is not None
