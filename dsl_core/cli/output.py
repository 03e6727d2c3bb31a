"""What a command says, and where: findings (or one JSON object) to standard output, progress to error."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dsl_core.progress import Progress

if TYPE_CHECKING:
    from rich.progress import Progress as RichBars
    from rich.progress import TaskID

    from dsl_core.evaluation.cost import StageCost

#: Without a terminal a line of progress is written this often, seconds.
_LINE_EVERY_S = 5.0
#: Width of tables that no terminal limits, characters.
_WIDE = 200


class Output:
    """Speaks to a person, or collects one JSON object for a program."""

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json
        self._data: dict[str, Any] = {}

    def say(self, line: str) -> None:
        """Print a line for a person."""
        if not self.as_json:
            print(line, flush=True)

    def table(self, headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Print a table for a person."""
        if self.as_json:
            return
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
        """Print the JSON object, if that was asked for."""
        if self.as_json:
            print(json.dumps(_plain(self._data)), flush=True)

    @contextmanager
    def progress(self) -> Iterator[Progress]:
        """Bars on a terminal, an occasional line elsewhere; always on standard error."""
        if not sys.stderr.isatty():
            yield _Lines()
            return
        from rich.console import Console
        from rich.progress import Progress as RichBars

        with RichBars(console=Console(stderr=True), transient=True) as bars:
            yield _Bars(bars)


class _Lines:
    """A line when a few seconds have passed since the last."""

    def __init__(self) -> None:
        self._last_s = time.monotonic()

    def report(self, stage: str, done: int, total: int) -> None:
        now_s = time.monotonic()
        if now_s - self._last_s >= _LINE_EVERY_S:
            self._last_s = now_s
            print(f"{stage}: {done} of {total} ({done / max(total, 1):.0%})", file=sys.stderr, flush=True)


class _Bars:
    """A bar for each stage."""

    def __init__(self, bars: RichBars) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def report(self, stage: str, done: int, total: int) -> None:
        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(stage, total=total)
        self._bars.update(self._tasks[stage], completed=done)


def _plain(value: Any) -> Any:
    """A value that every JSON reader takes: no NaN, no infinity, paths as text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
