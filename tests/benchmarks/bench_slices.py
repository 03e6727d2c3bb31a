"""How far slices of the spectrum are from slices of 1 nm, and what a frame costs, for patterns of any kind.

Run ``python -m tests.benchmarks.bench_slices [--quick] [--json FILE]`` from the repository's root.
Differences are in DN of an exposure of 1/3 s at drive level 0.8, of a Color Checker at 222 x 145 pixels;
times are CPU milliseconds of a frame on one core, the fastest of three.
"""

from __future__ import annotations

import time
from unittest.mock import patch

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import GrayCode, XorCode
from dsl_core.patterns.gray_code import code_image
from dsl_core.patterns.xor_code import xor_image
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.rendering.spectral_tables import BROAD, Slicing
from dsl_core.simulation.scenes.catalogue import make_scene
from tests.benchmarks.common import options, print_table, write_json

SIZE_PX, PROJECTOR_PX, LEVEL, EXPOSURE_MS = (222, 145), (640, 360), np.uint8(204), 1000 / 3
FINEST = Slicing(1, 1, 0.0)
CHOICES = (BROAD, Slicing(5, 10, 1e-3), Slicing(2, 5, 1e-3))
Image = NDArray[np.uint8]


def patterns() -> dict[str, Image]:
    """Drive levels of patterns that are no few white lines."""
    rng = np.random.default_rng(0)
    shape, columns = PROJECTOR_PX[::-1], np.arange(PROJECTOR_PX[0])

    def upright(levels: NDArray[np.integer]) -> Image:
        return np.broadcast_to(levels.astype(np.uint8), (shape[0], *levels.shape)).copy()

    return {
        "stripes of 2 px": upright(columns // 2 % 2 * LEVEL),
        "random columns": upright(rng.integers(0, LEVEL, shape[1])),
        "random colours": upright(rng.integers(0, LEVEL, (shape[1], 3))),
        "comb of 20 lines": upright((columns % 32 < 5) * LEVEL),
        "XOR code, a column bit": xor_image(XorCode(), PROJECTOR_PX, 4) & LEVEL,
        "XOR code, a row bit": xor_image(XorCode(), PROJECTOR_PX, 26) & LEVEL,
        "Gray code, a row bit": code_image(GrayCode(), PROJECTOR_PX, 30) & LEVEL,
    }


def renderer(slicing: Slicing) -> Renderer:
    """The renderer of a Color Checker with slices of some width."""
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(*SIZE_PX)})
    truth = make_scene("color-checker").render(rig.camera, rig.pose.projector_centre_mm)
    with patch("dsl_core.simulation.rendering.renderer.BROAD", slicing):
        return Renderer(rig, truth)


def seconds(view: Renderer, slicing: Slicing, image: Image) -> tuple[NDArray[np.float32], float]:
    """A frame, and CPU seconds that it takes."""
    runs = []
    with patch("dsl_core.simulation.rendering.renderer.BROAD", slicing):
        for _ in range(3):
            started = time.process_time()
            frame = view.expected(image)
            runs.append(time.process_time() - started)
    return frame, min(runs)


def main() -> None:
    """Print a row for each pattern and width."""
    chosen = options(__doc__).parse_args()
    torch.set_num_threads(1)
    images = patterns()
    finest = renderer(FINEST)
    wanted = {name: seconds(finest, FINEST, image)[0] for name, image in images.items()}
    rows = []
    for slicing in CHOICES[:1] if chosen.quick else CHOICES:
        view = renderer(slicing)
        for name, image in images.items():
            frame, taken = seconds(view, slicing, image)
            error = (frame - wanted[name]) * EXPOSURE_MS
            rms = float(np.sqrt(np.mean(error**2)))
            rows.append((name, slicing.nm, float(np.abs(error).max()), rms, 1e3 * taken))
    print_table(
        ("pattern", "slices, nm", "largest error, DN", "RMS, DN", "ms a frame"),
        [(name, nm, f"{most:.2f}", f"{rms:.3f}", f"{ms:.0f}") for name, nm, most, rms, ms in rows],
    )
    write_json(chosen.json, {"rows": rows})


if __name__ == "__main__":
    main()
