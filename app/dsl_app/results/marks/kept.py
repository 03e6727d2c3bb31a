"""The marks on disk beside a result: changes wait until they are read, nothing unread is replaced. No Qt."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import partial
from pathlib import Path

from dsl_app.results.marks.records import annotations_of, marks_of
from dsl_app.results.state import Mark, ResultsState
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.notify import Notifier
from dsl_core.errors import DslError
from dsl_core.io.atomic import set_aside
from dsl_core.io.result.annotations_file import (
    Annotations,
    annotations_path,
    load_annotations,
    save_annotations,
)
from dsl_core.io.result.result_arrays import ResultArrays


class _Reading(Enum):
    """How far the marks of the open result are read."""

    UNDER_WAY = "under way"
    DONE = "done"
    FAILED = "failed"


class KeptMarks:
    """Reads the marks of the result that is open and writes them at every change.

    Whoever saves writes all marks. So what was kept is either read first, or put aside by the person's wish.
    """

    def __init__(self, state: ResultsState, runner: JobRunner, notifier: Notifier) -> None:
        self.state, self._runner, self._notifier = state, runner, notifier
        self._reading = _Reading.DONE
        self._reason = ""
        self._waiting: list[Callable[[], None]] = []

    # Read ------------------------------------------------------------------------------------------

    def read(self) -> None:
        """Take the marks beside the result that was opened."""
        self._waiting.clear()
        self.state.marks.set(())
        self.state.selected.set(0)
        self._read()

    @property
    def is_reading(self) -> bool:
        """Whether what is kept is still being read."""
        return self._reading is _Reading.UNDER_WAY

    def when_read(self, change: Callable[[], None]) -> None:
        """Change marks as soon as those that are kept are there; says so where that is not now."""
        if self._reading is _Reading.DONE:
            change()
        elif self._reading is _Reading.UNDER_WAY:
            self._waiting.append(change)
            self._notifier.tell("info", "The marks beside this result are being read; the new one follows.")
        else:
            self._offer()

    def _read(self) -> None:
        self._reading = _Reading.UNDER_WAY
        result = self.state.result.value
        if result is None:
            self._go_on()
            return
        try:
            kept = load_annotations(result.path)
        except DslError as error:
            self._damaged(result, str(error))
            return
        if kept == Annotations():
            self._go_on()
            return

        def done(marks: tuple[Mark, ...]) -> None:
            if self.state.result.value is result:
                self.state.marks.set(marks)
                self._tell_troubles(marks)
                self._go_on()

        def failed(reason: str) -> None:
            if self.state.result.value is result:
                self._fail(reason)

        self._runner.submit(
            Job(
                "Marks",
                lambda progress: marks_of(kept, result, progress),
                done,
                lambda error: failed(str(error)),
                lambda: failed("reading them was cancelled"),
                is_minor=True,
            )
        )

    def _damaged(self, result: ResultArrays, sentence: str) -> None:
        if annotations_path(result.path).exists():
            self._fail(sentence)
        else:  # it was put aside, so that nothing can replace it
            self._notifier.tell("warning", sentence)
            self._go_on()

    def _tell_troubles(self, marks: tuple[Mark, ...]) -> None:
        bad = [mark for mark in marks if mark.trouble]
        if not bad:
            return
        names = ", ".join(mark.name for mark in bad[:4]) + (" and more" if len(bad) > 4 else "")
        self._notifier.tell(
            "warning",
            f"No spectrum for {names}. What is kept of them stays in the list, where each says why; open the"
            " result again when its files are back.",
            "\n".join(f"{mark.name}: {mark.trouble}" for mark in bad),
        )

    def _go_on(self) -> None:
        self._reading = _Reading.DONE
        waiting, self._waiting = self._waiting, []
        for change in waiting:
            change()

    # Where they could not be read ------------------------------------------------------------------

    def _fail(self, reason: str) -> None:
        self._reading, self._reason = _Reading.FAILED, reason
        self._offer()

    def _offer(self) -> None:
        assert self.state.result.value is not None
        path = annotations_path(self.state.result.value.path)
        self._notifier.offer(
            f"The marks in {path} are not shown: {self._reason.rstrip('.')}. The file stays as it is, and no"
            " mark is added before they are read or you begin anew.",
            {
                "Read again": partial(self._decide, path, self._read),
                "Keep the file aside, begin anew": partial(self._decide, path, self._begin_anew),
            },
        )

    def _decide(self, path: Path, then: Callable[[], None]) -> None:
        """Do what was chosen, unless the offer is about a result that is no longer open."""
        result = self.state.result.value
        is_asked = result is not None and annotations_path(result.path) == path
        if is_asked and self._reading is _Reading.FAILED:
            then()

    def _begin_anew(self) -> None:
        assert self.state.result.value is not None
        path = annotations_path(self.state.result.value.path)
        where = set_aside(path)
        if path.exists():
            self._reason = "the file cannot be renamed; check the folder's permissions and its drive"
            self._offer()
            return
        self._notifier.tell("info", f"New marks begin.{where}")
        self._go_on()

    # Write -----------------------------------------------------------------------------------------

    def save(self) -> None:
        """Write all marks; says why where that is not possible."""
        result = self.state.result.value
        if result is None:
            return
        try:
            save_annotations(annotations_of(self.state.marks.value), result.path)
        except DslError as error:
            self._notifier.tell("warning", f"The marks could not be kept: {error}")
