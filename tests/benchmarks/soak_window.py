"""Scans, reconstructions, clicks and keys at random on the whole application, for as long as you like.

Run ``python -m tests.benchmarks.soak_window --minutes 60``. Every round takes a handful of random actions and
one scan with its result, and then counts what should not grow: widgets, threads, open files, memory. *stall*
is the longest time (ms, as on a quiet machine) in which the window did not answer. An
exception ends it with the seed and the last actions; growth beyond the limits is told at the end.
"""

from __future__ import annotations

import argparse
import gc
import logging
import os
import random
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import psutil

from dsl_core.solve.heap import trim_memory
from tests.app.support.virtual_display import virtual_display
from tests.benchmarks.common import as_on_screen

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from tests.benchmarks.random_person import RandomPerson

INSIDE = "DSL_SOAK_WINDOW"
#: Rounds in which caches fill; growth counts from then on.
WARM_ROUNDS = 3
#: What may grow by so many between the first and the last third of all rounds: some windows come late, once.
MOST_WIDGETS, MOST_THREADS, MOST_FILES, MOST_MB = 60, 1, 3, 40.0
#: What Qt says when a drag is given up that only a real mouse could end.
BY_NO_PERSON = "QDragManager::drag in possibly invalid state"
ACTIONS_A_ROUND = 25


def main() -> None:
    """Start on a display of its own unless already there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--trace", type=Path, metavar="FILE", help="what threads did in long gaps")
    parser.add_argument("--theme", choices=("light", "dark"), default="dark")
    wanted = parser.parse_args()
    if INSIDE not in os.environ:
        with virtual_display(1280, 800) as display:
            command = [sys.executable, "-m", "tests.benchmarks.soak_window", *sys.argv[1:]]
            raise SystemExit(subprocess.run(command, env={**as_on_screen(display), INSIDE: "1"}).returncode)
    raise SystemExit(_soak(wanted.minutes, wanted.seed, wanted.theme, wanted.trace))


def _soak(minutes: float, seed: int, theme: str, trace: Path | None) -> int:
    from dsl_app.shell.application import collect_garbage, make_application

    from tests.benchmarks.random_person import RandomPerson
    from tests.benchmarks.stall_watch import StallWatch

    application = make_application([])
    with tempfile.TemporaryDirectory(prefix="dsl-scan-") as home, open(trace or os.devnull, "w") as told:
        os.environ["HOME"] = os.environ["DSL_SCAN_HOME"] = home
        errors = _Errors()
        person = RandomPerson(Path(home), theme, random.Random(seed))
        collect_garbage(person.window)
        watch = StallWatch(told if trace else None)
        rounds: list[tuple[float, ...]] = []
        kinds: list[Counter[str]] = []
        limit = time.monotonic() + 60 * minutes
        head = ["round", "widgets", "objects", "threads", "files", "MB", "actions", "stall", "load"]
        print("".join(f"{word:>10}" for word in head), flush=True)
        wrong = ""
        try:
            while time.monotonic() < limit and not wrong:
                with watch.during(f"round {len(rounds) + 1}") as stalls:
                    _one_round(person, not rounds, errors)
                rounds.append(_count(application))
                kinds.append(Counter(type(widget).__name__ for widget in application.allWidgets()))
                print(
                    "".join(
                        f"{word:>10}" for word in _row(len(rounds), rounds[-1], person, max(stalls.quiet))
                    ),
                    flush=True,
                )
                wrong = errors.told
        except Exception as error:
            wrong = f"{type(error).__name__}: {error}"
            traceback.print_exc()
        finally:
            person.close()
        # At the end: what is used first at random comes late, and a step is no growth.
        wrong = wrong or errors.told or _growth(rounds)
    if wrong:
        more = (kinds[-1] - kinds[min(WARM_ROUNDS, len(kinds) - 1)]).most_common(8) if kinds else ()
        print("more widgets than in the beginning:", ", ".join(f"{name} {count}" for name, count in more))
        print(f"\nseed {seed}: {wrong}\nlast actions: {', '.join(person.done[-12:])}")
        return 1
    judged = "nothing grew" if _is_long_enough(rounds) else "too few rounds to say whether anything grew"
    print(f"\nseed {seed}: {len(rounds)} rounds, {len(person.done)} actions, {person.scans} scans; {judged}")
    return 0


def _one_round(person: RandomPerson, first: bool, errors: _Errors) -> None:
    person.scan()
    if first:
        person.look_everywhere()
    for _ in range(ACTIONS_A_ROUND):
        person.act()
        if errors.told:
            break
    person.rest()
    # Else what is weighed is which results happen to be open.
    person.open_the_same()


class _Errors(logging.Handler):
    """What nobody expected: uncaught exceptions, failures that are no sentence to a person, Qt's warnings."""

    def __init__(self) -> None:
        from PySide6.QtCore import qInstallMessageHandler

        super().__init__(logging.WARNING)
        self.told = ""
        logging.getLogger().addHandler(self)
        qInstallMessageHandler(self._hear)

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the first that is a fault of the program, which is no sentence to a person."""
        from dsl_core.errors import DslError

        if record.name == "dsl_app.shell.toasts":
            return
        error = record.exc_info[1] if record.exc_info else None
        expected = error is not None and isinstance(error, DslError | OSError)
        if not self.told and (record.levelno >= logging.ERROR or error is not None) and not expected:
            self.told = record.getMessage() + "\n" + logging.Formatter().format(record)

    def _hear(self, kind: object, _context: object, text: str) -> None:
        from PySide6.QtCore import QtMsgType

        is_news = kind not in (QtMsgType.QtDebugMsg, QtMsgType.QtInfoMsg) and text != BY_NO_PERSON
        if is_news and not self.told:
            self.told = f"Qt: {text}"


def _count(application: QApplication) -> tuple[float, ...]:
    """Widgets, Python's objects, threads, open files, and MB of memory, without pages that are free."""
    gc.collect()
    trim_memory()
    process = psutil.Process()
    return (
        len(application.allWidgets()),
        len(gc.get_objects()),
        process.num_threads(),
        process.num_fds(),
        process.memory_info().rss / 1e6,
    )


def _row(number: int, counted: tuple[float, ...], person: RandomPerson, stall_ms: float) -> list[str]:
    figures = [f"{value:.0f}" for value in counted]
    return [str(number), *figures, str(len(person.done)), f"{stall_ms:.0f}", f"{os.getloadavg()[0]:.1f}"]


def _is_long_enough(rounds: list[tuple[float, ...]]) -> bool:
    return len(rounds) >= WARM_ROUNDS + 9


def _growth(rounds: list[tuple[float, ...]]) -> str:
    """What grew between the first and the last third of all rounds; empty while that cannot be said."""
    if not _is_long_enough(rounds):
        return ""
    settled = rounds[WARM_ROUNDS:]
    third = len(settled) // 3
    before, after = (np.median(part, axis=0) for part in (settled[:third], settled[-third:]))
    limits = (MOST_WIDGETS, np.inf, MOST_THREADS, MOST_FILES, MOST_MB)
    names = ("widgets", "objects", "threads", "open files", "MB of memory")
    grown = [
        f"{name} from {old:.0f} to {new:.0f}"
        for name, old, new, most in zip(names, before, after, limits, strict=True)
        if new - old > most
    ]
    return "; ".join(grown)


if __name__ == "__main__":
    main()
