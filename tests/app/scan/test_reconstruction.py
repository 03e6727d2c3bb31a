"""The reconstructions that follow scans, while others still run."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsl_app.scan.reconstruction import Reconstructor
from dsl_app.scan.reconstruction_time import Pace
from dsl_app.scan.state import ScanState

from dsl_core.model.plan import CapturePlan
from dsl_core.workflows import scans
from tests.app.support.doubles import ManualRunner, RecordingNotifier


@pytest.mark.parametrize("is_cancelled", [False, True])
def test_the_first_of_two_that_ends_leaves_the_other_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_cancelled: bool
) -> None:
    monkeypatch.setattr(scans, "reconstruct_to", lambda target, *_, **__: target)
    state, runner = ScanState(CapturePlan(), tmp_path / "a.dsl"), ManualRunner()
    made = Reconstructor(state, runner, RecordingNotifier(), Pace())
    for name in ("a", "b"):
        state.note.set(f"All frames of {name} are saved.")
        made.start(tmp_path / f"{name}.dsl")
    if is_cancelled:
        runner.waiting[0].cancel()
    running: list[bool] = []
    state.is_reconstructing.follow(running.append)
    runner.run_next()
    assert running == [True]
    assert state.note.value.startswith("All frames of b are saved. Reconstructing")
    runner.run_next()
    assert running == [True, False]
    assert state.note.value == f"The result is saved in {tmp_path / 'b.zarr'}."
    made.close()
