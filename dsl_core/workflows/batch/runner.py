"""What runs the tasks of a batch, here or elsewhere, and what it tells while it does."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from typing import Protocol

from dsl_core.io.objects.address import shown
from dsl_core.words import counted
from dsl_core.workflows.batch.task import Outcome, ScanTask

#: A task whose worker died as often as this is given up: it may be what kills them.
MOST_DEATHS = 3


@dataclass(frozen=True)
class Rows:
    """So many rows of a task's picture are finished."""

    task: int
    done: int


@dataclass(frozen=True)
class Ended:
    """What became of a task."""

    task: int
    outcome: Outcome


class Runner(Protocol):
    """Does tasks; each ends once, in any order."""

    def run(self, tasks: Mapping[int, ScanTask]) -> Generator[Rows | Ended, None, None]:
        """Do tasks, which are known by numbers; closing the generator stops what is not done."""


def given_up(task: ScanTask, how: str) -> Outcome:
    """The outcome of a task whose worker died too often; ``how`` is a clause about the last time."""
    return Outcome(
        task.scan,
        task.target,
        "failed",
        f"The process that reconstructed {shown(task.scan)} died {counted(MOST_DEATHS, 'time')}, {how}. It"
        " may need more memory than there is: use fewer jobs, or another machine.",
    )
