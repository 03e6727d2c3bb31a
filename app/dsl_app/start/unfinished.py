"""What was interrupted and can be resumed from the Start page. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dsl_app.connection.state import RigChoice
from dsl_app.shared.evented import Value
from dsl_app.shared.jobs.base import Job, JobRunner

if TYPE_CHECKING:
    from dsl_core.progress import Progress
    from dsl_core.workflows.unfinished import UnfinishedResult

#: At most so many are offered; the others are in their folders.
MOST = 4
#: Looking at very many scans takes too long for a page that is only passed through.
MOST_SCANS = 200


@dataclass(frozen=True)
class Unfinished:
    """Something to resume: in words, what the button says, and what was begun (None: a scan)."""

    path: Path
    words: str
    button: str
    result: UnfinishedResult | None = None


class UnfinishedController:
    """Finds what was interrupted, and resumes it; ``open_path`` opens scans and finished results.

    ``comes_second`` says that something else is what a person does next.
    """

    def __init__(
        self,
        folders: Callable[[], Iterable[Path]],
        runner: JobRunner,
        open_path: Callable[[Path], object],
        comes_second: Value[bool] | None = None,
    ) -> None:
        self.comes_second = Value(False) if comes_second is None else comes_second
        self.found: Value[tuple[Unfinished, ...]] = Value(())
        #: Whether a reconstruction continues now.
        self.is_resuming = Value(False)
        self._folders, self._runner, self._open_path = folders, runner, open_path
        self._running: set[Path] = set()

    def look(self) -> None:
        """Look for what was interrupted, in a worker, if there is anything to look at."""
        folders = [folder for folder in dict.fromkeys(self._folders()) if worth_a_look(folder)]
        if not folders:
            self.found.set(())
            return

        def work(progress: Progress) -> tuple[Unfinished, ...]:
            progress.report("look for what was interrupted", 0, 0)
            return unfinished_in(folders)

        self._runner.submit(Job("Look for what was interrupted", work, self._show, is_minor=True))

    def _show(self, found: tuple[Unfinished, ...]) -> None:
        self.found.set(tuple(each for each in found if each.path not in self._running)[:MOST])

    def resume(self, what: Unfinished) -> None:
        """Open a scan, which offers to resume; continue a reconstruction and open its result."""
        if what.result is None:
            self._open_path(what.path)
            return
        begun = what.result
        self._running.add(what.path)
        self.is_resuming.set(True)
        self._show(self.found.value)

        def work(progress: Progress) -> Path:
            from dsl_core.workflows.unfinished import resume_result

            return resume_result(begun, progress)

        def ended() -> None:
            self._running.discard(what.path)
            self.is_resuming.set(bool(self._running))
            self.look()

        self._runner.submit(Job(f"Reconstruct {what.path.stem}", work, self._open_path, on_ended=ended))


def worth_a_look(folder: Path) -> bool:
    """Whether a folder has scans or begun results at all; nothing is read."""
    try:
        names = [each.name for each in folder.iterdir()]
    except OSError:
        return False
    scans = sum(name.endswith(".dsl") for name in names)
    return 0 < scans <= MOST_SCANS


def unfinished_in(folders: Iterable[Path]) -> tuple[Unfinished, ...]:
    """What was interrupted in some folders: reconstructions first, which need no rig."""
    from dsl_core.workflows.unfinished import unfinished_results, unfinished_scans

    folders = list(folders)
    results = [
        Unfinished(
            each.target,
            f"The reconstruction of {each.scan.stem} was interrupted: {each.done} of {each.total} parts are"
            " safe.",
            "Resume reconstruction",
            each,
        )
        for folder in folders
        for each in unfinished_results(folder)
    ]
    scans = [
        Unfinished(
            each.folder,
            f"The scan {each.folder.stem} was interrupted: {each.done} of {each.total} frames are safe."
            f"{_words_of(each.rig)}",
            "Resume scan…",
        )
        for folder in folders
        for each in unfinished_scans(folder)
    ]
    return (*results, *scans)


def _words_of(rig: tuple[str, dict[str, str]] | None) -> str:
    """With which rig a scan was taken, as a sentence; empty where that is not known."""
    if rig is None:
        return ""
    name, options = rig
    return f" Rig: {RigChoice(name, tuple(options.items())).words}."
