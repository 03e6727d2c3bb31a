"""Light of the room that comes or goes during pictures of a target is refused, noise is not."""

from __future__ import annotations

import pytest

from dsl_core.calibration.common.room_light import light_change_figure


@pytest.mark.parametrize(
    ("change", "std", "passed"),
    [(0.0015, 1e-5, True), (0.0025, 1e-5, False), (-0.0025, 1e-5, False), (0.0025, 0.001, True)],
)
def test_a_change_is_judged_by_white_and_by_its_noise(change: float, std: float, passed: bool) -> None:
    (figure,) = light_change_figure((change, std))
    assert figure.passed is passed
    assert figure.value == pytest.approx(100 * change)


def test_captures_without_black_at_their_end_are_not_judged() -> None:
    assert light_change_figure(None) == ()
