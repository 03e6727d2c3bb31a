"""Campaigns are opened, and one calibration runs at a time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dsl_app.calibrate.controller import library_name
from dsl_app.connection.state import RigChoice
from dsl_app.shared.jobs.base import Job
from dsl_app.shared.notify import NO_RIG

from dsl_core.io.scan.lock import FolderLock
from tests.app.calibrate.calibrate_bench import (
    CalibrateBench,
    is_on,
    make_bench,
    with_a_campaign,
)
from tests.app.support.doubles import InlineRunner


def test_only_one_calibration_runs_at_a_time(bench: CalibrateBench) -> None:
    _, control = bench.wizard("selftest")
    tries: list[Callable[[], None]] = [
        lambda: bench.control.run("geometry"),
        bench.control.run_everything,
        bench.control.keep,
    ]
    for again in tries:
        again()
        assert bench.told == "Self-test is still running. Finish or leave it first."
    bench.control.begin_campaign(bench.folder / "other")
    assert not (bench.folder / "other").exists()
    control.leave()
    bench.control.run("geometry")
    assert "needs selftest" in bench.told, "what it needs is named, and the wizard does not open"
    lock = FolderLock(bench.campaign / "lock")
    bench.control.run("selftest")
    assert "written by another process" in bench.told
    lock.release()
    bench.wizard("selftest")


def test_a_rig_in_use_is_not_taken(tmp_path: Path) -> None:
    class Busy(InlineRunner):
        jobs: tuple[Job[None], ...] = ()

        @property
        def active(self) -> tuple[Job[None], ...]:
            return self.jobs

    runner = Busy()
    bench = with_a_campaign(make_bench(tmp_path, runner))
    runner.jobs = (Job("Scan one", lambda progress: None, exclusive="the rig"),)
    bench.control.run("selftest")
    assert bench.told == "Scan one is using the rig. Wait until it ends, or cancel it."


def test_wrong_folders_and_other_rigs_are_named(bench: CalibrateBench, tmp_path: Path) -> None:
    bench.control.open_campaign(tmp_path)
    assert "is not a campaign" in bench.told
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thing").touch()
    bench.control.begin_campaign(tmp_path / "full")
    assert "neither empty nor a campaign" in bench.told
    bench.rig.connect(RigChoice("twin", (("scene", "plane"), ("size", "48x32"))))
    assert is_on(bench.state.foreign)
    assert "begun with the rig twin, scene plane, size 32x24" in bench.state.trouble.value
    bench.control.run("selftest")
    assert "another campaign" in bench.told
    bench.control.connect_rig()
    assert not is_on(bench.state.foreign)
    assert bench.state.trouble.value == ""
    bench.rig.disconnect()
    bench.control.run("selftest")
    assert "No rig is connected" in bench.told


def test_a_lost_rig_calibrates_nothing_until_it_is_connected_again(bench: CalibrateBench) -> None:
    bench.rig.lose("The camera no longer answers.")
    assert bench.state.trouble.value == NO_RIG
    bench.control.run("selftest")
    assert bench.told == NO_RIG
    assert not bench.state.opening.value
    bench.control.library.check("twin")
    assert bench.told == NO_RIG
    bench.control.connect_rig()
    assert bench.state.trouble.value == ""


def test_a_campaign_whose_folder_is_gone_is_said_to_be(bench: CalibrateBench) -> None:
    bench.campaign.rename(bench.folder / "moved")
    bench.control.refresh()
    gone = f"{bench.campaign} is not a campaign: there is no such folder."
    assert bench.state.trouble.value.startswith(gone)
    bench.control.run("selftest")
    assert bench.told.startswith(gone)
    (bench.folder / "moved").rename(bench.campaign)
    bench.control.refresh()
    assert bench.state.trouble.value == ""


def test_the_command_line_names_campaign_and_rig(bench: CalibrateBench) -> None:
    where = f"{bench.campaign} --rig twin --option scene=plane --option size=32x24"
    assert bench.control.command_line("geometry") == f"dsl-scan calibrate geometry {where}"
    assert bench.control.command_line("selftest") == f"dsl-scan selftest {where}"
    assert bench.control.command_line() == f"dsl-scan calibrate all {where}"
    assert library_name(Path("a/(1) b")) == "1- b"
