"""How well a scan notices pictures that do not show their pattern.

    python -m tests.benchmarks.bench_proof [--quick] [--size 112x72] [--seeds 20] [--scenes box,face]

First one fault a scan, of every kind and at random shots: how scans end. Then scans in which every tenth
picture is wrong, to count what is missed, and clean ones, to count false alarms. A wrong picture that differs
from the right one by less than the noise, such as of a line beside the picture, is counted apart.
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.runner import Runner
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.simulation.scenes.catalogue import scene_catalogue
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.memory_sink import MemorySink
from tests.cases.pattern_faults import LASTING, SINGLE, PatternFault, PatternFaults
from tests.cases.rendered_rig import RenderedScene, render, token_image

#: Pixels that differ by so many deviations make a wrong picture visible; the proof needs some of its own.
VISIBLE_SIGMAS, VISIBLE_PIXELS = 6.0, 24


@dataclass
class Ended:
    """How a scan ended: frames kept, ``wrong`` ones among them, how many of these one could see."""

    stopped: str
    corrected: int
    wrong: list[tuple[int, PatternFault]]
    visible: list[tuple[int, PatternFault]]
    exposures: int
    seconds: float


class _Timed(FrameProof):
    seconds, false, judged = 0.0, 0, 0

    def judge(self, shot, pixels):  # type: ignore[no-untyped-def]
        start = time.process_time()
        found = super().judge(shot, pixels)
        self.seconds += time.process_time() - start
        self.judged += 1
        return found


def scan(scene: RenderedScene, faults: tuple[PatternFault, ...], seed: int) -> Ended:
    """One scan with faults."""
    rig = scene.open(seed)
    spoiled = PatternFaults(rig, scene.plan, token_image, faults)
    proof, sink = _Timed(scene.plan, scene.calibration), MemorySink(scene.plan)
    runner = Runner(spoiled.rig, scene.plan, sink, token_image, proof=proof)
    stopped = ""
    try:
        runner.run()
    except DeviceError as error:
        stopped = str(error)
    wrong = [
        (index, spoiled.wrong[frame.frame_id])
        for index, frame in sorted(sink.frames.items())
        if frame.frame_id in spoiled.wrong
    ]
    shots = tuple(scene.plan.shots())
    seen = [each for each in wrong if _is_visible(scene, shots[each[0]], sink.frames[each[0]])]
    return Ended(stopped, runner._shots.corrected, wrong, seen, proof.judged, proof.seconds)


def _is_visible(scene: RenderedScene, shot, frame: Frame) -> bool:  # type: ignore[no-untyped-def]
    """Whether a picture differs from the one asked for by more than noise."""
    sensor = scene.calibration.sensor
    light = scene.rates[token_image(scene.plan, shot).tobytes()] * np.float32(shot.exposure_ms)
    wanted = np.minimum(light + sensor.black_level_dn, sensor.full_scale_dn)
    sigma = np.sqrt(light / sensor.electrons_per_dn + sensor.read_noise_dn**2 + 0.1)
    apart = np.abs(frame.pixels - wanted) > VISIBLE_SIGMAS * sigma
    return int(apart.sum()) >= VISIBLE_PIXELS


def _named(scene: RenderedScene, ended: Ended) -> str:
    shots = tuple(scene.plan.shots())
    each = [
        f"{fault.kind} {index}={shots[index].role} {shots[index].pattern}/{shots[index].setting}"
        for index, fault in ended.visible[:5]
    ]
    return f"{len(ended.wrong)}, visible {len(ended.visible)}: {'; '.join(each)}"


def kind_of_end(ended: Ended, fault: PatternFault) -> str:
    """One of the columns of the first table."""
    if ended.stopped:
        return "stopped"
    if ended.visible:
        return "WRONG"
    if ended.wrong:
        return "unseen"
    return "corrected" if ended.corrected else "right"


def single_faults(scenes: dict[str, RenderedScene], seeds: int) -> dict[str, Counter[str]]:
    """How scans with one fault each end."""
    table: dict[str, Counter[str]] = {kind: Counter() for kind in (*SINGLE, *LASTING)}
    for name, scene in scenes.items():
        for number, kind in enumerate((*SINGLE, *LASTING)):
            for seed in range(seeds):
                rng = np.random.default_rng((seed, number, sum(name.encode())))
                at = int(rng.integers(1, scene.plan.shot_count - 1))
                fault = PatternFault(kind, at, float(rng.uniform(0.1, 0.9)))
                ended = scan(scene, (fault,), seed)
                how = kind_of_end(ended, fault)
                table[kind][how] += 1
                if how == "WRONG" or (how == "stopped" and kind in SINGLE):
                    print(
                        f"  {name} seed {seed} {fault}: {how} {_named(scene, ended)} {ended.stopped}",
                        flush=True,
                    )
    return table


def many_faults(scenes: dict[str, RenderedScene], seeds: int, every: int = 10) -> dict[str, Counter[str]]:
    """Of many wrong pictures, how many were kept."""
    table: dict[str, Counter[str]] = {kind: Counter() for kind in SINGLE}
    for name, scene in scenes.items():
        for seed in range(seeds):
            rng = np.random.default_rng((seed, 77, sum(name.encode())))
            places = range(2, scene.plan.shot_count - 2, every)
            faults = tuple(
                PatternFault(
                    str(rng.choice(SINGLE)), at + int(rng.integers(0, every // 2)), rng.uniform(0.1, 0.9)
                )
                for at in places
            )
            ended = scan(scene, faults, seed)
            for fault in faults:
                table[fault.kind]["pictures"] += 1
            for _, fault in ended.wrong:
                table[fault.kind]["kept"] += 1
            for _, fault in ended.visible:
                table[fault.kind]["seen"] += 1
            print(f"  {name} seed {seed}: kept {_named(scene, ended)} {ended.stopped}", flush=True)
    return table


def clean(scenes: dict[str, RenderedScene], seeds: int) -> tuple[int, int, int, float]:
    """Scans, pictures, false alarms among them, and seconds a picture."""
    scans = pictures = alarms = 0
    seconds = 0.0
    for name, scene in scenes.items():
        for seed in range(1000, 1000 + seeds):
            ended = scan(scene, (), seed)
            scans += 1
            pictures += ended.exposures
            alarms += ended.corrected + bool(ended.stopped)
            seconds += ended.seconds
            if ended.corrected or ended.stopped:
                print(f"  false alarm: {name} seed {seed}, {ended.corrected} {ended.stopped}", flush=True)
    return scans, pictures, alarms, seconds / max(pictures, 1)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables."""
    parser = options(__doc__)
    parser.add_argument("--size", default="112x72")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--scenes", default="")
    parser.add_argument("--step", type=int, default=2, help="columns from line to line")
    parser.add_argument("--option", action="append", default=[], help="of the twin, such as brightness=0.2")
    chosen = parser.parse_args(arguments)
    logging.disable(logging.WARNING)
    names = [entry.name for entry in scene_catalogue()]
    names = chosen.scenes.split(",") if chosen.scenes else names[:2] if chosen.quick else names
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=chosen.step))
    more = dict(each.split("=") for each in chosen.option)
    scenes = {name: render(plan, scene=name, size=chosen.size, **more) for name in names}
    seeds = 1 if chosen.quick else chosen.seeds
    scans, pictures, alarms, seconds = clean(scenes, seeds)
    print(f"{scans} clean scans of {pictures} pictures: {alarms} false alarms; {1e3 * seconds:.2f} ms a shot")
    one = single_faults(scenes, seeds)
    ends = ("right", "corrected", "stopped", "unseen", "WRONG")
    print_table(("fault", *ends), [(kind, *(row[end] for end in ends)) for kind, row in one.items()])
    many = many_faults(scenes, seeds)
    rows = [(kind, row["pictures"], row["kept"] - row["seen"], row["seen"]) for kind, row in many.items()]
    print_table(("of many", "pictures", "unseen", "WRONG"), rows)
    write_json(
        chosen.json,
        {"clean": [scans, pictures, alarms, seconds], "one": {k: dict(v) for k, v in one.items()}},
    )


if __name__ == "__main__":
    main()
