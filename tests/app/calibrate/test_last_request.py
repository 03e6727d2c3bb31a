"""What was asked for last is what counts, whichever of several jobs ends last."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.simulation.published_rig import published_rig
from tests.app.calibrate.calibrate_bench import CalibrateBench, calibrate, make_bench, states, with_a_campaign
from tests.app.support.doubles import WaitingRunner


def test_of_two_calibrations_chosen_quickly_scans_use_the_second(tmp_path: Path) -> None:
    runner = WaitingRunner("Use")
    bench = make_bench(tmp_path, runner)
    for name in ("first", "second"):
        bench.library.store(name, published_rig())
        bench.control.library.use(name)
    runner.run(1)
    runner.run(0)
    assert bench.state.in_use.value == "second"
    assert "second" in bench.state.note.value


def test_the_library_shown_is_the_one_that_was_read_last(tmp_path: Path) -> None:
    runner = WaitingRunner("Read the library")
    bench = make_bench(tmp_path, runner)
    runner.waiting.clear()
    bench.control.library.load()
    older = runner.waiting.pop()
    finish_older = older.run()
    bench.library.store("new", published_rig())
    bench.control.library.load()
    runner.run()
    finish_older()
    assert [line.name for line in bench.state.library.value] == ["new"]


def test_rows_read_before_a_calibration_was_accepted_do_not_replace_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runner = WaitingRunner("nothing")
    bench: CalibrateBench = with_a_campaign(make_bench(tmp_path, runner))
    monkeypatch.setattr(runner, "_held", ("Read the campaign",))
    bench.control.refresh()
    finish_older = runner.waiting.pop().run()
    monkeypatch.setattr(runner, "_held", ())
    calibrate(bench, "selftest")
    now = states(bench)
    assert now[0].is_accepted
    finish_older()
    assert states(bench) == now


def test_what_was_said_of_the_calibration_in_use_ends_with_its_use(tmp_path: Path) -> None:
    bench = make_bench(tmp_path)
    bench.library.store("lab", published_rig())
    bench.control.library.use("lab")
    assert "Scans use the calibration lab from now on" in bench.state.note.value
    bench.state.in_use.set("")  # another one was chosen on the Scan page
    assert bench.state.note.value == ""
