"""The reconstructions that follow scans, while others still run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
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


def test_depth_of_the_scan_that_was_started_last_is_shown_and_no_other(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def see(
        target: Path, session: Path, *_: object, seen_geometry: Callable[[Any], None], **__: object
    ) -> Path:
        seen_geometry({"depth_mm": np.full((2, 2), float(session.stem == "b"))})
        made.take_news()
        shown.append(state.depth.value)
        return target

    monkeypatch.setattr(scans, "reconstruct_to", see)
    state, runner = ScanState(CapturePlan(), tmp_path / "a.dsl"), ManualRunner()
    made, shown = Reconstructor(state, runner, RecordingNotifier(), Pace()), list[Any]()
    for name in ("a", "b"):
        made.start(tmp_path / f"{name}.dsl")
    runner.run_next()
    runner.run_next()
    of_a, of_b = shown
    assert of_a is None
    assert of_b.tolist() == [[1.0, 1.0], [1.0, 1.0]]
    assert state.depth.value is None
    made.close()
