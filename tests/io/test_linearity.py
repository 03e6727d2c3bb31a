"""Scans say whether their values are linear in light, or why they cannot."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from dsl_core.io.linearity import _judged, linearity_of
from dsl_core.io.pictures.mapping import BlackPicture, Mapping, StripePictures, WhitePicture
from dsl_core.io.pictures.source import open_pictures
from dsl_core.optics.additivity import Additivity
from tests.cases.foreign_captures import PROJECTOR, write

CAPTURES = Path(os.environ.get("DSL_SHARED", "../shared")) / "data" / "procam_checkerboard" / "half_res"
PARTS = (StripePictures(bits=2), WhitePicture(), BlackPicture())


def test_absent_frames_and_sharp_stripes_leave_it_unknown(tmp_path: Path) -> None:
    half = np.where(np.arange(64) < 32, 200, 10) * np.ones((48, 1))
    pictures = [half, 210 - half, half, 210 - half, np.full((48, 64), 200), np.full((48, 64), 10)]
    write(tmp_path, {f"{k}.png": np.asarray(each, np.uint16) for k, each in enumerate(pictures)})
    scan = open_pictures(tmp_path, Mapping(parts=PARTS, projector_size_px=PROJECTOR))
    found = linearity_of(scan, 255, 0)
    assert (found.verdict, found.figures, found.is_wrong) == ("unknown", None, False)
    assert found.sentence.startswith("too few pixels see bright and dark stripes at once")
    for absent in ({4}, {0, 2}):
        assert linearity_of(scan, 255, 0, absent=absent).sentence.startswith("frames are missing")


SUM = "pattern and inverse together are 27.0 ± 1.0 % of the contrast {} than white and black together"


@pytest.mark.parametrize(
    ("excess", "exponent", "std", "verdict", "begins", "ends"),
    [
        (0.27, 1.1, 0.05, "linear", "linear in light: ", "where stripes meet"),
        (0.27, 2.1, 0.03, "srgb", "not linear in light but encoded, as sRGB", "to the power 2.1 ± 0.1"),
        (0.27, 2.9, 0.3, "srgb", "not linear in light but encoded, as sRGB", "to the power 2.9 ± 0.3"),
        (0.27, 1.45, 0.03, "encoded", "not linear in light, nor sRGB: ", "to the power 1.4 ± 0.1"),
        (0.27, float("nan"), float("nan"), "encoded", "not linear in light, nor", "where stripes meet"),
        (-0.27, 0.5, 0.03, "darker", "not linear in light: ", "to the power 0.5 ± 0.1"),
    ],
)
def test_verdicts_are_sentences_with_their_figures(
    excess: float, exponent: float, std: float, verdict: str, begins: str, ends: str
) -> None:
    found = _judged(Additivity(excess, 0.01, exponent, std, 6, 900))
    assert found.verdict == verdict
    assert found.is_wrong == (verdict != "linear")
    assert found.sentence.startswith(begins)
    assert SUM.format("brighter" if excess > 0 else "darker") in found.sentence
    assert found.sentence.endswith(ends)


@pytest.mark.slow
@pytest.mark.skipif(not CAPTURES.is_dir(), reason="the real captures of others are not here")
@pytest.mark.parametrize(("power", "verdict"), [(1.0, "linear"), (1 / 2.2, "srgb")])
def test_real_pictures_are_linear_until_they_are_encoded(tmp_path: Path, power: float, verdict: str) -> None:
    names = [*range(14, 20), 40, 41]
    for place, number in enumerate(names):
        path = CAPTURES / "capture_0" / f"graycode_{number:02d}.png"
        values = np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED)) / 255
        cv2.imwrite(str(tmp_path / f"{place}.png"), np.rint(values**power * 255))
    parts = (StripePictures(bits=3), WhitePicture(), BlackPicture())
    scan = open_pictures(tmp_path, Mapping(parts=parts, projector_size_px=(1024, 768)))
    found = linearity_of(scan, 255, 0)
    assert found.verdict == verdict
    assert found.figures is not None
    assert found.figures.exponent == pytest.approx(1 / power, rel=0.1)
    # The same pictures without inverses say the same.
    files = tuple(f"{place}.png" for place in (0, 2, 4, 6, 7))
    parts = (StripePictures(bits=3, inverse="none"), WhitePicture(), BlackPicture())
    scan = open_pictures(tmp_path, Mapping(files=files, parts=parts, projector_size_px=(1024, 768)))
    alone = linearity_of(scan, 255, 0)
    assert alone.verdict == verdict
    assert alone.figures is not None
    assert alone.figures.alone
    assert alone.figures.exponent == pytest.approx(1 / power, rel=0.1)
