"""Decode real captures with this engine and with OpenCV's getProjPixel: agreement and speed.

Run ``python tests/benchmarks/bench_gray_decode.py``; needs shared/data/procam_checkerboard
(or DSL_SHARED). OpenCV decodes every ``--step``-th pixel, its time is scaled to all of them.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import GrayCode
from dsl_core.patterns.gray_code import DecodedCode
from tests.cases.code_frames import decode

SHARED = Path(os.environ.get("DSL_SHARED", Path(__file__).parents[3] / "shared"))
PROJECTOR_PX = (1024, 768)
THRESHOLD = 5


def main() -> None:
    """Print agreement and the ratio of times for each pose and in total."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step", type=int, default=10, help="OpenCV decodes every n-th pixel")
    step: int = parser.parse_args().step
    theirs = cv2.structured_light.GrayCodePattern.create(*PROJECTOR_PX)
    theirs.setWhiteThreshold(THRESHOLD)
    sums = np.zeros(4)
    for folder in sorted((SHARED / "data" / "procam_checkerboard" / "half_res").glob("capture_*")):
        images = np.stack([_read(folder / f"graycode_{i:02d}.png") for i in range(40)])
        ours_s, found = min((_decode(images) for _ in range(5)), key=lambda timed: timed[0])
        pixels = np.arange(0, images[0].size, step)
        start = time.perf_counter()
        answers = _loop(theirs, list(images), pixels)
        theirs_s = (time.perf_counter() - start) * images[0].size / len(pixels)
        both, equal = _compare(found, pixels, answers)
        sums += (both, equal, ours_s, theirs_s)
        print(
            f"{folder.name}: {equal} of {both} pixels equal where both decide;"
            f" {1e3 * ours_s:.0f} ms here, {theirs_s:.1f} s OpenCV, ratio {theirs_s / ours_s:.0f}"
        )
    print(f"all: {sums[1]:.0f} of {sums[0]:.0f} equal, ratio {sums[3] / sums[2]:.0f}")


def _read(path: Path) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), np.uint8)


def _decode(images: NDArray[np.uint8]) -> tuple[float, DecodedCode]:
    start = time.perf_counter()
    found = decode(images[0::2], images[1::2], GrayCode(), PROJECTOR_PX, min_margin=THRESHOLD)
    return time.perf_counter() - start, found


def _loop(
    code: cv2.structured_light.GrayCodePattern, images: list[NDArray[np.uint8]], pixels: NDArray[np.int64]
) -> list[tuple[bool, Sequence[int]]]:
    width = images[0].shape[1]
    return [code.getProjPixel(images, int(i % width), int(i // width)) for i in pixels]


def _compare(
    found: DecodedCode, pixels: NDArray[np.int64], answers: list[tuple[bool, Sequence[int]]]
) -> tuple[int, int]:
    assert found.row is not None
    failed = np.array([a[0] for a in answers])
    theirs = np.array([a[1] for a in answers])
    ours = np.stack([found.column.ravel()[pixels], found.row.ravel()[pixels]], axis=1)
    both = ~failed & ~found.undecided.ravel()[pixels]
    return int(both.sum()), int((ours == theirs).all(axis=1)[both].sum())


if __name__ == "__main__":
    main()
