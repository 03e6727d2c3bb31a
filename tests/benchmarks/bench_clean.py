"""False alarms: clean scans of every scene with every plan, as nobody else has them.

    python -m tests.benchmarks.bench_clean [--quick] [--sizes 48x32,112x72] [--plans preview,comb] [--first 0]

An alarm is a picture that is captured again, a scan that stops or warns of motion, or a finished scan of
which a later look at its files says anything.
"""

from __future__ import annotations

import logging
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from dsl_core import pipeline
from dsl_core.errors import DslError
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.proof_file import read_proof
from dsl_core.model.plan import CapturePlan, EnsembleCode, GrayCode, ScanLines, XorCode
from dsl_core.model.presets import PRESETS
from dsl_core.simulation.scenes.catalogue import scene_catalogue
from dsl_core.simulation.sim_devices import open_twin
from tests.benchmarks.common import options, print_table, write_json


def plans() -> dict[str, CapturePlan]:
    """All presets, and a plan for each other code."""
    found = {preset.key: preset.plan for preset in PRESETS}
    quick = found["quick"]
    lines = ScanLines(step_px=5)
    codes = {"rows": GrayCode(), "xor": XorCode(rows=False), "ensemble": EnsembleCode(rows=False)}
    for name, code in codes.items():
        found[name] = quick.model_copy(update={"code": code, "spectral": lines, "name": name})
    return found


def alarm(scene: str, size: str, seed: int, plan: CapturePlan, folder: Path) -> str:
    """What is said of a clean scan; empty if nothing."""
    rig = open_twin({"scene": scene, "size": size, "seed": str(seed)})
    try:
        status = pipeline.scan(rig, pipeline.fit_plan(plan, rig), folder)
    except DslError as error:
        return f"stopped: {error}"
    if status.corrected or status.warning:
        return f"{status.corrected} captured again. {status.warning}"
    reader = ScanReader(folder)
    assert reader.calibration is not None
    proof = read_proof(reader, reader.calibration)
    return "no proof" if proof is None else " ".join((*proof.wrong, *proof.moved))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print every alarm, and how many there were by plan."""
    parser = options(__doc__)
    parser.add_argument("--sizes", default="48x32,112x72")
    parser.add_argument("--plans", default="")
    parser.add_argument("--scenes", default="")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    chosen = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    scenes = [entry.name for entry in scene_catalogue()]
    scenes = chosen.scenes.split(",") if chosen.scenes else scenes[:2] if chosen.quick else scenes
    wanted = chosen.plans.split(",") if chosen.plans else list(plans())
    alarms, scans, seed = Counter[str](), Counter[str](), chosen.first
    began_s = time.process_time()
    for name in wanted:
        for size in chosen.sizes.split(","):
            for scene in scenes:
                seed += 1
                with tempfile.TemporaryDirectory() as spare:
                    said = alarm(scene, size, seed, plans()[name], Path(spare) / "scan.dsl")
                scans[name] += 1
                alarms[name] += bool(said)
                if said:
                    print(f"  {name} {size} {scene} {seed}: {said[:300]}", flush=True)
    print_table(("plan", "scans", "alarms"), [(name, scans[name], alarms[name]) for name in wanted])
    seconds = time.process_time() - began_s
    print(f"{sum(scans.values())} scans: {sum(alarms.values())} alarms, {seconds:.0f} CPU s")
    write_json(chosen.json, {"scans": dict(scans), "alarms": dict(alarms)})


if __name__ == "__main__":
    main()
