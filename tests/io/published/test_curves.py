"""Curves of devices that others measured: read by names or order, and refused where they cannot be meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.published.any_stereo import FoundStereo
from dsl_core.io.published.curves import load_curves
from dsl_core.io.published.stereo import Stereo
from dsl_core.io.published.stereo_rig import lenses_on
from tests.cases.small_rig import small_rig

NM = np.arange(420.0, 671, 5)
PEAKS = np.exp(-(((NM[:, None] - [610, 540, 460]) / 30) ** 2))


def table(tmp_path: Path, values: np.ndarray, header: str = "nm,R,G,B", nm: np.ndarray = NM) -> Path:
    path = tmp_path / "curves.csv"
    np.savetxt(path, np.c_[nm, values], "%.5f", ",", header=header, comments="")
    return path


def test_curves_are_told_by_names_or_order(tmp_path: Path) -> None:
    found = load_curves(table(tmp_path, 40 * PEAKS), "camera")
    assert [curve.wavelengths_nm[int(np.argmax(curve.values))] for curve in found.curves] == [610, 540, 460]
    assert max(max(curve.values) for curve in found.curves) == 1.0
    assert "by their names, centred at R 610 nm, G 540 nm, B 461 nm" in found.words
    swapped = load_curves(table(tmp_path, PEAKS[:, ::-1], "nm,blue,green,red"), "LEDs")
    assert swapped.curves[2].at(460) == pytest.approx(1, abs=1e-3)
    ordered = load_curves(table(tmp_path, PEAKS, "nm,one,two,three"), "LEDs")
    assert "in the order of their columns" in ordered.words
    mono = load_curves(table(tmp_path, PEAKS[:, 1:2], "nm,response"), "camera")
    assert mono.curves[0] == mono.curves[2]


def test_a_centre_does_not_depend_on_where_wavelengths_are_dense(tmp_path: Path) -> None:
    nm = np.r_[np.arange(420, 540, 1.0), np.arange(540, 671, 10.0)]
    peaks = np.exp(-(((nm[:, None] - [610, 540, 460]) / 30) ** 2))
    words = load_curves(table(tmp_path, peaks, nm=nm), "camera").words
    assert words.endswith("centred at R 610 nm, G 540 nm, B 461 nm")


@pytest.mark.parametrize(
    ("values", "header", "words"),
    [
        (PEAKS[:, ::-1], "nm,R,G,B", "red must have the longest"),
        (PEAKS[:, :2], "nm,R,G", r"has 2 curves \(R, G\); three curves, R, G, B are needed"),
        (PEAKS - 0.1, "nm,R,G,B", "negative by more than 2% of its largest"),
        (0.01 * (PEAKS - 0.1), "nm,R,G,B", "negative by more than 2% of its largest"),
        (0 * PEAKS, "nm,R,G,B", "contains values that are missing"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, values: np.ndarray, header: str, words: str) -> None:
    with pytest.raises(CalibrationError, match=words):
        load_curves(table(tmp_path, values, header), "LEDs")


def test_a_range_that_is_too_short_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="R covers 450 to 640 nm; 430 to 660 nm are needed"):
        load_curves(table(tmp_path, PEAKS[6:-6], nm=NM[6:-6]), "camera")


def test_a_rig_keeps_the_scale_of_its_base(tmp_path: Path) -> None:
    base = small_rig()
    found = FoundStereo(Stereo(camera=base.camera, projector=base.projector, pose=base.pose), {}, ())
    curves = load_curves(table(tmp_path, 40 * PEAKS), "LEDs")
    rig = lenses_on(base, found, "s.yml", None, curves)
    assert rig.response == base.response
    largest = [max(max(curve.values) for curve in each) for each in (base.emission, rig.emission)]
    assert largest[0] == pytest.approx(largest[1])
    assert "for depth alone; curves of the LEDs: curves.csv" in rig.provenance.notes
    assert "for depth alone" not in lenses_on(base, found, "s.yml", curves, curves).provenance.notes
