"""What a command prints, and where: findings or one JSON object to standard output, progress to error."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsl_core.evaluation.cost import StageCost
from dsl_core.io.objects.address import shown
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from rich.progress import Progress as RichBars
    from rich.progress import TaskID


#: Without a terminal a line of progress is written this often, seconds.
_LINE_EVERY_S = 5.0
#: More bars than this, and those that are full disappear.
_MOST_BARS = 6
#: Width of tables that no terminal limits, characters.
_WIDE = 200


class Output:
    """Prints for a person, or collects one JSON object for a program."""

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json
        self._data: dict[str, Any] = {}
        self._bars = _Bars()

    def say(self, line: str) -> None:
        """Print a line for a person."""
        if not self.as_json:
            self._bars.close()
            print(line, flush=True)

    def table(self, headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Print a table for a person."""
        if self.as_json:
            return
        self._bars.close()
        from rich.console import Console
        from rich.table import Table

        table = Table(*headings, box=None, pad_edge=False, header_style="bold")
        for row in rows:
            table.add_row(*(str(cell) for cell in row))
        console = Console(file=sys.stdout, markup=False, highlight=False)
        if not console.is_terminal:
            console.width = _WIDE
        console.print(table)

    def costs(self, stages: Sequence[StageCost]) -> None:
        """A line for each stage, and their sum."""
        for stage in stages:
            self.say(f"{stage.seconds:8.2f} s {stage.peak_bytes / 1e6:7.0f} MB  {stage.name}")
        peak = max((stage.peak_bytes for stage in stages), default=0)
        self.say(f"{sum(s.seconds for s in stages):8.2f} s {peak / 1e6:7.0f} MB  all stages (largest memory)")
        self.put(
            stages=[
                {"name": s.name, "seconds": round(s.seconds, 3), "peak_bytes": s.peak_bytes} for s in stages
            ]
        )

    def put(self, **values: Any) -> None:
        """Add to the JSON object."""
        self._data.update(values)

    def finish(self) -> None:
        """Print the JSON object, if it was requested."""
        if self.as_json:
            print(json.dumps(_plain(self._data)), flush=True)

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """Bars on a terminal, an occasional line elsewhere; always on standard error."""
        if not sys.stderr.isatty():
            yield _Lines()
            return
        self._bars = _Bars()
        try:
            yield self._bars
        finally:
            self._bars.close()

    def ask(self, question: str) -> str:
        """Ask a person on standard error and return the line typed, empty when input has ended."""
        self._bars.close()
        print(question, end="", file=sys.stderr, flush=True)
        return sys.stdin.readline()


class _Lines:
    """A line when a few seconds have passed since the last, and something has been done."""

    def __init__(self) -> None:
        self._last_s = time.monotonic()
        self._last_line = ""

    def report(self, stage: str, done: int, total: int) -> None:
        now_s = time.monotonic()
        line = f"{stage}: {done} of {total} ({done / total:.0%})" if total else stage
        if now_s - self._last_s >= _LINE_EVERY_S and line != self._last_line:
            self._last_s, self._last_line = now_s, line
            print(line, file=sys.stderr, flush=True)


class _Bars:
    """A bar for each stage, from the first report until something else is printed."""

    def __init__(self) -> None:
        self._bars: RichBars | None = None
        self._tasks: dict[str, TaskID] = {}

    def report(self, stage: str, done: int, total: int) -> None:
        bars = self._bars or self._open()
        if stage not in self._tasks:
            self._make_room(bars)
            self._tasks[stage] = bars.add_task(stage, total=total or None)
        bars.update(self._tasks[stage], completed=done)

    def close(self) -> None:
        """Remove the bars, so that they do not mix with what is printed next."""
        if self._bars is not None:
            self._bars.stop()
        self._bars, self._tasks = None, {}

    def _open(self) -> RichBars:
        from rich.console import Console
        from rich.progress import Progress as RichBars

        self._bars = RichBars(console=Console(stderr=True), transient=True, redirect_stdout=False)
        self._bars.start()
        return self._bars

    def _make_room(self, bars: RichBars) -> None:
        """Remove finished bars when there are many."""
        if len(self._tasks) < _MOST_BARS:
            return
        done = {task.id for task in bars.tasks if task.finished}
        for stage in [stage for stage, task in self._tasks.items() if task in done]:
            bars.remove_task(self._tasks.pop(stage))


def _plain(value: Any) -> Any:
    """A value that every JSON reader accepts: no NaN, no infinity, paths as they are written."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return shown(value) if isinstance(value, Path) else value
