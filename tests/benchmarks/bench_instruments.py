"""Stages and spectroradiometers against emulators on a pseudo-terminal, with every fault at every place.

``python -m tests.benchmarks.bench_instruments [--seeds 20] [--json FILE]`` needs pyserial and a system with
pseudo-terminals. A fault begins at an answer that the seed draws. Each attempt ends right (the value is that
of the emulator), stopped (with a reason), or wrong; 1 is returned when one is wrong.
"""

from __future__ import annotations

import heapq
import os
import pty
import random
import select
import threading
import time
import tty
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dsl_core.devices.drivers.jeti_specbos import JetiSettings, JetiSpecbos, Patience
from dsl_core.devices.drivers.serial_line import open_line
from dsl_core.devices.drivers.thorlabs_lts import LtsSettings, ThorlabsLts, Timing
from tests.benchmarks.common import options, print_table, write_json
from tests.devices.emulators.jeti import JETI_FAULTS, Jeti, radiance
from tests.devices.emulators.lts import STAGE_FAULTS, Lts
from tests.devices.emulators.ports import FAULTS, Faulty, Instrument, ends

TARGET_MM = 75.0
#: Instruments answer quickly here, so that hundreds of attempts take minutes.
TIMING = Timing(answer_s=0.15, poll_s=0.01, stalled_s=0.2, home_s=2.0)
PATIENCE = Patience(answer_s=0.15, spectrum_s=0.3, measure_s=0.4)


def main() -> int:
    """Print a line per instrument and fault."""
    parser = options(__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    chosen = parser.parse_args()
    seeds = 2 if chosen.quick else chosen.seeds
    rows, found, wrong = [], {}, 0
    for name, attempt, own in (
        ("stage", stage_ends, STAGE_FAULTS),
        ("spectroradiometer", jeti_ends, JETI_FAULTS),
    ):
        for fault in ("none", *FAULTS, *own):
            begun = time.monotonic()
            counted = Counter(attempt(fault, seed) for seed in range(seeds))
            bad = {key: n for key, n in counted.items() if key not in ("right", "stopped")}
            wrong += sum(bad.values())
            seconds = (time.monotonic() - begun) / seeds
            rows.append(
                [name, fault, counted["right"], counted["stopped"], sum(bad.values()), f"{seconds:.2f}"]
            )
            found[f"{name}: {fault}"] = dict(counted)
            for key in bad:
                print(f"{name}, {fault}: {key}", flush=True)
    print_table(["instrument", "fault", "right", "stopped", "wrong", "s each"], rows)
    write_json(chosen.json, found)
    return int(wrong > 0)


def stage_ends(fault: str, seed: int) -> str:
    """Open a stage and move it."""
    inner = Lts(fault if fault in STAGE_FAULTS else "", mm_s=200.0)

    def act(port: str) -> float:
        with ThorlabsLts(
            open_line(port, "The stage", 115_200, True), LtsSettings(port=port), TIMING
        ) as stage:
            reached = stage.move_to(TARGET_MM)
        there = inner.position_mm(time.monotonic())
        return reached if abs(there - reached) < 0.02 else float("nan")

    return _ending(
        inner, fault in STAGE_FAULTS, fault, seed, act, lambda mm: abs((mm or 0) - TARGET_MM) < 0.02
    )


def jeti_ends(fault: str, seed: int) -> str:
    """Open a spectroradiometer and measure."""
    inner = Jeti(fault if fault in JETI_FAULTS else "", measure_s=0.05)

    def act(port: str) -> float:
        settings = JetiSettings(port=port, most_exposure_ms=100)
        line = open_line(port, "The spectroradiometer", 115_200)
        with JetiSpecbos(line, settings, PATIENCE) as instrument:
            instrument.identify()
            instrument.set_up()
            curve = instrument.measure()
        return max(abs(v - radiance(nm)) for nm, v in zip(curve.wavelengths_nm, curve.values, strict=True))

    return _ending(
        inner, fault in JETI_FAULTS, fault, seed, act, lambda off: (1 if off is None else off) < 1e-7
    )


def _ending(
    inner: Instrument,
    is_own: bool,
    fault: str,
    seed: int,
    act: Callable[[str], float],
    is_right: Callable[[float | None], bool],
) -> str:
    at = random.Random(seed).randrange(1, 12)
    line = inner if is_own or fault == "none" else Faulty(inner, fault, at, seed)
    with terminal(line) as port:
        return ends(lambda: act(port), is_right)


@contextmanager
def terminal(instrument: Instrument) -> Iterator[str]:
    """The name of a pseudo-terminal behind which an instrument answers; it hangs up when it is dropped."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    name = os.ttyname(slave)
    is_over = threading.Event()
    server = threading.Thread(target=_serve, args=(instrument, master, slave, is_over), daemon=True)
    server.start()
    try:
        yield name
    finally:
        is_over.set()
        server.join()


def _serve(instrument: Instrument, master: int, slave: int, is_over: threading.Event) -> None:
    coming: list[tuple[float, int, bytes]] = []
    count = 0
    try:
        while not is_over.is_set() and not getattr(instrument, "is_dropped", False):
            if select.select([master], [], [], 0.002)[0]:
                for when, answer in instrument.take(os.read(master, 4096), time.monotonic()):
                    count += 1
                    heapq.heappush(coming, (when, count, answer))
            while coming and coming[0][0] <= time.monotonic():
                os.write(master, heapq.heappop(coming)[2])
    finally:
        os.close(slave)
        os.close(master)


if __name__ == "__main__":
    raise SystemExit(main())
