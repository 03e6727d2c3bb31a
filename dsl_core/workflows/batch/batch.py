"""A batch: scans found, their tasks done by a runner, and one report for all."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath
from typing import Any

from dsl_core.errors import Cancelled, StoreError
from dsl_core.extras import require_package
from dsl_core.io import CAMPAIGN_NAME, MANIFEST_NAME
from dsl_core.io.campaign_folder import SCAN_NAME
from dsl_core.io.neighbours import SCAN_SUFFIX, result_beside
from dsl_core.io.objects.address import Address, address_of, shown
from dsl_core.io.objects.store import ObjectFolder
from dsl_core.io.reading import read_bounded, read_json
from dsl_core.io.scan.folder import LOG_NAME
from dsl_core.io.sealed import SealError, unseal
from dsl_core.model.options import Options
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress
from dsl_core.words import counted
from dsl_core.workflows.batch.runner import Ended, Rows, Runner
from dsl_core.workflows.batch.task import Outcome, ScanTask

#: How long to wait before a result that another batch works on is looked at again, seconds.
WAIT_S = 2.0
#: What a reconstruction takes beyond its pixels, and for each of them, bytes (in `collections.md`).
BASE_BYTES, PIXEL_BYTES = 1.2e9, 2600.0


@dataclass(frozen=True)
class BatchReport:
    """What became of every scan, in their order."""

    outcomes: tuple[Outcome, ...]

    def of(self, state: str) -> tuple[Outcome, ...]:
        """The scans that ended in a state."""
        return tuple(each for each in self.outcomes if each.state == state)

    @property
    def words(self) -> str:
        """How many scans were made, kept and failed."""
        made, kept, failed = (len(self.of(state)) for state in ("made", "kept", "failed"))
        parts = [f"{counted(len(self.outcomes), 'scan')}: {made} reconstructed"]
        parts += [f"{kept} complete before"] if kept else []
        parts += [f"{failed} failed"] if failed else []
        return f"{', '.join(parts)}."


def find_scans(source: Path) -> list[Path]:
    """Scans of a folder and of those in it, links included, or of a list: a text file with a path a line.

    What a campaign of calibrations in the folder has captured is left out. A scan is found once, whatever
    links lead to it. Paths of a list are relative to its folder; lines that are empty or begin with # are
    skipped. Raises `StoreError` when there are none.
    """
    address = address_of(source)
    if address is not None:
        return _scans_at(address)
    if source.is_dir():
        if _is_scan(source):
            return [source]
        found = sorted(
            path
            for path in _folders_in(source)
            if _is_scan(path)
            and not _is_calibration(path.relative_to(source), lambda name: (source / name).is_file())
        )
        _require_any(source, found)
        return found
    if not source.exists():
        raise StoreError(f"{source} does not exist. Give a folder with scans, or a list of them.")
    try:
        lines = [line.strip() for line in read_bounded(source).decode("utf-8-sig").splitlines()]
    except (OSError, UnicodeDecodeError) as error:
        raise StoreError(
            f"{source} is not a list of scans ({error}). Give a text file with a path on each line."
        ) from error
    found = [_listed(source.parent, line) for line in lines if line and not line.startswith("#")]
    if not found:
        raise StoreError(f"{source} names no scan. Write a path of a scan on each line.")
    # A scan that is missing fails by itself; a file of which no line is a path is another kind of file.
    if not any(address_of(scan) is not None or os.path.exists(scan) for scan in found):
        raise StoreError(
            f"{source} is not a list of scans: nothing is at {found[0]}, the first path in it. Give a text"
            " file with a path on each line."
        )
    return list(dict.fromkeys(found))


def _require_any(source: Path | Address, found: Sequence[Path]) -> None:
    if not found:
        raise StoreError(
            f"{source} contains no scan of an object (NAME.dsl). Give a folder with scans, or a list."
        )


def _is_calibration(inside: PurePath, is_file: Callable[[PurePath], bool]) -> bool:
    """Whether a scan, by its path in the folder asked for, is of a step of a campaign somewhere in there."""
    return inside.name == SCAN_NAME and len(inside.parts) > 3 and is_file(inside.parents[2] / CAMPAIGN_NAME)


def _folders_in(top: Path) -> Iterator[Path]:
    """A folder and all in it, each once: by its own path where that is in there, otherwise by a link."""
    starts, seen = [top], set[str]()
    for start in starts:
        for place, inner, _ in os.walk(start):
            real = os.path.realpath(place)
            if real in seen:
                inner.clear()
                continue
            seen.add(real)
            inner.sort()
            starts += [Path(place, name) for name in inner if os.path.islink(os.path.join(place, name))]
            yield Path(place)


def _is_scan(folder: Path) -> bool:
    """Whether a folder is a scan, perhaps a damaged one; other programs have files called as its manifest."""
    if not (folder / MANIFEST_NAME).is_file():
        return False
    if folder.suffix == SCAN_SUFFIX or (folder / LOG_NAME).exists():
        return True
    try:
        return _describes_scan(read_bounded(folder / MANIFEST_NAME))
    except OSError:
        return True  # what is wrong with it is told where it is read


def _describes_scan(manifest: bytes) -> bool:
    try:
        content = json.loads(unseal(manifest))
    except SealError:
        return True  # sealed as ours are, and damaged since
    except (ValueError, RecursionError):
        return False
    return isinstance(content, dict) and content.keys() >= {"plan", "versions"}


def _listed(folder: Path, line: str) -> Path:
    return folder / line if address_of(Path(line)) is None else Path(line)


def _scans_at(address: Address) -> list[Path]:
    require_package("obstore")
    objects = ObjectFolder(address)
    names = objects.listed()
    manifests = [name for name in sorted(names) if name.rpartition("/")[2] == MANIFEST_NAME]
    found = []
    for name in manifests:
        scan, log = Path(f"{address}/{name}").parent, f"{name.removesuffix(MANIFEST_NAME)}{LOG_NAME}"
        if _is_calibration(PurePosixPath(name).parent, lambda path: str(path) in names):
            continue
        if scan.suffix == SCAN_SUFFIX or log in names or _describes_scan(objects.get(name) or b""):
            found.append(scan)
    _require_any(address, found)
    return found


def tasks_of(
    scans: Sequence[Path],
    results: Path | None = None,
    calibration: Rig | None = None,
    options: Options | None = None,
    *,
    override_calibration: bool = False,
    overwrite: bool = False,
) -> list[ScanTask]:
    """A task for each scan; its result is next to it, or in the folder of ``results``.

    Raises `StoreError` where two scans would have one result.
    """
    tasks = []
    for scan in scans:
        target = result_beside(scan)
        target = target if results is None else results / target.name
        given = scan, target, calibration, options or Options()
        tasks.append(ScanTask(*given, override_calibration, overwrite))
    by_target: dict[Path, Path] = {}
    for task in tasks:
        other = by_target.setdefault(task.target, task.scan)
        if other != task.scan:
            raise StoreError(
                f"{shown(other)} and {shown(task.scan)} would both become {shown(task.target)}. Rename one of"
                " them, or leave the folder for results out."
            )
    return tasks


def picture_px(scan: Path) -> tuple[int, int]:
    """Width and height of a scan's pictures; nothing for one that cannot be read.

    Of thousands of scans, so that only as much is read of them as that takes.
    """
    try:
        address = address_of(scan)
        manifest = read_json(scan / MANIFEST_NAME) if address is None else _manifest_at(address)
        width, height = manifest["plan"]["camera_size_px"]
        return int(width), int(height)
    except (OSError, StoreError, ImportError, ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return 0, 0


@functools.cache
def _manifest_at(address: Address) -> Any:
    """What a scan in a store says of itself, asked once: an answer takes as long as thousands from a disk."""
    return json.loads(unseal(ObjectFolder(address).get(MANIFEST_NAME) or b""))


def needed_bytes(task: ScanTask) -> float:
    """What memory the process of a task takes, about."""
    width, height = picture_px(task.scan)
    return BASE_BYTES + PIXEL_BYTES * width * height


def run_batch(
    tasks: Sequence[ScanTask],
    runner: Runner,
    progress: Progress,
    wait: Callable[[float], object] = time.sleep,
) -> BatchReport:
    """Do all tasks and say what became of each; one that fails does not stop the others.

    Results that another batch works on are waited for. Raises `Cancelled` when it is stopped: what is
    complete is kept, and what was begun is continued by the next batch.
    """
    bar, outcomes = _Bar(tasks, progress), dict[int, Outcome]()
    left = dict(enumerate(tasks))
    try:
        while left:
            with contextlib.closing(runner.run(left)) as events:
                for event in events:
                    if isinstance(event, Ended):
                        outcomes[event.task] = event.outcome
                    bar.seen(event)
            left = {i: tasks[i] for i, each in sorted(outcomes.items()) if each.state == "claimed"}
            if left:
                progress.report("wait for results of another batch", len(tasks) - len(left), len(tasks))
                wait(WAIT_S)
    except (KeyboardInterrupt, Cancelled):
        done = sum(each.state in ("made", "kept") for each in outcomes.values())
        raise Cancelled(
            f"Stopped: {done} of {counted(len(tasks), 'result')} are complete. The same command continues."
        ) from None
    return BatchReport(tuple(outcomes[i] for i in range(len(tasks))))


class _Bar:
    """One bar for the rows of all scans."""

    def __init__(self, tasks: Sequence[ScanTask], progress: Progress) -> None:
        self._progress, self._name = progress, f"rows of {counted(len(tasks), 'scan')}"
        # A scan that cannot be read counts as a row, so that the bar moves when that is told.
        self._rows = [picture_px(task.scan)[1] or 1 for task in tasks]
        self._done = [0] * len(tasks)
        self._report()

    def seen(self, event: Rows | Ended) -> None:
        if isinstance(event, Rows):
            self._done[event.task] = min(event.done, self._rows[event.task])
        elif event.outcome.state != "claimed":
            self._done[event.task] = self._rows[event.task]
        self._report()

    def _report(self) -> None:
        self._progress.report(self._name, sum(self._done), sum(self._rows))
