"""Captures in the layouts of other programs: what a guess makes of each, and whether its columns are right.

Run ``python -m tests.benchmarks.bench_import [--quick] [--json FILE]`` from the repository's root. Every
layout is written as that program names, orders and stores its pictures: of a drawn scene, and of the real
captures in ``$DSL_SHARED/data/procam_checkerboard`` where these are. Each is imported by the guess alone
(drawn scenes with the size of the projector, real ones without) and by the mapping stated by hand. Columns
are compared with those of our own Gray code of the same scene: the share of pixels that have one in both and
agree to half a column (one and a half where the code is another), and the share that only ours has.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures.guess import guess_mapping
from dsl_core.io.pictures.mapping import (
    BlackPicture,
    Mapping,
    Part,
    PhasePictures,
    StripePictures,
    WhitePicture,
)
from dsl_core.io.pictures.picture_file import Picture, load_values
from dsl_core.io.pictures.source import open_pictures
from dsl_core.model.captured_code import Phases, Stripes
from dsl_core.workflows.captures import decode_columns_of, sensor_of
from tests.benchmarks.common import options, print_table, write_json
from tests.cases.foreign_captures import PROJECTOR, frames, write

Pictures = Sequence[NDArray[np.uint16]]
Sets = tuple[tuple[str, Stripes | Phases], ...]
Size = tuple[int, int]
W, B = WhitePicture(), BlackPicture()
GRAY: Sets = (("columns", Stripes(bits=7)), ("rows", Stripes(bits=7)))
REAL_PX = (1024, 768)


@dataclass(frozen=True)
class Layout:
    """How a program stores a capture: its patterns, names, order and format, and the mapping that says so."""

    name: str
    sets: Sets
    named: Callable[[Pictures, NDArray[np.uint16], NDArray[np.uint16]], dict[str, NDArray[np.uint16]]]
    parts: tuple[Part, ...]
    bits: int = 8
    tolerance_px: float = 0.5
    left_aligned: bool = False


@dataclass(frozen=True)
class Row:
    """Figures of a layout taken by the guess or by its mapping; shares are of the pixels that ours has."""

    layout: str
    by: str
    pictures: int
    agree: float
    lacking: float
    unsure: int
    seconds: float


def _in_order(form: str, *pictures: Pictures) -> dict[str, NDArray[np.uint16]]:
    flat = [picture for each in pictures for picture in each]
    return {form.format(i=i, j=i + 1): picture for i, picture in enumerate(flat)}


def _stripes(axis: str, **more: object) -> StripePictures:
    return StripePictures.model_validate({"axis": axis, "bits": 7, **more})


def _without_inverse(bits: int = 7) -> Sets:
    return (("columns", Stripes(bits=bits, inverse=False)), ("rows", Stripes(bits=bits, inverse=False)))


def _fringes(*counts: float, **more: object) -> Phases:
    periods = tuple(PROJECTOR[0] / count for count in counts)
    return Phases.model_validate({"periods_px": periods, "steps": 4, **more})


def _coloured(pictures: dict[str, NDArray[np.uint16]]) -> dict[str, NDArray[np.uint16]]:
    return {name: np.repeat(picture[..., None], 3, axis=2) for name, picture in pictures.items()}


LAYOUTS = (
    Layout(
        "OpenCV structured_light: pattern_cam1_im1.png, white and black last",
        GRAY,
        lambda f, w, b: _in_order("pattern_cam1_im{j}.png", f, [w, b]),
        (_stripes("columns"), _stripes("rows"), W, B),
    ),
    Layout(
        "3DUNDERWORLD-SLS: 0000.jpg, white and black first, colour JPEG",
        GRAY,
        lambda f, w, b: _coloured(_in_order("{i:04d}.jpg", [w, b], f)),
        (W, B, _stripes("columns"), _stripes("rows")),
        tolerance_px=1.5,
    ),
    Layout(
        "scan3d-capture, Moreno-Taubin: cam_00.png, white and black first",
        GRAY,
        lambda f, w, b: _in_order("cam_{i:02d}.png", [w, b], f),
        (W, B, _stripes("columns"), _stripes("rows")),
    ),
    Layout(
        "Lanman-Taubin mlStructuredLight: 01.bmp, white and black first",
        GRAY,
        lambda f, w, b: _in_order("{j:02d}.bmp", [w, b], f),
        (W, B, _stripes("columns"), _stripes("rows")),
    ),
    Layout(
        "Gray without inverse, 12 bit TIFF at the upper end, rows first",
        _without_inverse(),
        lambda f, w, b: _in_order(
            "img_{i}.tif", [np.left_shift(p, np.uint16(4)) for p in (*f[7:], *f[:7], w, b)]
        ),
        (_stripes("rows", inverse="none"), _stripes("columns", inverse="none"), W, B),
        bits=12,
        left_aligned=True,
    ),
    Layout(
        "Gray, least significant bit first, no white, no black",
        GRAY,
        lambda f, w, b: _in_order("scan{i}.png", [f[i ^ 1] for i in range(14)][::-1]),
        (_stripes("columns", first="least"),),
    ),
    Layout(
        "inverses after patterns, columns in one folder, lights in another",
        GRAY[:1],
        lambda f, w, b: _in_order("v/{i:02d}.png", f[0::2], f[1::2]) | {"a/w.png": w, "a/b.png": b},
        (B, W, _stripes("columns", inverse="after")),
    ),
    Layout(
        "binary code without inverse, black first",
        (("columns", Stripes(bits=7, code="binary", inverse=False)),),
        lambda f, w, b: _in_order("p{i}.pgm", [b], f, [w]),
        (B, _stripes("columns", code="binary", inverse="none"), W),
    ),
    Layout(
        "XOR-04 code with inverse (Gupta and others)",
        (("columns", Stripes(bits=7, code="xor", base_bit=1)),),
        lambda f, w, b: _in_order("xor_{i:03d}.png", [w, b], f),
        (W, B, _stripes("columns", code="xor", base_bit=1)),
    ),
    Layout(
        "SLStudio: three steps of one and sixteen periods",
        (("columns", Phases(periods_px=(128.0, 8.0), steps=3)),),
        lambda f, w, b: _in_order("frame_{i}.bmp", f, [w, b]),
        (PhasePictures(fringes=(1, 16), steps=3), W, B),
        tolerance_px=1.5,
    ),
    Layout(
        "fringe profilometry: four steps, frequencies 1, 8, 32, columns and rows, 16 bit arrays",
        (("columns", _fringes(1, 8, 32)), ("rows", Phases(periods_px=(96.0, 12.0, 3.0), steps=4))),
        lambda f, w, b: _in_order("phase_{i:02d}.npy", f),
        (PhasePictures(fringes=(1, 8, 32), steps=4), PhasePictures(axis="rows", fringes=(1, 8, 32), steps=4)),
        tolerance_px=1.5,
    ),
    Layout(
        "heterodyne: three frequencies told apart by their beat, sine",
        (("columns", _fringes(12, 11, 10, start_deg=-90)),),
        lambda f, w, b: _in_order("{i}.png", f),
        (PhasePictures(fringes=(12, 11, 10), steps=4, start_deg=-90),),
        tolerance_px=1.5,
    ),
    Layout(
        "Gray code of periods, then four steps",
        (
            ("columns", Stripes(bits=4, inverse=False, unit_px=8)),
            ("columns", Phases(periods_px=(16.0,), steps=4)),
        ),
        lambda f, w, b: _in_order("{i:02d}.png", f, [w, b]),
        (StripePictures(bits=4, inverse="none", unit_px=8), PhasePictures(fringes=(8,), steps=4), W, B),
        tolerance_px=1.5,
    ),
)
#: Real captures in other orders; they are 20 pictures of columns, 20 of rows, white, black.
REAL: tuple[tuple[str, Callable[[Pictures], Pictures], tuple[Part, ...]], ...] = (
    (
        "real, as captured (procam-calibration)",
        lambda p: p,
        (StripePictures(bits=10), StripePictures(axis="rows", bits=10), W, B),
    ),
    (
        "real, white and black first, rows before columns",
        lambda p: [p[40], p[41], *p[20:40], *p[:20]],
        (W, B, StripePictures(axis="rows", bits=10), StripePictures(bits=10)),
    ),
    (
        "real, without inverse",
        lambda p: [*p[0:20:2], *p[20:40:2], p[40], p[41]],
        (StripePictures(bits=10, inverse="none"), StripePictures(axis="rows", bits=10, inverse="none"), W, B),
    ),
    (
        "real, least significant bit first, columns only",
        lambda p: [p[i ^ 1] for i in range(20)][::-1],
        (StripePictures(bits=10, first="least"),),
    ),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; returns an exit code."""
    given = options(__doc__).parse_args(arguments)
    rows = [*_drawn(LAYOUTS[:2] if given.quick else LAYOUTS), *_real(quick=given.quick)]
    print_table(
        ("layout", "by", "pictures", "agree", "lacking", "unsure", "s"),
        [
            (r.layout, r.by, r.pictures, f"{r.agree:.4f}", f"{r.lacking:.4f}", r.unsure, f"{r.seconds:.1f}")
            for r in rows
        ],
    )
    write_json(given.json, {"rows": [asdict(row) for row in rows]})
    return 0


def _drawn(layouts: Sequence[Layout]) -> Iterator[Row]:
    with tempfile.TemporaryDirectory() as home:
        pictures, white, black = frames(GRAY)
        folder = write(Path(home) / "ours", _in_order("{i:02d}.png", pictures, [white, black]))
        ours = _columns(folder, _mapping((_stripes("columns"), _stripes("rows"), W, B), PROJECTOR))
        for number, layout in enumerate(layouts):
            named = layout.named(*frames(layout.sets, layout.bits))
            folder = write(Path(home) / f"set{number}", named, layout.bits)
            depth = layout.bits if layout.left_aligned else None
            mapping = _mapping(layout.parts, PROJECTOR).model_copy(
                update={"files": ("*", "*/*"), "bit_depth": depth, "left_aligned": layout.left_aligned}
            )
            yield from _rows(layout.name, folder, mapping, ours, layout.tolerance_px, PROJECTOR)


def _real(quick: bool) -> Iterator[Row]:
    root = Path(os.environ.get("DSL_SHARED", "../shared")) / "data" / "procam_checkerboard" / "half_res"
    if not root.is_dir():
        print(f"{root} is not there: real captures are left out.")
        return
    with tempfile.TemporaryDirectory() as home:
        for pose in sorted(root.iterdir())[: 1 if quick else 5]:
            paths = sorted(pose.iterdir())
            captured = [load_values(Picture(path)).astype(np.uint16) for path in paths]
            ours = _columns(pose, _mapping(REAL[0][2], REAL_PX))
            orders = REAL if pose.name == "capture_0" and not quick else REAL[:1]
            for number, (name, order, parts) in enumerate(orders):
                folder = write(
                    Path(home) / f"{pose.name}_{number}", _in_order("{i:02d}.png", order(captured))
                )
                mapping = _mapping(parts, REAL_PX)
                yield from _rows(f"{name}, {pose.name}", folder, mapping, ours, 0.5, None)


def _rows(
    name: str, folder: Path, mapping: Mapping, ours: NDArray[np.float32], limit_px: float, size: Size | None
) -> Iterator[Row]:
    start = time.perf_counter()
    try:
        guess = guess_mapping(folder, size)
    except StoreError as error:
        print(f"{name}: {error}")
        yield Row(name, "guess", 0, 0.0, 1.0, 0, time.perf_counter() - start)
    else:
        seconds = time.perf_counter() - start
        agree, lacking = _compared(_columns(folder, guess.mapping), ours, limit_px)
        yield Row(name, "guess", len(guess.table), agree, lacking, len(guess.mapping.unsure), seconds)
    start = time.perf_counter()
    agree, lacking = _compared(_columns(folder, mapping), ours, limit_px)
    yield Row(name, "mapping", 0, agree, lacking, 0, time.perf_counter() - start)


def _mapping(parts: tuple[Part, ...], size: Size) -> Mapping:
    return Mapping(parts=parts, projector_size_px=size)


def _columns(folder: Path, mapping: Mapping) -> NDArray[np.float32]:
    source = open_pictures(folder, mapping)
    return np.asarray(decode_columns_of(source, sensor_of(source))["column_px"].values, np.float32)


def _compared(found: NDArray[np.float32], ours: NDArray[np.float32], limit_px: float) -> tuple[float, float]:
    known = np.isfinite(ours)
    both = known & np.isfinite(found)
    agree = float(np.mean(np.abs(found[both] - ours[both]) <= limit_px)) if both.any() else 0.0
    return agree, float(1 - both.sum() / max(known.sum(), 1))


if __name__ == "__main__":
    raise SystemExit(main())
