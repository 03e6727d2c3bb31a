"""What is left when programs are killed, or the disk fills up, at any call that writes.

    python -m tests.benchmarks.bench_kills [--quick] [--kills 10] [--jobs scan,resume] [--campaign]

Each job runs in a child of this process, whose n-th call of the system that changes a disk is its last: it is
killed before the call, within it (half of what it should write is there), or gets "no space left" or
"read-only file system" from then on. Whatever was acknowledged has to be there, the same job has to go on
afterwards, and its outcome has to be that of an unbroken one, with nothing left over. ``--campaign`` also
kills all real calibrations, again and again in one folder; that takes many minutes.
"""

from __future__ import annotations

import errno
import hashlib
import logging
import os
import shutil
import signal
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dsl_core import pipeline
from dsl_core.campaign.guide import run_calibration
from dsl_core.campaign.session import CalibrationSession
from dsl_core.devices.registry import open_rig
from dsl_core.errors import DslError, StoreError
from dsl_core.io.campaign_folder import CampaignFolder, take_campaign
from dsl_core.io.export import export
from dsl_core.io.result.result_file import load_result
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.options import Options
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting
from dsl_core.progress import NoProgress
from dsl_core.workflows import scans
from tests.benchmarks.common import options, print_table, write_json
from tests.cases import tiny_campaign
from tests.cases.fake_recipe import FakeRecipe

#: High enough for several bands of the rows that are solved together, so that a killed result is resumed.
TWIN, BAND_ROWS = {"size": "48x160", "scene": "plane"}, 64
PLAN = CapturePlan(
    code=GrayCode(rows=False),
    spectral=ScanLines(width_px=10, step_px=10),
    settings=(Setting(exposure_ms=166.7, level=0.2),),
    code_settings=(0,),
)
CALLS = ("open", "write", "fsync", "replace", "rename", "unlink", "rmdir", "mkdir", "ftruncate", "link")
FAULTS = ("killed", "torn", "full", "read-only")
#: How a child ended that said in a sentence what is wrong.
_SAID = 3


class Acknowledged(NoProgress):
    """Tells the parent how many frames are saved."""

    def __init__(self, pipe: int) -> None:
        self._pipe, self._write = pipe, os.write

    def report(self, stage: str, done: int, total: int) -> None:
        if stage == "scan":
            self._write(self._pipe, bytes([min(done, 255)]))


@dataclass(frozen=True)
class Job:
    """What is done in a folder that ``prepare`` made, and a digest of what should come of it."""

    name: str
    prepare: Callable[[Path], None]
    do: Callable[[Path, NoProgress], None]
    outcome: Callable[[Path], str]


def doomed(do: Callable[[], None], fault: str, at: int, count_to: Path | None = None) -> int:
    """Fork, do it with a fault at the ``at``-th call that writes, and return how the child ended."""
    child = os.fork()
    if child == 0:
        count = [0]
        for name in CALLS:
            setattr(os, name, _counted(getattr(os, name), name, fault, at, count))
        code = 0
        try:
            do()
        except DslError:
            code = _SAID
        except BaseException:
            logging.disable(logging.NOTSET)
            logging.exception("not a sentence")
            code = 4
        if count_to is not None:
            count_to.write_text(str(count[0]))
        os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _counted(
    call: Callable[..., Any], name: str, fault: str, at: int, count: list[int]
) -> Callable[..., Any]:
    def instead(*arguments: Any, **named: Any) -> Any:
        writes = name != "open" or bool((arguments[1] if len(arguments) > 1 else named["flags"]) & os.O_CREAT)
        count[0] += writes
        if not writes or not at or count[0] < at:
            return call(*arguments, **named)
        if fault == "full":
            if name in ("open", "write", "fsync", "mkdir"):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return call(*arguments, **named)
        if fault == "read-only":
            # Of a name that is not there, too: the system looks whether it may write before it looks for it.
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        if fault == "torn" and name == "write":
            call(arguments[0], bytes(arguments[1])[: len(arguments[1]) // 2])
        os.kill(os.getpid(), signal.SIGKILL)

    return instead


def _scan(folder: Path, progress: NoProgress) -> None:
    with open_rig("twin", TWIN) as rig:
        pipeline.scan(rig, pipeline.fit_plan(PLAN, rig), folder / "a.dsl", progress)


def _half_a_scan(folder: Path) -> None:
    doomed(lambda: _scan(folder, NoProgress()), "killed", 150)


def _resume(folder: Path, progress: NoProgress) -> None:
    with scans.reopen_rig(folder / "a.dsl") if _has_origin(folder) else open_rig("twin", TWIN) as rig:
        scans.resume(rig, folder / "a.dsl", progress)


def _has_origin(folder: Path) -> bool:
    return bool(ScanReader(folder / "a.dsl").manifest.notes.get("rig"))


def _frames(folder: Path) -> str:
    reader = ScanReader(folder / "a.dsl")
    return _digest([reader.read(shot) for shot in reader.plan.shots()])


def _reconstruct(folder: Path, progress: NoProgress) -> None:
    made = Options(band_rows=BAND_ROWS, as_calibrated=True)
    scans.reconstruct_to(folder / "a.zarr", folder / "a.dsl", options=made, overwrite=True)


def _result(folder: Path) -> str:
    with load_result(folder / "a.zarr") as result:
        return _digest([result[name].values for name in ("depth_mm", "reflectance", "flags")])


def _export(folder: Path, progress: NoProgress) -> None:
    with load_result(folder / "a.zarr") as result:
        for name, ending in (("ply", "ply"), ("envi", "hdr"), ("npy", "npy"), ("tiff", "tiff")):
            export(result, folder / f"out.{ending}", name, overwrite=True)


def _exported(folder: Path) -> str:
    files = sorted(path for path in folder.glob("out*") if path.is_file())
    return " ".join(f"{path.name}:{path.stat().st_size}" for path in files)


class _Willing:
    def begins(self, session: CalibrationSession, missing: int) -> None: ...

    def place(self, step: object) -> None: ...

    def looked(self, step: object, figures: Sequence[object]) -> bool:
        return True

    def judge(self, fitted: object) -> bool:
        return True


def _calibrate(folder: Path, progress: NoProgress) -> None:
    path = folder / "campaign"
    with open_rig("twin", TWIN) as rig:
        rig.place = None
        campaign = CampaignFolder.begin(path, "twin", TWIN)
        lock = take_campaign(path)
        recipe = FakeRecipe()
        run_calibration(CalibrationSession(recipe, rig, campaign, (recipe,)), _Willing(), NoProgress())
        lock.release()


def _calibrated(folder: Path) -> str:
    accepted = CampaignFolder.open(folder / "campaign").accepted("fake")
    return "" if accepted is None else str(accepted.record)


def _digest(arrays: Sequence[np.ndarray]) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(each).tobytes() for each in arrays)).hexdigest()[:16]


def jobs(source: Path) -> tuple[Job, ...]:
    """All of them; ``source`` has a scan and its result, which later stages start from."""

    def copied(*names: str) -> Callable[[Path], None]:
        def copy(folder: Path) -> None:
            for name in names:
                shutil.copytree(source / name, folder / name)

        return copy

    return (
        Job("scan", lambda folder: None, _scan, _frames),
        Job("resume", _half_a_scan, _resume, _frames),
        Job("reconstruct", copied("a.dsl"), _reconstruct, _result),
        Job("export", copied("a.zarr"), _export, _exported),
        Job("calibrate", lambda folder: None, _calibrate, _calibrated),
    )


def left_over(folder: Path) -> list[str]:
    """Files that only an interrupted writer leaves."""
    return [str(path.relative_to(folder)) for path in folder.rglob("*") if ".partial" in path.name]


def judge(job: Job, folder: Path, wanted: str, fault: str, at: int) -> str:
    """What is wrong after a job met a fault and was done again; empty if nothing."""
    job.prepare(folder)
    receives, sends = os.pipe()
    code = doomed(lambda: job.do(folder, Acknowledged(sends)), fault, at)
    os.close(sends)
    told = os.read(receives, 4096)
    os.close(receives)
    if code not in (0, _SAID, -signal.SIGKILL):
        return f"ended with {code}"
    if told and (folder / "a.dsl").exists():
        kept = len(ScanReader(folder / "a.dsl").sound())
        if kept < told[-1]:
            return f"{told[-1]} frames acknowledged, {kept} there"
    again = doomed(lambda: job.do(folder, NoProgress()), "", 0)
    if again:
        return f"does not go on: {again}"
    if job.outcome(folder) != wanted:
        return "another outcome"
    rest = left_over(folder)
    return f"left over: {rest[:3]}" if rest else ""


def kill_campaign(folder: Path, rng: np.random.Generator) -> tuple[int, str]:
    """Kill all calibrations at random calls until they are through; how often, and what was wrong."""
    kills, captured = 0, dict[str, bytes]()
    command = tiny_campaign.command_all(folder)
    while True:
        code = doomed(lambda: _command(command), str(rng.choice(FAULTS[:2])), int(rng.integers(50, 1500)))
        found = tiny_campaign.contents(folder) if folder.exists() else {}
        lost = [
            name for name, data in captured.items() if found.get(name) != data and not _taken(name, found)
        ]
        if lost:
            return kills, f"changed: {lost[:3]}"
        if code != -signal.SIGKILL:
            return kills, f"ended with {code}" if code else " ".join(left_over(folder))
        kills += 1
        captured = {name: data for name, data in found.items() if Path(name).match("[!c]*.json")}


def _taken(name: str, found: dict[str, bytes]) -> bool:
    """Whether a candidate is gone because it was accepted, which deletes it."""
    return name.startswith("candidates/") and name not in found and Path(name).name in found


def _command(arguments: list[str]) -> None:
    ended = tiny_campaign.give(*arguments)
    if ended.code:
        raise StoreError(ended.err)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = options(__doc__)
    parser.add_argument("--kills", type=int, default=10, help="of each job")
    parser.add_argument("--jobs", default="")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--campaign", action="store_true")
    chosen = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    rng, table = np.random.default_rng(chosen.seed), dict[str, Counter[str]]()
    with tempfile.TemporaryDirectory() as spare:
        source = Path(spare) / "source"
        source.mkdir()
        for make in (_scan, _reconstruct):
            make(source, NoProgress())
        for job in jobs(source):
            if chosen.jobs and job.name not in chosen.jobs.split(","):
                continue
            whole = Path(spare) / f"{job.name}-whole"
            whole.mkdir()
            job.prepare(whole)
            code = doomed(lambda: job.do(whole, NoProgress()), "", 0, Path(spare) / "count")  # noqa: B023
            assert code == 0, f"{job.name} fails by itself"
            count, wanted = int((Path(spare) / "count").read_text()), job.outcome(whole)
            row = table[f"{job.name} ({count} calls)"] = Counter()
            for number in range(2 if chosen.quick else chosen.kills):
                folder = Path(spare) / f"{job.name}-{number}"
                folder.mkdir()
                fault, at = FAULTS[number % len(FAULTS)], int(rng.integers(1, count + 1))
                wrong = judge(job, folder, wanted, fault, at)
                row["WRONG" if wrong else fault] += 1
                if wrong:
                    print(f"  {job.name} {fault} at {at} of {count}: {wrong}", flush=True)
                shutil.rmtree(folder)
        if chosen.campaign:
            kills, wrong = kill_campaign(Path(spare) / "all", rng)
            table["calibrate all"] = Counter({"killed": kills, "WRONG": int(bool(wrong))})
            print(f"  calibrate all: {kills} kills {wrong}", flush=True)
    ends = (*FAULTS, "WRONG")
    print_table(("job", *ends), [(name, *(row[end] for end in ends)) for name, row in table.items()])
    write_json(chosen.json, {name: dict(row) for name, row in table.items()})


if __name__ == "__main__":
    main()
