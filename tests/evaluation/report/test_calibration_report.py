"""The page about a calibrated rig says what was found, judges it, and stands alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from dsl_core.campaign.products import write_calibration_report
from dsl_core.evaluation.cost import StageCost
from dsl_core.evaluation.report.calibration_report import render_calibration_report
from dsl_core.evaluation.report.curves import HEIGHT
from dsl_core.model.calibration.accepted import AcceptedCalibration
from dsl_core.model.conditions import CameraConditions, CaptureConditions, ProjectorConditions
from dsl_core.model.figure import Figure
from dsl_core.model.rig import ColumnResidual, FlatField, Rig
from tests.cases.small_rig import small_rig

GOOD = Figure(name="gamma", value=2.21, std=0.004, unit="1", low=1.8, high=2.6)
BAD = Figure(name="held-out residual", value=0.41, unit="px", high=0.3, advice="Capture the stage <anew>.")
CONDITIONS = CaptureConditions(
    camera=CameraConditions(
        model="GS3", serial="C-17", size_px=(890, 580), region_px=(10, 20, 1780, 1160), binning=2,
        gain_db=3.0, bayer="RGGB", bit_depth=12,
    ),
    projector=ProjectorConditions(
        model="PH30N", serial="P-4", size_px=(640, 360), mode="6500 K", frame_period_ms=16.667
    ),
)  # fmt: skip


def calibrated() -> Rig:
    rig = small_rig()
    curve = rig.efficiency[1].model_copy(update={"std": (0.01, 0.01, 0.02)})
    return rig.model_copy(
        update={"name": "lab 3", "efficiency": {**rig.efficiency, 1: curve}, "conditions": CONDITIONS}
    )


def accepted(name: str, *figures: Figure, when: str = "2026-03-01T10:20:30.5+00:00") -> AcceptedCalibration:
    return AcceptedCalibration(
        name=name, title=name.capitalize(), accepted=when, captured=when, figures=figures,
        settings={"exposures": "166.7 ms at 0.2"},
    )  # fmt: skip


def test_it_holds_figures_limits_conditions_and_history() -> None:
    page = render_calibration_report(
        calibrated(),
        [accepted("selftest", GOOD), accepted("depth-stage", BAD)],
        [accepted("selftest", GOOD, when="2025-01-02T03:04:05+00:00")],
        [StageCost("Self-test", 12.0, 10**9, 0)],
    )
    assert "2.2100 ± 0.0040" in page
    assert "1.8 to 2.6" in page
    assert "at most 0.3" in page
    assert "1 of the key figures is outside the limits: Depth-stage: held-out residual 0.410 px" in page
    assert "Capture the stage &lt;anew&gt;." in page
    assert page.count("reached</span>") == page.count("missed</span>") == 1
    for word in ("C-17", "x 10 y 20, 1780 × 1160 px, binning 2", "mode 6500 K", "2025-01-02 03:04", "12.0"):
        assert word in page, word
    assert not re.search(r'(?:src|href)\s*=\s*"(?!data:)|@import|url\((?!#)', page)


def test_bands_show_the_standard_deviation() -> None:
    page = render_calibration_report(calibrated(), [accepted("bandpass", GOOD)])
    (band,) = re.findall(r'class="shade" points="([^"]+)"', page)
    points = np.array([[float(v) for v in pair.split(",")] for pair in band.split()])
    upper, lower = points[:3, 1], points[3:, 1][::-1]
    # The axis ends at 0.3; 1.96 standard deviations of 0.02 either side of the last value.
    np.testing.assert_allclose((lower - upper)[2], 2 * 1.96 * 0.02 / 0.3 * HEIGHT, rtol=0.01)
    assert "All key figures are within their limits." in page


def test_maps_show_evenness_and_what_the_grating_leaves() -> None:
    even = FlatField(rows_px=(0, 579), columns_px=(0, 889), gain=((1.0, 0.9), (0.9, 0.8)))
    left = ColumnResidual(
        orders=(-1, 1), column_range_px=(0, 889), row_range_px=(0, 579), depth_range_mm=(500, 1000),
        wavelength_range_nm=(430, 660), degrees=((1, 0, 0, 0), (0, 0, 0, 2)),
        coefficients_px=((0.5, 0.0), (0.25, 0.1)),
    )  # fmt: skip
    rig = calibrated().model_copy(update={"flat_field": even, "residual": left})
    page = render_calibration_report(rig, [accepted("geometry", GOOD)])
    assert page.count("data:image/png;base64,") == 3
    for words in ("Flat field", "Residual of order +1", "at 545 nm and 667 mm", "-0.49"):
        assert words in page, words


def test_it_is_written_whole_over_an_older_one(tmp_path: Path) -> None:
    for title in ("One", "Two"):
        named = accepted("selftest", GOOD).model_copy(update={"title": title})
        write_calibration_report(tmp_path / "report.html", calibrated(), (named,), ())
    assert "<h2>Two</h2>" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
