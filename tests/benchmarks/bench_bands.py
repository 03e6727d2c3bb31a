"""Time and peak memory of a reconstruction from disk to saved result, by the size of the picture.

``python -m tests.benchmarks.bench_bands [--sizes 445x290,890x580,...] [--settings 2] [--depth-only]
[--rows N] [--json FILE]``. Scans are made of a plane by formula (see `bench_growth`), a strip of rows
repeated down the picture, and written to a temporary folder; each is reconstructed in a process of its own,
whose processor seconds and largest resident memory, libraries included, are told. ``--rows`` ends each one
after so many rows of the result; by then its memory has reached its peak.
"""

from __future__ import annotations

import contextlib
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from tests.benchmarks.bench_growth import exponent, made_frames
from tests.benchmarks.common import options, print_table, write_json

#: .13, .52, 1.6, 3.15 and 12 megapixels.
SIZES = "445x290,890x580,1560x1040,2048x1536,4242x2828"
#: Rows that are made; the rest of the picture repeats them.
STRIP = 64


class Enough(Exception):
    """As many rows as were asked for are there."""


def write_scan(folder: Path, size: tuple[int, int], settings: int) -> Rig:
    """A scan of a size and the rig that took it."""
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines())
    first = len(plan.settings) - settings
    plan = plan.model_copy(
        update={"camera_size_px": size, "settings": plan.settings[first:], "code_settings": (0,)}
    )
    rows = min(STRIP, size[1])
    strip = made_frames(plan.model_copy(update={"camera_size_px": (size[0], rows)}))
    rig = strip.rig
    camera = rig.camera.model_copy(update={"height_px": size[1]})
    # Pixels of the strip are as wide as those of the picture, and lie around its middle.
    camera = camera.model_copy(update={"fy_px": camera.fx_px, "cy_px": size[1] / 2})
    with ScanWriter.create(folder, plan) as writer:
        for shot in plan.shots():
            mosaic = np.tile(strip.read(shot), (-(-size[1] // rows), 1))[: size[1]]
            writer.write(shot, Frame(mosaic, shot.exposure_ms, float(shot.index), shot.index + 1))
    return rig.model_copy(update={"camera": camera})


def measure(folder: Path, rig_file: Path, depth_only: bool, rows: int) -> dict[str, float]:
    """Seconds of a processor and peak memory of one reconstruction, and of merely reading its frames."""
    from dsl_core.io.result import row_writer
    from dsl_core.pipeline import Options
    from dsl_core.workflows.scans import reconstruct_to

    rig = Rig.model_validate_json(rig_file.read_text())
    began = time.process_time()
    put, made = row_writer.RowWriter.put, [0]

    def counting(writer: row_writer.RowWriter, band: slice, *given: Any) -> None:
        put(writer, band, *given)
        made[0] += band.stop - band.start
        if rows and made[0] >= rows:
            raise Enough

    with contextlib.suppress(Enough), patch.object(row_writer.RowWriter, "put", counting):
        reconstruct_to(folder.with_suffix(".zarr"), folder, rig, Options(spectra=not depth_only))
    spent, peak = time.process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    reader, began = ScanReader(folder), time.process_time()
    for shot in reader.plan.shots():
        reader.read(shot)
    width, height = reader.plan.camera_size_px
    return {
        "megapixels": width * height / 1e6,
        "frames": reader.plan.shot_count,
        "cpu_s": spent,
        "reading_s": time.process_time() - began,
        "peak_gb": peak / 1e6,
        "rows": made[0],
    }


def main() -> int:
    """Print a line for each size and the exponent of time."""
    parser = options(__doc__)
    parser.add_argument("--sizes", default=SIZES)
    parser.add_argument("--settings", type=int, default=2)
    parser.add_argument("--depth-only", action="store_true")
    parser.add_argument("--rows", type=int, default=0)
    parser.add_argument(
        "--measure", nargs=2, type=Path, help="scan and rig, for the processes that this starts"
    )
    given = parser.parse_args()
    if given.measure:
        scan, rig = given.measure
        print(json.dumps(measure(scan, rig, given.depth_only, given.rows)))
        return 0
    sizes = ["222x145", "445x290"] if given.quick else given.sizes.split(",")
    found = []
    for name in sizes:
        width, height = (int(side) for side in name.split("x"))
        with tempfile.TemporaryDirectory() as place:
            folder, rig_file = Path(place) / "scan.dsl", Path(place) / "rig.json"
            rig_file.write_text(write_scan(folder, (width, height), given.settings).model_dump_json())
            command = [sys.executable, "-m", "tests.benchmarks.bench_bands", "--rows", str(given.rows)]
            command += ["--depth-only"] if given.depth_only else []
            command += ["--measure", str(folder), str(rig_file)]
            told = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
        found.append(json.loads(told.splitlines()[-1]))
        print(found[-1], flush=True)
    header = list(found[0])
    print_table(header, [[f"{point[name]:.4g}" for name in header] for point in found])
    if len(found) > 1 and not given.rows:
        slope, std, _ = exponent([p["megapixels"] for p in found], [p["cpu_s"] for p in found])
        print(f"time grows with the pixels to the power of {slope:.2f} ± {std:.2f}")
    write_json(given.json, {"points": found})
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
