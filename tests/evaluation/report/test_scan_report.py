"""The report holds what it claims, refers to nothing outside itself, and survives poor results."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from dsl_core.evaluation.cost import StageCost
from dsl_core.evaluation.report.curves import spectrum_curve
from dsl_core.evaluation.report.pictures import flag_picture, value_picture
from dsl_core.evaluation.report.scan_report import ReportContent, render_report, report_content
from dsl_core.evaluation.summary import evaluate
from dsl_core.evaluation.verdict import Goal, verdicts
from dsl_core.model.calibration.accepted import CalibrationNote, missed_attributes
from dsl_core.model.figure import Figure
from dsl_core.model.fit import Fit, FitFinding
from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import REASONS, Flag


class Page(HTMLParser):
    """Collects references and text, and checks that every tag is closed."""

    VOID = frozenset({"meta", "img", "br", "link", "stop", "line", "rect", "polyline", "polygon"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.references += [value or "" for name, value in attrs if name in ("src", "href", "srcset")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def pixels_of(uri: str) -> Any:
    return imread(BytesIO(base64.b64decode(uri.removeprefix("data:image/png;base64,"))))


@pytest.fixture
def full(known: Any) -> ReportContent:
    evaluation = evaluate(known.result, known.truth)
    return ReportContent(
        title="Scan of <a> & b",
        result=known.result,
        summary="All is known here.",
        evaluation=evaluation,
        truth=known.truth,
        verdicts=verdicts(evaluation, {"spectral_rmse": Goal(0.015)}),
        costs=[StageCost("decode", 1.5, 300_000_000, 1), StageCost("spectra", 4.5, 900_000_000, 1)],
        plan=CapturePlan(),
        provenance={"Rig": "published"},
        pixels=[(20, 10)],
    )


def test_full_report_is_one_well_formed_page(full: ReportContent) -> None:
    html = render_report(full)
    page = Page(html)
    assert full.verdicts[0].std
    assert full.verdicts[0].words in page.text
    assert "truth, where known" in html
    assert page.open == []
    assert page.references
    assert all(reference.startswith("data:image/png;base64,") for reference in page.references)
    assert "http" not in html.replace("http-equiv", "")
    assert re.search(r"\bnan\b", page.text, re.IGNORECASE) is None
    assert re.search(r'points="[^"]*nan', html) is None


def test_full_report_says_what_was_found(full: ReportContent) -> None:
    page = Page(render_report(full))
    for words in (
        "Scan of <a> & b",
        "All is known here.",
        "missed",
        "Error of depth",
        REASONS[Flag.NO_LIGHT],
        "filter",
        "Pixel 1",
        "6.00",
        "900",
        f"{CapturePlan().shot_count} (38 code, 318 spectral patterns)",
        "published",
    ):
        assert words in page.text
    assert REASONS[Flag.SATURATED] not in page.text


def test_what_does_not_fit_is_told_with_its_figure(known: Any) -> None:
    found = FitFinding(
        part="orders", name="gain", value=0.08, std=0.01, unit="1", limit=0.02, significant=True,
        sentence="Order +1 is 8 % brighter.", advice="Calibrate the orders again.",
    )  # fmt: skip
    noted = known.result.assign_attrs(fit=Fit.of([found]).model_dump_json())
    text = Page(render_report(report_content("Fit", noted, known.truth, evaluate(noted, known.truth)))).text
    for words in ("Look at the light of the diffraction orders", "0.08 ± 0.01", "brighter", "orders again"):
        assert words in text
    assert "findings" not in text
    # The verdict comes first; its figures, which few people read, after what was measured.
    told = [text.index(words) for words in ("Look at the light", "Pictures", "Spectra", "Fit of the model")]
    assert told == sorted(told)


def test_what_a_calibration_missed_is_told_and_not_as_provenance(known: Any) -> None:
    missed = CalibrationNote(
        name="geometry",
        title="Geometry",
        accepted="2026",
        figures=(Figure(name="camera error", value=0.6, unit="px", high=0.5),),
    )
    noted = known.result.assign_attrs(**missed_attributes([missed]))
    text = Page(render_report(report_content("x", noted, known.truth, evaluate(noted, known.truth)))).text
    assert "'Geometry' missed its limit: camera error 0.600 px (limit: at most 0.5 px)" in text
    assert "calibration missed" not in text


def test_both_themes_are_there(full: ReportContent) -> None:
    assert "prefers-color-scheme: dark" in render_report(full)


def test_depth_only_report(known: Any) -> None:
    html = render_report(ReportContent(title="Depth", result=known.result[["depth_mm", "flags"]]))
    page = Page(html)
    assert "Spectra" not in page.text
    assert len(page.references) == 2


def test_without_truth_pixels_of_a_grid_are_shown(known: Any) -> None:
    text = Page(render_report(ReportContent(title="Plain", result=known.result))).text
    # Eight places, two of them in shadow.
    assert len(re.findall(r"Pixel \d", text)) == 6


def test_colours_of_bands_that_the_eye_does_not_see_are_not_called_seen(known: Any) -> None:
    page = render_report(ReportContent("Plain", known.result))
    assert "as seen under daylight" in page
    nm = known.result["wavelength_nm"]
    infrared = render_report(ReportContent("Plain", known.result.assign_coords(wavelength_nm=nm + 300)))
    assert "as seen under daylight" not in infrared
    assert "hold too little of a colour" in infrared


def test_a_result_without_any_value_still_gives_a_page(known: Any) -> None:
    empty = known.result.copy(deep=True)
    for name in ("depth_mm", "depth_std_mm", "reflectance", "reflectance_std", "rgb"):
        empty[name].values[:] = np.nan
    page = Page(render_report(ReportContent(title="Nothing", result=empty)))
    assert page.open == []
    assert "Depth" in page.text


def test_value_picture_maps_values_to_colours_and_nan_to_nothing() -> None:
    values = np.tile(np.linspace(600.0, 700.0, 200), (20, 1))
    values[0, 0] = np.nan
    picture = value_picture(values, "Depth", "", "mm")
    rgba = pixels_of(picture.uri)
    assert rgba.shape == (20, 200, 4)
    assert rgba[0, 0, 3] == 0.0
    assert rgba[1, 0, 3] == 1.0
    # viridis runs from dark violet to bright yellow.
    np.testing.assert_allclose(rgba[1, 0, :3], [0.267, 0.005, 0.329], atol=0.01)
    np.testing.assert_allclose(rgba[1, -1, :3], [0.993, 0.906, 0.144], atol=0.01)
    assert picture.low == "601 mm"
    assert picture.high == "699 mm"


def test_signed_picture_is_centred_on_zero() -> None:
    picture = value_picture(np.linspace(-1.0, 3.0, 500)[None], "Error", "", "mm", "RdBu_r", symmetric=True)
    assert float(picture.low.split()[0]) == -float(picture.high.split()[0])


def test_flag_picture_shows_the_gravest_and_counts_all() -> None:
    flags = np.zeros((4, 4), np.int64)
    flags[0, 0] = Flag.NO_LIGHT | Flag.POOR_FIT
    flags[1, :2] = Flag.POOR_FIT
    flags[2, 0] = Flag.NO_LIGHT | Flag.NON_FINITE
    picture = flag_picture(flags, "Remarks", "")
    shares = {key.text: key.share for key in picture.keys}
    assert shares[REASONS[Flag.POOR_FIT]] == pytest.approx(3 / 16)
    assert shares[REASONS[Flag.NO_LIGHT]] == pytest.approx(2 / 16)
    assert shares["no flag"] == pytest.approx(12 / 16)
    colour = {key.text: key.colour for key in picture.keys}
    image = (pixels_of(picture.uri)[..., :3] * 255 + 0.5).astype(int)
    seen = "#{:02x}{:02x}{:02x}"
    assert seen.format(*image[0, 0]) == colour[REASONS[Flag.NO_LIGHT]]
    assert seen.format(*image[1, 0]) == colour[REASONS[Flag.POOR_FIT]]
    assert seen.format(*image[2, 0]) == colour[REASONS[Flag.NON_FINITE]]


def test_large_pictures_are_thinned() -> None:
    assert pixels_of(value_picture(np.zeros((30, 2500)), "", "", "").uri).shape == (10, 834, 4)


def test_pixels_of_a_part_are_named_as_in_the_whole_picture(full: ReportContent) -> None:
    shifted = full.result.assign_coords(x=full.result["x"] + 100, y=full.result["y"] + 50)
    said, whole = (
        set(re.findall(r"row (\d+), column (\d+)", Page(render_report(replace(full, result=each))).text))
        for each in (shifted, full.result)
    )
    assert whole
    assert said == {(str(int(row) + 50), str(int(column) + 100)) for row, column in whole}


def test_a_spectrum_of_infinite_deviation_is_drawn_without_a_band() -> None:
    bands = np.array([440.0, 450.0, 460.0])
    curve = spectrum_curve("x", "", bands, np.full(3, 0.5), np.full(3, np.inf))
    assert (len(curve.line.split()), curve.band) == (3, "")
