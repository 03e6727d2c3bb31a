"""What a person asks for belongs to the step that was shown then."""

from __future__ import annotations

import pytest
from dsl_app.calibrate.wizard.state import Doing

from tests.app.calibrate.calibrate_bench import CalibrateBench, page


@pytest.mark.parametrize(
    ("moves_on", "captured"), [(False, ["captured", "missing"]), (True, ["missing"] * 2)]
)
def test_a_capture_that_waits_for_a_look_is_of_the_step_it_was_asked_for(
    bench: CalibrateBench, moves_on: bool, captured: list[str]
) -> None:
    state, control = bench.wizard("selftest")

    def press(doing: Doing) -> None:
        if doing is Doing.LOOKING:
            control.capture()
            if moves_on:
                control.go_to(2)

    stop = state.doing.changed.connect(press)
    control.check(True)
    stop()
    assert [each.state for each in state.statuses.value] == captured
    assert page(state) == 2
