"""One flipped bit at random places of a result, a scan and a rig's file: told, harmless, or silently wrong.

``python -m tests.benchmarks.bench_flips [--result 1000] [--scan 1000] [--rig 200] [--old]`` scans a plane
with a small twin, reconstructs it, and flips bits in copies. Told: the reader refuses, or names the frame.
Harmless: everything reads as before. ``--old`` leaves out the checksums, as earlier versions did.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dsl_core import pipeline
from dsl_core.devices.registry import open_rig
from dsl_core.errors import DslError
from dsl_core.io.result.inventory import CHECKSUM, INVENTORY
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.io.rig_file import load_rig, save_rig
from dsl_core.io.scan.check import find_problems
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.sealed import unseal
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting
from tests.benchmarks.common import options, print_table, write_json

#: What a reader got, or the error that it ended in.
Read = Callable[[Path], Any]


def main() -> int:
    """Print the table; 1 when anything was read silently wrong, or did not end in a sentence."""
    parser = options(__doc__)
    for name, count in (("result", 1000), ("scan", 1000), ("rig", 200)):
        parser.add_argument(f"--{name}", type=int, default=count, help="flipped bits")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--old", action="store_true", help="without checksums")
    chosen = parser.parse_args()
    share = 0.02 if chosen.quick else 1.0
    rows, figures = [], {}
    with tempfile.TemporaryDirectory(prefix="dsl-flips-") as room:
        scan, result, rig = _make(Path(room))
        if chosen.old:
            _without_checksums(scan, result, rig)
        for path, read, count in (
            (result, read_result, chosen.result),
            (scan, read_scan, chosen.scan),
            (rig, read_rig, chosen.rig),
        ):
            found, worst = flip(path, read, int(count * share), np.random.default_rng(chosen.seed))
            figures[path.name] = dict(found)
            rows.append([path.name, *(found[each] for each in ENDINGS), "; ".join(worst[:3])])
    print_table(["file", *ENDINGS, "the first"], rows)
    write_json(chosen.json, figures)
    return int(any(found["wrong"] or found["crash"] for found in map(Counter, figures.values())))


ENDINGS = ("told", "harmless", "wrong", "crash")


def flip(path: Path, read: Read, count: int, rng: np.random.Generator) -> tuple[Counter[str], list[str]]:
    """How readings end after each of ``count`` flips, and where those were that must not be."""
    files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
    files = [each for each in files if each.name != "lock" and each.stat().st_size]
    sizes = np.array([each.stat().st_size for each in files], float)
    # Half of the flips fall on bytes, half on files: metadata are small, and most of what can go wrong.
    weights = 0.5 * sizes / sizes.sum() + 0.5 / len(files)
    whole, found, worst = read(path), Counter[str](), list[str]()
    for number in rng.choice(len(files), count, p=weights):
        file = files[number]
        data = file.read_bytes()
        place = int(rng.integers(0, 8 * len(data)))
        flipped = bytearray(data)
        flipped[place // 8] ^= 1 << place % 8
        file.write_bytes(flipped)
        try:
            ending = "harmless" if read(path) == whole else "wrong"
        except DslError:
            ending = "told"
        except Exception as error:
            ending = "crash"
            worst.append(f"{type(error).__name__}")
        file.write_bytes(data)
        found[ending] += 1
        if ending in ("wrong", "crash"):
            worst.append(f"{file.relative_to(path.parent)} bit {place}")
    return found, worst


def read_result(path: Path) -> Any:
    """Everything that a result holds, to the bit."""
    result = load_result(path, lazy=False)
    arrays = {
        str(n): (v.dims, v.dtype.str, v.values.tobytes(), repr(v.attrs)) for n, v in result.variables.items()
    }
    return arrays, repr(dict(result.attrs))


def read_scan(path: Path) -> Any:
    """Everything that a scan holds; a frame or a line that is named as wrong is an error."""
    reader = ScanReader(path)
    if problems := find_problems(reader, verify=True):
        raise DslError(problems[0])
    frames = [reader.read(shot).tobytes() for shot in reader.plan.shots()]
    return reader.manifest, reader.entries, frames


def read_rig(path: Path) -> Any:
    """The rig."""
    return load_rig(path)


def _make(room: Path) -> tuple[Path, Path, Path]:
    devices = open_rig("twin", {"size": "112x72", "scene": "plane"})
    plan = CapturePlan(
        camera_size_px=(112, 72),
        code=GrayCode(rows=False),
        spectral=ScanLines(width_px=5, step_px=4),
        settings=(Setting(exposure_ms=160, level=0.5),),
        code_settings=(0,),
    )
    pipeline.scan(devices, plan, room / "scan.dsl")
    reader = ScanReader(room / "scan.dsl")
    assert reader.calibration is not None
    result = pipeline.reconstruct(reader, reader.calibration)
    save_result(result, room / "result.zarr")
    return room / "scan.dsl", room / "result.zarr", save_rig(reader.calibration, room / "rig.json")


def _without_checksums(scan: Path, result: Path, rig: Path) -> None:
    import xarray as xr

    for path in (rig, scan / "manifest.json"):
        path.write_bytes(unseal(path.read_bytes()))
    log = scan / "frames.jsonl"
    log.write_bytes(b"".join(unseal(line) + b"\n" for line in log.read_bytes().splitlines()))
    with xr.open_zarr(result, chunks=None, consolidated=False, mask_and_scale=False) as stored:
        plain = stored.load()
    shutil.rmtree(result)
    for variable in plain.variables.values():
        variable.encoding.clear()
    plain.drop_attrs(deep=False).to_zarr(result, zarr_format=3, consolidated=False)
    content = json.loads((result / "zarr.json").read_text())
    content["attributes"] = {k: v for k, v in plain.attrs.items() if k not in (CHECKSUM, INVENTORY)}
    (result / "zarr.json").write_text(json.dumps(content))


if __name__ == "__main__":
    raise SystemExit(main())
