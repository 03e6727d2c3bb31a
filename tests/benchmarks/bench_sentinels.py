"""What changes of light and position during a scan do to a result, and what scan and result say of them.

    python -m tests.benchmarks.bench_sentinels [--quick] [--size 112x72] [--seeds 1] [--scenes color-checker]

Every change is brought into scans of the twin through wrapped devices and compared with the clean scan: depth
(median error and share of true depths inside the 95 % band), reflectance (error of single pixels and band),
and the sentences. ``--plain`` leaves the frames uncorrected, and ``--depth-only`` the spectra out.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.runner import Runner
from dsl_core.errors import DslError
from dsl_core.evaluation.summary import Truth
from dsl_core.evaluation.verdict import figures
from dsl_core.model.fit import ATTRIBUTE, Fit
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Sentinels
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.pipeline import Options, evaluate, reconstruct
from dsl_core.simulation.sim_devices import open_twin
from dsl_core.workflows.truths import twin_truth
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.changing_rig import Change, changing, from_shot, shifted
from tests.cases.memory_sink import MemorySink
from tests.cases.rendered_rig import RenderedScene, render, token_image


@dataclass(frozen=True)
class Case:
    """A change with a name."""

    name: str
    change: Change


def cases(plan: CapturePlan, seed: int) -> list[Case]:
    """The changes, at places that depend on the seed."""
    shots, rng = plan.shot_count, np.random.default_rng(seed)
    lines = next(shot.index for shot in plan.shots() if shot.role == "spectral")
    flicker = 1 + 0.1 * rng.uniform(-1, 1, shots)
    middle, in_code = int(rng.integers(lines + 5, shots - 10)), int(rng.integers(6, lines - 4))

    def after(at: int) -> Callable[[int], int]:
        moved = from_shot(at, 0, 1)
        return lambda shot: int(moved(shot))

    after_middle = after(middle)
    return [
        Case("clean", Change()),
        Case("light drifts 10 %", Change(light=lambda shot: 1 - 0.1 * shot / shots)),
        Case("light flickers ±10 %", Change(light=lambda shot: float(flicker[shot]))),
        Case("room light twice", Change(room=from_shot(middle, 1.0, 2.0))),
        Case("room light rises", Change(room=lambda shot: 1.0 + shot / shots)),
        Case("exposure halves", Change(exposure=from_shot(middle, 1.0, 0.5))),
        Case("camera 2 px after code", Change(scene=after(lines))),
        Case("camera 2 px within code", Change(scene=after(in_code))),
        Case("camera 2 px later", Change(scene=after(middle))),
        Case("object 2 mm", Change(scene=lambda shot: 2 * after_middle(shot))),
    ]


@dataclass
class Outcome:
    """What a scan and its result were."""

    said: str
    figures: dict[str, float]
    median_mm: float


def run(scenes: Sequence[RenderedScene], truth: Truth, case: Case, seed: int, opts: Options) -> Outcome:
    """Scan and reconstruct."""
    plan, rig = scenes[0].plan, scenes[0].calibration
    sink = MemorySink(plan)
    said = ""
    try:
        devices = changing(scenes, case.change, seed)
        status = Runner(devices, plan, sink, token_image, proof=FrameProof(plan, rig)).run()
        said = status.message.split(".", 1)[1].strip()
    except DslError as error:
        return Outcome(f"STOPPED: {error}", {}, float("nan"))
    result = reconstruct(sink, rig, opts)
    fit = Fit.model_validate_json(result.attrs[ATTRIBUTE])
    said = " ".join([said, *(f.sentence for f in fit.significant)])
    off_mm = np.abs(result["depth_mm"].values - truth.depth_mm)
    return Outcome(said, figures(evaluate(result, truth)), float(np.nanmedian(off_mm)))


NAMES = ("depth_coverage_95", "spectral_pixel_rmse", "spectral_rmse", "spectral_coverage_95")


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = options(__doc__)
    parser.add_argument("--size", default="112x72")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--scenes", default="color-checker")
    parser.add_argument("--step", type=int, default=2, help="columns from line to line")
    parser.add_argument("--only", default="", help="words that the names of the changes contain")
    parser.add_argument("--plain", action="store_true", help="without any correction")
    parser.add_argument("--depth-only", action="store_true")
    chosen = parser.parse_args(arguments)
    logging.disable(logging.WARNING)
    plan = CapturePlan(
        code=GrayCode(rows=False), spectral=ScanLines(step_px=chosen.step), sentinels=Sentinels()
    )
    opts = Options(spectra=not chosen.depth_only, as_calibrated=chosen.plain)
    found: dict[str, list[list[float]]] = {}
    for name in chosen.scenes.split(","):
        base = render(plan, scene=name, size=chosen.size)
        moved = render(plan, scene=name, size=chosen.size, depth_mm=str(700.0 + 2.0))
        scenes = [base, shifted(base, 2), moved]
        with open_twin({"scene": name, "size": chosen.size}) as rig:
            truth = twin_truth(rig, WavelengthGrid())
        assert truth is not None
        rows = []
        for seed in range(chosen.seeds):
            for case in cases(base.plan, seed):
                if not all(word in case.name for word in chosen.only.split()) and case.name != "clean":
                    continue
                out = run(scenes, truth, case, seed, opts)
                values = [out.median_mm, *(out.figures.get(key, float("nan")) for key in NAMES)]
                found.setdefault(f"{name}: {case.name}", []).append(values)
                rows.append((case.name, *(f"{value:.4f}" for value in values)))
                print(f"  {name} {seed} {case.name}: {out.said}", flush=True)
        print_table((name, "median mm", *NAMES), rows)
    write_json(chosen.json, found)


if __name__ == "__main__":
    main()
