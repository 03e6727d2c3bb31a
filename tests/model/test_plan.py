import numpy as np
import pytest
from pydantic import ValidationError

from dsl_core.model.plan import CapturePlan, GrayCode, NoCode, NoSpectral, Sentinels, Setting
from dsl_core.patterns.images import pattern_image


def test_sentinels_repeat_old_shots_at_even_intervals_and_at_the_end() -> None:
    plan = CapturePlan(sentinels=Sentinels())
    shots = list(plan.shots())
    assert [shot.index for shot in shots] == list(range(plan.shot_count))
    again = [shot for shot in shots if shot.role == "sentinel"]
    assert len(again) == plan.sentinel_count <= 0.05 * CapturePlan().shot_count
    assert again[-1] == shots[-1]
    for shot in again:
        old = plan.original(shot)
        assert old.index < shot.index
        assert old.role != "sentinel"
        assert (old.setting, old.exposure_ms, old.level) == (shot.setting, shot.exposure_ms, shot.level)
        assert np.array_equal(pattern_image(plan, old), pattern_image(plan, shot))
    last = {plan.original(shot).role for shot in shots[-4:]}
    assert last == {"white", "black", "code", "spectral"}


def test_small_plans_and_plans_without_a_code_have_sentinels_at_the_end() -> None:
    small = CapturePlan(
        spectral=NoSpectral(), code=GrayCode(rows=False), code_settings=(0,), sentinels=Sentinels()
    )
    assert [small.original(shot).role for shot in list(small.shots())[-3:]] == ["white", "black", "code"]
    bare = CapturePlan(code=NoCode(), sentinels=Sentinels(every=1000))
    assert [bare.original(shot).role for shot in list(bare.shots())[-2:]] == ["black", "spectral"]


def test_plans_of_earlier_versions_have_no_sentinels() -> None:
    old = CapturePlan.model_validate_json(CapturePlan().model_dump_json(exclude={"sentinels"}))
    assert old == CapturePlan()
    assert old.sentinel_count == 0


@pytest.mark.parametrize(("level", "is_light"), [(0.001, False), (0.0019, False), (0.002, True), (1.0, True)])
def test_a_level_that_no_projector_can_show_is_refused(level: float, is_light: bool) -> None:
    if is_light:
        assert Setting(exposure_ms=100.0, level=level).level == level
        return
    with pytest.raises(ValidationError, match="rounds to drive 0 of 255"):
        Setting(exposure_ms=100.0, level=level)
