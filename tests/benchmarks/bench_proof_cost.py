"""What it costs that a scan proves its pictures: exposures, CPU seconds of a scan and of a reconstruction.

    python -m tests.benchmarks.bench_proof_cost [--quick] [--size 445x290] [--plan reference] [--json FILE]

The twin takes the same scan with and without proof, and reconstructs it with what was found kept in the scan,
and without. Everything runs in one process, so that the shares do not depend on the machine; of each, the
lowest of three.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from dsl_core import pipeline
from dsl_core.io.scan.proof_file import PROOF_NAME
from dsl_core.model.presets import PRESETS
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.workflows.scans import reconstruct_scan
from tests.benchmarks.common import options, print_table, write_json

TIMES = 3


def lowest_cpu_s(work: Callable[[int], object]) -> float:
    """CPU seconds of a piece of work that is told its turn."""
    taken = []
    for turn in range(TIMES):
        start = time.process_time()
        work(turn)
        taken.append(time.process_time() - start)
    return min(taken)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = options(__doc__)
    parser.add_argument("--size", default="445x290", help="of the picture, pixels")
    parser.add_argument("--plan", default="reference", choices=[each.key for each in PRESETS])
    chosen = parser.parse_args(arguments)
    size, key = ("96x62", "quick") if chosen.quick else (chosen.size, chosen.plan)
    with tempfile.TemporaryDirectory() as name, open_twin({"size": size}) as rig:
        plan = pipeline.fit_plan(next(each.plan for each in PRESETS if each.key == key), rig)
        places = {proved: Path(name) / f"{proved}" for proved in (True, False)}

        def scan(turn: int, proved: bool) -> None:
            pipeline.scan(rig, plan, Path(f"{places[proved]}{turn}.dsl"), prove=proved)

        scans = {proved: lowest_cpu_s(lambda turn, p=proved: scan(turn, p)) for proved in places}  # type: ignore[misc]
        folder = Path(f"{places[True]}0.dsl")
        kept = lowest_cpu_s(lambda turn: reconstruct_scan(folder))
        (folder / PROOF_NAME).unlink()
        computed = lowest_cpu_s(lambda turn: reconstruct_scan(folder))
    # Of a rig that needs nothing but its exposures, which the twin does not wait for.
    latency_ms = rig.projector.info.latency_ms
    own_s = plan.model_copy(update={"sentinels": None}).duration_s(latency_ms)
    repeats_s = plan.duration_s(latency_ms) - own_s
    proof_s = scans[True] - scans[False]
    rows = [
        ("s of repeated exposures, of the others", f"{repeats_s:.2f}", f"{100 * repeats_s / own_s:.1f} %"),
        (
            "CPU s of a scan's proof, of the exposures",
            f"{proof_s:.2f}",
            f"{100 * proof_s / own_s:.1f} %",
        ),
        ("CPU s of a reconstruction, proof kept", f"{kept:.2f}", ""),
        (
            "CPU s of a reconstruction, proof computed",
            f"{computed:.2f}",
            f"{100 * (computed / kept - 1):+.1f} %",
        ),
    ]
    print_table((f"{size}, {plan.shot_count} frames", "more", "share"), rows)
    write_json(chosen.json, {name: value for name, value, _ in rows})
    return 0


if __name__ == "__main__":
    sys.exit(main())
