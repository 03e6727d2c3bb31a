"""What the benchmark scripts share: options, plain tables, JSON, and frames with noise of any size.

Scripts run from the repository's root, for example ``python -m tests.benchmarks.bench_depth --quick``.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Rig, Sensor
from dsl_core.optics.sensor import digitise
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.world import World


def options(description: str | None) -> argparse.ArgumentParser:
    """A parser with the options that every script has."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a small part of it, to see that it works")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures to a file")
    return parser


def print_table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print aligned columns: text to the left, numbers (already formatted) to the right."""
    cells = [[str(cell) for cell in row] for row in (header, *rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(header))]
    for row in cells:
        first = row[0].ljust(widths[0])
        print(
            "  ".join([first, *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))]),
            flush=True,
        )


def write_json(path: Path | None, figures: Mapping[str, Any]) -> None:
    """Write the figures when a file was asked for."""
    if path is not None:
        path.write_text(json.dumps(figures, indent=1), encoding="utf-8")


def as_on_screen(display: str) -> dict[str, str]:
    """An environment for a program on a display that starts as an installed one does: with its bytecode.

    The first start makes that, and the list of fonts; only the next one's times count.
    """
    kept = Path(tempfile.gettempdir()) / "dsl-scan-bytecode"
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"DISPLAY": display, "QT_QPA_PLATFORM": "xcb", "QT_API": "pyside6"}
    return {**environment, "PYTHONPYCACHEPREFIX": str(kept), "MPLCONFIGDIR": str(kept / "matplotlib")}


def with_noise(rig: Rig, sigma: float) -> Rig:
    """The rig with extra Gaussian noise, a share of full scale, on top of its own, and known to it."""
    noise_dn = float(np.hypot(rig.sensor.read_noise_dn, sigma * rig.sensor.full_scale_dn))
    return rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"read_noise_dn": noise_dn})})


def render_plan(world: World, plan: CapturePlan) -> list[NDArray[np.float32]]:
    """Expected signal of every shot of a plan, DN above black, without noise."""
    signals = []
    for shot in plan.shots():
        world.show(pattern_image(plan, shot))
        signals.append(world.rate() * np.float32(shot.exposure_ms))
    return signals


@dataclass(frozen=True)
class NoisyScan:
    """A scan whose noise is drawn when a frame is read: the same frame every time; a `FrameSource`."""

    plan: CapturePlan
    signals: list[NDArray[np.float32]]
    sensor: Sensor
    seed: int = 0

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The raw mosaic of a shot."""
        rng = np.random.Generator(np.random.SFC64([self.seed, shot.index]))
        return digitise(self.sensor, self.signals[shot.index], rng)
