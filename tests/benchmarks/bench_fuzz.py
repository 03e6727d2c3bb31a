"""Every reader against files that are wrong on purpose: sentences, crashes, the slowest, and memory.

``python -m tests.benchmarks.bench_fuzz SECONDS [--only NAME] [--seed 7]`` gives each reader that many
seconds, each in a process of its own, so that a crash of a library is seen; another seed, other changes.
What is found belongs into the tests of its reader.
Seconds are those of the processor, which do not depend on what else the computer does.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, seed, settings

from dsl_core.errors import DslError
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.stranger_readers import MORE
from tests.cases.strangers import SAMPLES, Change, Sample, changed, changes

#: A reader may take so many CPU seconds, and so much memory beyond the file.
MOST_S, MOST_BYTES = 10.0, 1 << 30
#: A reader waits for something if it takes so many times its seconds by the clock, and this much more.
TIMES, PATIENCE_S = 20, 600.0


def main() -> int:
    """Print a line per reader; 1 when one crashed, was slow or took too much memory."""
    parser = options(__doc__)
    parser.add_argument("seconds", type=float, nargs="?", default=5.0)
    parser.add_argument("--only", default="", help="readers whose names hold this")
    parser.add_argument("--seed", type=int, default=0, help="which changes are made")
    parser.add_argument("--worker", default="", help="used by itself")
    chosen = parser.parse_args()
    if chosen.worker:
        sample = next(s for s in (*SAMPLES, *MORE) if s.name == chosen.worker)
        print(json.dumps(fuzz(sample, chosen.seconds, chosen.seed)))
        return 0
    seconds = min(chosen.seconds, 0.5) if chosen.quick else chosen.seconds
    rows, found, bad = [], {}, 0
    for sample in (*SAMPLES, *MORE):
        if chosen.only not in sample.name:
            continue
        command = [
            sys.executable,
            "-m",
            "tests.benchmarks.bench_fuzz",
            str(seconds),
            "--seed",
            str(chosen.seed),
        ]
        command += ["--worker", sample.name]
        try:
            ended = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=TIMES * seconds + PATIENCE_S
            )
            crash = f"exit {ended.returncode}: {ended.stderr[-300:]}" if ended.returncode else ""
        except subprocess.TimeoutExpired:
            crash = "does not end"
        if crash:
            ending: dict[str, Any] = {"crashes": [crash], "slowest_s": 0.0, "bytes": 0, "read": 0, "told": 0}
        else:
            ending = json.loads(ended.stdout.splitlines()[-1])
        found[sample.name] = ending
        is_bad = ending["crashes"] or ending["slowest_s"] > MOST_S or ending["bytes"] > MOST_BYTES
        bad += bool(is_bad)
        cells = [ending["read"], ending["told"], len(ending["crashes"]), f"{ending['slowest_s']:.2f}"]
        rows.append([sample.name, *cells, f"{ending['bytes'] / 1e6:.0f}"])
        for crash in ending["crashes"][:3]:
            print(f"{sample.name}: {crash}", flush=True)
    print_table(["reader", "read", "told", "crashes", "slowest CPU s", "MB more"], rows)
    write_json(chosen.json, found)
    return int(bad > 0)


def fuzz(sample: Sample, seconds: float, first: int = 0) -> dict[str, object]:
    """Change the sample's file and read it until the time is over; ``first`` says which changes are made."""
    read = told = 0
    round_number = 1_000_000 * first
    crashes: dict[str, str] = {}
    slowest = 0.0
    with tempfile.TemporaryDirectory(prefix="dsl-fuzz-") as room:
        folder = Path(room)
        sample.make(folder)
        path = folder / sample.file
        sound = path.read_bytes()
        sample.read(folder)
        before = _peak_bytes()
        end = time.process_time() + seconds

        def once(what: list[Change]) -> None:
            nonlocal read, told, slowest
            if time.process_time() > end:
                return
            path.write_bytes(changed(sound, what))
            start = time.process_time()
            try:
                sample.read(folder)
                read += 1
            except DslError:
                told += 1
            except Exception as error:
                place = error.__traceback__
                while place is not None and place.tb_next is not None:
                    place = place.tb_next
                where = "" if place is None else f"{place.tb_frame.f_code.co_filename}:{place.tb_lineno}"
                crashes.setdefault(f"{type(error).__name__} at {where}", f"{what} {str(error)[:200]}")
            slowest = max(slowest, time.process_time() - start)

        many = settings(
            max_examples=200, deadline=None, database=None, phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )  # fmt: skip
        while time.process_time() < end:
            seed(round_number)(many(given(changes)(once)))()
            round_number += 1
        memory = max(_peak_bytes() - before, 0)
    listed = [f"{key}: {text}" for key, text in crashes.items()]
    return {"read": read, "told": told, "crashes": listed, "slowest_s": slowest, "bytes": memory}


def _peak_bytes() -> int:
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    raise SystemExit(main())
