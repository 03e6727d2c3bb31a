"""A whole scan from disk to a saved result: seconds and memory of every stage, and how they grow.

Run ``python -m tests.benchmarks.bench_reconstruct [--folder DIR] [--quick] [--json FILE]`` from the
repository's root. 890 x 580 pixels, 47 bands, 2 settings, 358 patterns: 716 frames, which the twin
takes once into DIR (a temporary folder unless given; 1.4 GB with the result). Each measurement runs in a
fresh process, so that its peak memory is its own. Then: correspondence of all pixels, bands and orders;
full-size frames of the twin; growth with pixels, bands and patterns, as exponents of a fitted power.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.workflows import scans
from tests.benchmarks.common import options, print_table, write_json

ROOT = Path(__file__).parents[2]
MB = 1e6
SIZES_PX = ((111, 72), (157, 102), (222, 145), (314, 205))
STEPS_NM = (10.0, 5.0, 2.5)
LINE_STEPS_PX = (5, 3, 2, 1)


def make_session(folder: Path, plan: CapturePlan, size_px: tuple[int, int]) -> Path:
    """Scan the Color Checker into a folder, unless it holds the whole scan already."""
    with open_twin({"scene": "color-checker", "size": f"{size_px[0]}x{size_px[1]}"}) as rig:
        if not (folder / "frames.jsonl").is_file():
            pipeline.scan(rig, pipeline.fit_plan(plan, rig), folder)
    return folder


def in_process(*words: str) -> dict[str, Any]:
    """What `job` returns for these words in a fresh process, with the seconds of that process."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "tests.benchmarks.bench_reconstruct", "--job", *words],
        cwd=ROOT, env=environment, stdout=subprocess.PIPE, check=True,
    )  # fmt: skip
    figures: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return {**figures, "process_s": time.perf_counter() - start}


def job(kind: str, folder: Path, step_nm: float) -> dict[str, Any]:
    """One measurement, in the process of its own: wall seconds, CPU seconds of all threads, peak memory."""
    start, cpu = time.perf_counter(), time.process_time()
    work = {"read": read_all, "save": save_all, "growth": grow}[kind]
    figures = work(folder, step_nm)
    taken = {"seconds": time.perf_counter() - start, "cpu_s": time.process_time() - cpu}
    return {**taken, "peak_mb": peak_mb(), **figures}


def read_all(folder: Path, step_nm: float) -> dict[str, Any]:
    """Read and check every frame, and nothing else."""
    from dsl_core.io.scan.folder import ScanReader

    reader = ScanReader(folder)
    return {"frames": sum(reader.read(shot).ndim > 0 for shot in reader.plan.shots())}


def save_all(folder: Path, step_nm: float) -> dict[str, Any]:
    """From session to saved result as the command line does it, which looks less often for garbage."""
    from dsl_core import cli
    from dsl_core.evaluation.cost import costs_of
    from dsl_core.io.result.result_file import read_attributes

    with tempfile.TemporaryDirectory(dir=folder.parent) as place:
        target = Path(place) / "result.zarr"
        if cli.main(["reconstruct", str(folder), "--output", str(target), "--json"]) != 0:
            raise RuntimeError(f"{folder} was not reconstructed: what is wrong is said above.")
        stages = costs_of(read_attributes(target))
    return {"stages": [[s.name, s.seconds, s.peak_bytes / MB] for s in stages]}


def grow(folder: Path, step_nm: float) -> dict[str, Any]:
    """Reconstruct twice: the second time counts, so that nothing is loaded or compiled in it.

    Processor seconds of all threads beside wall seconds: other work on the machine hardly changes them.
    """
    from dsl_core.evaluation.cost import StageTimer
    from dsl_core.model.spectral import WavelengthGrid

    choice = pipeline.Options(grid=WavelengthGrid(start_nm=430.0, stop_nm=660.0, step_nm=step_nm))
    first, second = StageTimer(), StageTimer()
    cpu_s = 0.0
    for timer in (first, second):
        start = time.process_time()
        scans.reconstruct_scan(folder, options=choice, timer=timer)
        cpu_s = time.process_time() - start
    used = max(s.peak_bytes for s in first.stages + second.stages) - first.stages[0].start_bytes
    return {"seconds": sum(s.seconds for s in second.stages), "cpu_s": cpu_s, "used_mb": used / MB}


def peak_mb() -> float:
    """Largest resident memory of this process, MB."""
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / MB


def whole_scan(folder: Path) -> dict[str, Any]:
    """The stages of a full-size reconstruction beside merely reading its frames."""
    print("890 x 580 pixels, 47 bands, 2 settings, 716 frames, from disk to saved result", flush=True)
    session = make_session(folder / "whole.dsl", CapturePlan(name="reference"), (890, 580))
    read = in_process("read", str(session))
    saved = in_process("save", str(session))
    rows = [[name, f"{seconds:.2f}", f"{mb:.0f}"] for name, seconds, mb in saved["stages"]]
    rows.append(["total", f"{saved['seconds']:.2f}", f"{saved['peak_mb']:.0f}"])
    rows.append(["the process, imports included", f"{saved['process_s']:.2f}", ""])
    rows.append(
        [f"merely reading {read['frames']} frames", f"{read['seconds']:.2f}", f"{read['peak_mb']:.0f}"]
    )
    print_table(["stage", "s", "peak MB"], rows)
    # Other work on the machine hardly changes processor seconds.
    ratio = saved["cpu_s"] / read["cpu_s"]
    print(
        f"CPU s: {saved['cpu_s']:.2f}, and {read['cpu_s']:.2f} for reading: {ratio:.1f} times as much\n",
        flush=True,
    )
    return {"read": read, "save": saved, "ratio": ratio}


def correspondence_time() -> float:
    """Best of three: every pixel of 890 x 580, 47 bands, both first orders, grating model."""
    from dsl_core.optics.correspondence import GratingModel
    from dsl_core.simulation.published_rig import published_rig
    from tests.benchmarks.bench_correspondence import seconds

    rig = published_rig()
    best = seconds(GratingModel(rig), rig)
    print(f"correspondence, all pixels, 47 bands, 2 orders: {best:.2f} s\n", flush=True)
    return best


def checkerboard() -> NDArray[np.uint8]:
    """Squares of four colours: every LED varies along rows and columns."""
    y, x = np.mgrid[0:360, 0:640] // 20
    colours = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]], np.uint8)
    return np.asarray(colours[(x + 2 * y) % 4])


def twin_frames(repeat: int) -> dict[str, float]:
    """Median seconds of one full-size frame for each kind of pattern, exposure and noise included."""
    with open_twin({"scene": "color-checker"}) as rig:
        shots = {(s.role, s.pattern): s for s in CapturePlan().shots() if s.setting == 1}
        plan = CapturePlan()
        images = {
            "line": pattern_image(plan, shots["spectral", 160]),
            "column code (finest)": pattern_image(plan, shots["code", 18]),
            "row code (finest)": pattern_image(plan, shots["code", 36]),
            "colour checkerboard": checkerboard(),
        }

        def snap(image: NDArray[np.uint8]) -> None:
            rig.projector.show(image)
            rig.camera.snap()

        snap(images["line"])
        found = {name: median_s(lambda image=i: snap(image), repeat) for name, i in images.items()}  # type: ignore[misc]
    print_table(["frame of the twin, 890 x 580", "s"], [[n, f"{s:.3f}"] for n, s in found.items()])
    print(flush=True)
    return found


def median_s(work: Callable[[], None], repeat: int) -> float:
    """Median seconds of some repetitions."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def growth(folder: Path, quick: bool) -> dict[str, Any]:
    """Time and memory against pixels, bands and patterns."""
    few = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=4))
    size = SIZES_PX[1]
    found: dict[str, Any] = {}
    sizes = SIZES_PX[:2] if quick else SIZES_PX
    found["pixels"] = series(
        "pixels (47 bands, 159 lines)",
        {str(w * h): (make_session(folder / f"{w}x{h}.dsl", few, (w, h)), 5.0) for w, h in sizes},
    )
    if quick:
        return found
    middle = folder / f"{size[0]}x{size[1]}.dsl"
    found["bands"] = series(
        f"bands ({size[0]} x {size[1]}, 159 lines)",
        {str(round(230 / step) + 1): (middle, step) for step in STEPS_NM},
    )
    by_step = [few.model_copy(update={"spectral": ScanLines(step_px=step)}) for step in LINE_STEPS_PX]
    plans = {plan.spectral_count: plan for plan in by_step}
    found["patterns"] = series(
        f"line frames ({size[0]} x {size[1]}, 47 bands)",
        {
            str(n): (make_session(folder / f"{size[0]}x{size[1]}-lines{n}.dsl", p, size), 5.0)
            for n, p in plans.items()
        },
    )
    comb = few.model_copy(update={"spectral": LineComb()})
    found["comb"] = series(
        f"comb, dense solver ({size[0]} x {size[1]}, 47 bands)",
        {str(comb.spectral_count): (make_session(folder / f"{size[0]}x{size[1]}-comb.dsl", comb, size), 5.0)},
    )
    return found


def series(title: str, cases: Mapping[str, tuple[Path, float]]) -> dict[str, Any]:
    """Measure, print and fit one line of growth."""
    found = {at: in_process("growth", str(path), str(step)) for at, (path, step) in cases.items()}
    print_table(
        [title, "s", "CPU s", "MB more"],
        [[at, f"{f['seconds']:.2f}", f"{f['cpu_s']:.2f}", f"{f['used_mb']:.0f}"] for at, f in found.items()],
    )
    where = [float(at) for at in found]
    slopes = {key: exponent(where, [f[key] for f in found.values()]) for key in ("cpu_s", "used_mb")}
    if len(where) > 1:
        print(f"CPU time ~ n^{slopes['cpu_s']:.2f}, memory ~ n^{slopes['used_mb']:.2f}\n", flush=True)
    return {"cases": found, "exponents": slopes if len(where) > 1 else None}


def exponent(at: Sequence[float], values: Sequence[float]) -> float:
    """Slope of the values over the places, both as logarithms."""
    if len(at) < 2:
        return float("nan")
    return float(np.polyfit(np.log(at), np.log(np.maximum(values, 1e-9)), 1)[0])


def main() -> None:
    """Print all tables; ``--job`` is for the processes that this one starts."""
    parser = options(__doc__)
    parser.add_argument("--folder", type=Path, help="where the scans are kept (otherwise thrown away)")
    parser.add_argument(
        "--job", nargs="+", help="one measurement: read, save or growth; a session; nm a band"
    )
    arguments = parser.parse_args()
    if arguments.job:
        kind, session, *step = arguments.job
        print(json.dumps(job(kind, Path(session), float(step[0]) if step else 5.0)))
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder: Path = (arguments.folder or Path(temporary)).absolute()
        folder.mkdir(parents=True, exist_ok=True)
        figures = {
            "whole": None if arguments.quick else whole_scan(folder),
            "correspondence_s": correspondence_time(),
            "twin_frames_s": twin_frames(1 if arguments.quick else 5),
            "growth": growth(folder, arguments.quick),
        }
    write_json(arguments.json, figures)


if __name__ == "__main__":
    main()
