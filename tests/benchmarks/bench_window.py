"""How responsive the window stays while each heavy job runs.

Run ``python -m tests.benchmarks.bench_window``. The whole application works on a virtual display and on the
twin. Gaps between ticks of a 10 ms timer are given by the clock and *quiet*: as they would be were the
window's thread never kept from a core by other programs. ``--trace FILE`` says what threads did in long ones.
Material is made once and takes minutes; the next call finds it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tests.app.support.virtual_display import virtual_display
from tests.benchmarks.common import as_on_screen, options, print_table, write_json
from tests.benchmarks.stall_watch import Stalls, StallWatch

INSIDE = "DSL_BENCH_WINDOW"
P99_MS, WORST_MS = 50.0, 150.0


def main() -> None:
    """Run the jobs that were requested; print a table of each group, and one of answers."""
    parser = options(__doc__)
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="groups of jobs")
    parser.add_argument("--trace", type=Path, metavar="FILE", help="what threads did in long gaps")
    parser.add_argument("--material", type=Path, default=Path(tempfile.gettempdir()) / "dsl-scan-screens")
    wanted = parser.parse_args()
    if INSIDE not in os.environ:
        with virtual_display(1280, 800) as display:
            command = [sys.executable, "-m", "tests.benchmarks.bench_window", *sys.argv[1:]]
            raise SystemExit(subprocess.run(command, env={**as_on_screen(display), INSIDE: "1"}).returncode)
    figures = _measure(wanted.material, wanted.only, wanted.trace, wanted.quick)
    write_json(wanted.json, figures)


def _measure(material: Path, only: list[str], trace: Path | None, quick: bool) -> dict[str, Any]:
    from dsl_app.shell.application import make_application

    from tests.benchmarks.window_figures import memory_of, result_figures, start_figures, turn_cloud
    from tests.benchmarks.window_jobs import WindowJobs
    from tests.screens.look import Look
    from tests.screens.material import make_material
    from tests.screens.stage import Stage

    made = make_material(material)
    full = _full_result(made.folder)
    make_application([])
    with tempfile.TemporaryDirectory(prefix="dsl-scan-") as home, open(trace or os.devnull, "w") as told:
        os.environ["HOME"] = home
        stage = Stage("bench", Path(home), Path(home), made, Look(1280, 800, "dark"))
        jobs = WindowJobs(stage, StallWatch(told if trace else None), full)
        for name, job in jobs.all().items():
            if name == "start" or ((not only or name in only) and not (quick and name in _SLOW)):
                before = set(jobs.stalls)
                job()
                fresh = {each: jobs.stalls[each] for each in jobs.stalls if each not in before}
                _print_stalls(name, fresh, jobs.seconds)
        answers = start_figures(Path(home))
        memory = memory_of(stage, full)
        answers |= result_figures(stage)
        frames = turn_cloud(stage)
        stage.close()
    _print_answers(answers, jobs.cancel_s, memory, frames)
    return {
        "stalls": {name: {"clock": each.clock, "quiet": each.quiet} for name, each in jobs.stalls.items()},
        "answers_ms": answers,
        "cancel_s": jobs.cancel_s,
        "memory_mb": memory,
        "cloud": frames,
    }


_SLOW = ("geometry", "depth-stage", "bandpass")


def _full_result(folder: Path) -> Path:
    """A result of the published size."""
    from dsl_core.io.result.result_file import save_result
    from tests.benchmarks.bench_result_io import synthetic_result

    path = folder / "full.zarr"
    if not path.exists():
        save_result(synthetic_result(47, 580, 890), path)
    return path


def _print_stalls(name: str, stalls: Mapping[str, Stalls], seconds: Mapping[str, float]) -> None:
    def figures(gaps: list[float]) -> list[str]:
        return [f"{np.percentile(gaps, 50):.0f}", f"{np.percentile(gaps, 99):.0f}", f"{max(gaps):.0f}"]

    rows = []
    for job, each in stalls.items():
        # Of fewer than a hundred gaps the 99th percentile is the largest.
        p99 = np.percentile(each.quiet, 99) if len(each.quiet) >= 100 else 0.0
        verdict = "" if p99 <= P99_MS and max(each.quiet) <= WORST_MS else "over"
        row = [f"{seconds[job]:.1f}", *figures(each.clock), *figures(each.quiet), f"{max(each.own):.0f}"]
        rows.append([job, *row, verdict])
    head = [
        "clock p50",
        "p99",
        "worst",
        "quiet p50",
        "p99",
        "worst",
        "own worst",
        f"{P99_MS:.0f}/{WORST_MS:.0f}",
    ]
    load = f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    print(f"\nGaps of the window's thread (ms): {name}, {load}")
    print_table(["", "s", *head], rows)


def _print_answers(
    answers: Mapping[str, tuple[float, float]],
    cancel_s: Mapping[str, float],
    memory: tuple[float, float],
    frames: tuple[float, float, float],
) -> None:
    limits = {"window on screen": "1500 ms", "cursor to spectrum": "20 ms", "change of band": "20 ms"}
    rows = [
        [name, f"{clock:.0f} ms", f"{cpu:.0f} ms", limits.get(name, "")]
        for name, (clock, cpu) in answers.items()
    ]
    rows += [[f"cancel: {name}", f"{seconds:.2f} s", "", "2 s"] for name, seconds in cancel_s.items()]
    rows.append(["cloud turned", f"{frames[0]:.0f} pictures/s", "", "15 pictures/s"])
    rows.append(["cloud turned, longest wait for a picture", f"{frames[1]:.0f} ms", "", ""])
    rows.append(["cloud whole again after that", f"{frames[2]:.0f} ms", "", ""])
    grown, own = memory
    rows.append(["memory of a result", f"{grown:.0f} MB", f"{grown / own:.2f} × {own:.0f} MB", "1.5 ×"])
    print(f"\nAnswers, load average {os.getloadavg()[0]:.1f}")
    print_table(["", "clock", "computing", "limit"], rows)


if __name__ == "__main__":
    main()
