"""Which saved shots are captured again when a later one turns out to be wrong."""

from __future__ import annotations

from dsl_core.capture.proven.doubted import JUST_BEFORE, DoubtedShots
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb

PLAN = CapturePlan(
    camera_size_px=(32, 18),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=1, step_px=1, period_px=64),
)
SHOTS = tuple(PLAN.shots())


def test_the_last_ones_are_doubted_and_those_that_nothing_told() -> None:
    doubted = DoubtedShots()
    for shot in SHOTS[:30]:
        doubted.add(shot, is_untold=shot.index == 3)
    wrong = SHOTS[40]
    last = [shot.index for shot in SHOTS[30 - JUST_BEFORE : 30]]
    assert [shot.index for shot in doubted.withdraw([wrong], has_changed=False)] == [3, *last, 40]
    assert doubted.withdraw([], has_changed=True) == []


def test_after_a_sure_picture_only_those_just_before_are_doubted() -> None:
    doubted = DoubtedShots()
    for shot in SHOTS[:20]:
        doubted.add(shot, is_untold=True)
    doubted.trust_untold()
    assert len(doubted.withdraw([], has_changed=False)) == JUST_BEFORE
    doubted.doubt_passed()
    assert doubted.untold == list(SHOTS[:20])


def test_a_change_takes_back_what_was_saved_since_all_was_sound() -> None:
    doubted = DoubtedShots()
    for shot in SHOTS[:4]:
        doubted.add_code(shot)
    assert doubted.withdraw([], has_changed=True) == list(SHOTS[:4])
    doubted.add_code(SHOTS[0])
    for shot in SHOTS[10:14]:
        doubted.add_alone(shot)
    assert doubted.withdraw([], has_changed=True) == list(SHOTS[10:14])
    doubted.add_alone(SHOTS[10])
    doubted.settle_all()
    assert doubted.withdraw([], has_changed=True) == []


def test_a_sound_control_settles_the_last_ones() -> None:
    doubted = DoubtedShots()
    doubted.add(SHOTS[0], is_untold=False)
    doubted.settle_recent()
    assert doubted.withdraw([], has_changed=False) == []
