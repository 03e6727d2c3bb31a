import json
from pathlib import Path

import numpy as np
import pytest

from dsl_core.analysis import pdf_report
from dsl_core.analysis.classes import class_of_pixels
from dsl_core.analysis.classification import classify_result
from dsl_core.analysis.session_report import _figure, session_content, write_report
from dsl_core.cli import main
from dsl_core.errors import StoreError
from dsl_core.evaluation.report.pictures import flag_picture
from dsl_core.evaluation.report.scan_report import pictures_of
from dsl_core.io.result.annotations_file import Annotations, PinRecord, RegionRecord, save_annotations
from dsl_core.io.result.result_file import save_result
from dsl_core.io.spectra.catalogue import read_spectra
from dsl_core.model.result import REASONS, Flag
from tests.cases.chart_cube import NM, chart_cube, chart_result

MARKS = Annotations(
    pins=(PinRecord(name="$sky_1$ <b>", pixel=(9, 40)), PinRecord(name="dark", pixel=(3, 95))),
    regions=(RegionRecord(name="häut 木", outline_px=((0, 17), (20, 17), (20, 30), (0, 30))),),
)


def test_a_report_holds_marks_colours_and_materials_as_page_and_on_paper(tmp_path: Path) -> None:
    result = chart_result()
    mask = np.zeros((96, 60), bool)
    mask[18:28, :20] = True
    skin = class_of_pixels("skin", result["reflectance"].values, result["reflectance_std"].values, mask)
    content = session_content("A <chart>", result, MARKS, classify_result(result, [skin]))
    page = write_report(content, tmp_path / "r.html").read_text(encoding="utf-8")
    names = ("A &lt;chart&gt;", "$sky_1$ &lt;b&gt;", "häut 木")
    for words in (*names, "Materials", "none of these", "LED-B3", "±"):
        assert words in page
    # Nothing is known of what nobody knows the truth of.
    assert "truth, where known" not in page
    # The pin on a pixel without light is told, and nothing else is lost.
    assert "dark: none of its 1 pixels has a spectrum" in page
    written = write_report(content, tmp_path / "r.pdf").read_bytes()
    assert written.startswith(b"%PDF")
    assert written.count(b"/Type /Page\n") + written.count(b"/Type /Page ") >= 4
    assert b"<chart>" in written
    with pytest.raises(StoreError, match="already exists"):
        write_report(content, tmp_path / "r.pdf")
    with pytest.raises(StoreError, match="does not end in"):
        write_report(content, tmp_path / "r.docx")


def test_a_report_of_one_band_draws_it_as_a_level_line(tmp_path: Path) -> None:
    content = session_content("one", chart_result().isel(wavelength_nm=[12]), MARKS)
    (curve, *_), (page, paper) = content.curves, (tmp_path / "r.html", tmp_path / "r.pdf")
    (_, left), (_, right) = (pair.split(",") for pair in curve.line.split())
    assert left == right
    assert len(curve.band.split()) == 4
    assert [(tick.at, tick.label) for tick in curve.x_ticks] == [(100.0, "550")]
    assert "550" in write_report(content, page).read_text(encoding="utf-8")
    assert write_report(content, paper).exists()


def test_a_known_deviation_of_a_colour_is_not_told_as_zero() -> None:
    figures = [_figure(41.0, std) for std in (0.42, 0.003, float("nan"), None)]
    assert figures == ["41.00 ± 0.42", "41.00 ± 0.01", "41.00", "41.00"]


def test_values_that_are_not_finite_are_left_out_of_a_report(tmp_path: Path) -> None:
    result = chart_result()
    for name in ("reflectance", "reflectance_std"):
        # Of a pin, and of a region.
        result[name][3, 40, 9] = np.inf
        result[name][5, 20, 4] = np.inf
    content = session_content("inf", result, MARKS)
    assert [len(curve.line.split()) for curve in content.curves] == [23, 24]
    assert all(len(curve.band.split()) == 2 * len(curve.line.split()) for curve in content.curves)
    assert write_report(content, tmp_path / "r.html").exists()


def test_a_legend_on_paper_is_whole_and_stays_on_its_page() -> None:
    flags = np.zeros((60, 90), np.uint32)
    for place, flag in enumerate(Flag):
        flags[place] = int(flag)
    content = session_content("all flags", chart_result(), Annotations())
    pictures = [*2 * pictures_of(content), flag_picture(flags, "Flags", "")]
    pages = list(pdf_report._picture_pages(pictures))
    texts = [text for page in pages for text in page.texts]
    told = " ".join(text.get_text() for text in texts)
    for flag in Flag:
        assert REASONS[flag] in told
    assert min(text.get_position()[1] for text in texts) > 0.02
    # The ends of a scale mean nothing without its colours.
    ends = [text.get_text() for text in texts if text.get_text().endswith(" mm")]
    bars = [axis for page in pages for axis in page.axes if axis.get_position().height < 0.02]
    assert len(bars) == len([each for each in pictures if each.gradient]) >= len(ends) / 2 > 0


def test_the_commands_tell_colours_and_write_reports(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save_result(chart_result(), tmp_path / "chart.zarr")
    save_annotations(MARKS.model_copy(update={"pins": MARKS.pins[:1]}), path)
    csv = tmp_path / "c.csv"
    assert main(["colours", str(path), "--pins", "--light", "A", "--to", "häut 木", "-o", str(csv)]) == 0
    told = capsys.readouterr().out
    assert "ΔE00" in told
    lines = csv.read_text(encoding="utf-8").splitlines()
    assert lines[-2].startswith("$sky_1$ <b>,A,")
    assert main(["report", str(path)]) == 0
    assert "häut 木" in (tmp_path / "chart_report.html").read_text(encoding="utf-8")
    for wrong, words in (
        (["colours", str(path)], "Say which places"),
        (["colours", str(path), "--pins", "--light", "candle"], "no light 'candle'"),
        (["report", str(path), "-o", "x.docx"], "must end in"),
    ):
        assert main(wrong) == 2
        assert words in capsys.readouterr().err


def test_a_report_names_materials_where_a_band_is_missing_and_says_what_was_left_out(tmp_path: Path) -> None:
    result, chart = chart_result(), chart_cube()
    result["reflectance"][3] = np.nan
    path = save_result(result, tmp_path / "lacking.zarr")
    table = [",".join(("nm", *chart.names[:2], "short"))]
    for nm, spectrum in zip(NM, chart.spectra[:2].T, strict=True):
        table.append(
            ",".join((f"{nm:g}", *(f"{value:.4f}" for value in spectrum), f"{0.3 if nm < 600 else ''}"))
        )
    library = tmp_path / "chart.csv"
    library.write_text("\n".join(table), "utf-8")
    page = tmp_path / "a.html"
    assert main(["report", str(path), "--library", str(library), "-o", str(page)]) == 0
    told = page.read_text("utf-8")
    assert "of the pixels were not judged" not in told
    assert "460 nm: left out" in told
    assert "short (chart.csv) is left out." in told


def test_the_command_tells_spectra_of_places_with_what_a_pixel_is_uncertain_by(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = chart_result()
    path = save_result(result, tmp_path / "chart.zarr")
    save_annotations(MARKS.model_copy(update={"pins": MARKS.pins[:1]}), path)
    csv = tmp_path / "s.csv"
    places = ["--pins", "--at", "a patch=2,2,3,4", "--at", "a pixel=5,4"]
    assert main(["spectra", str(path), *places, "-o", str(csv)]) == 0
    told = capsys.readouterr().out
    mean, std = (result[name].values[0, 4, 5] for name in ("reflectance", "reflectance_std"))
    row = next(line for line in told.splitlines() if line.startswith("430 "))
    assert row.split("  ")[-1].strip() == f"{mean:.4f} ± {std:.4f}"
    by_name = {each.name: each for each in read_spectra(csv)}
    assert list(by_name) == ["$sky_1$ <b>", "häut 木", "a patch", "a pixel"]
    patch = result["reflectance"].values[:, 2:6, 2:5].mean((1, 2))
    np.testing.assert_allclose(by_name["a patch"].values, patch, atol=1e-4)
    assert "# a pixel: pixel at column 5, row 4, counted from 0" in csv.read_text(encoding="utf-8")
    assert main(["spectra", str(path), "--at", "a pixel=5,4", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["spectra"]["a pixel"]
    assert listed["pixels"] == 1
    assert listed["reflectance_std"] == pytest.approx(
        result["reflectance_std"].values[:, 4, 5].tolist(), abs=1e-4
    )
    for wrong, words in (
        (["spectra", str(path)], "Say which places"),
        (["spectra", str(path), "--at", "5,4"], "--at must be NAME=X,Y"),
        (["spectra", str(path), "--at", "away=500,4"], "away"),
        (["spectra", str(path), *places, "-o", str(csv)], "already exists"),
    ):
        assert main(wrong) == 2
        assert words in capsys.readouterr().err


def test_a_result_of_depth_alone_has_a_report(tmp_path: Path) -> None:
    depth = chart_result().drop_vars(["reflectance", "reflectance_std", "data_share"])
    content = session_content("depth", depth, Annotations())
    assert "Depth" in write_report(content, tmp_path / "d.html").read_text(encoding="utf-8")
    write_report(content, tmp_path / "d.pdf")


def test_a_missing_band_takes_no_mark_out_of_a_report() -> None:
    result = chart_result()
    whole = session_content("whole", result, MARKS)
    missing = result.copy(deep=True)
    missing["reflectance"][23] = missing["reflectance_std"][23] = np.nan
    part = session_content("part", missing, MARKS)
    assert [curve.title for curve in part.curves] == [curve.title for curve in whole.curves]
    assert part.summary == whole.summary
    assert "nan" not in str(part.tables)
    assert all("nan" not in curve.line + curve.band for curve in part.curves)


def test_a_mark_without_the_green_has_no_colour_in_a_report_and_others_have() -> None:
    result = chart_result()
    (x, y), nm = MARKS.pins[0].pixel, result["wavelength_nm"]
    result["reflectance"][:, y, x] = result["reflectance"][:, y, x].where((nm < 490) | (nm > 600))
    content = session_content("part", result, MARKS)
    assert {row[0] for row in content.tables[0].rows} == {"häut 木"}
    assert "The bands of '$sky_1$ <b>', 430 to 660 nm, hold" in content.summary


@pytest.mark.parametrize("ending", [".html", ".pdf"])
def test_a_result_whose_name_is_not_in_utf_8_has_a_report(tmp_path: Path, ending: str) -> None:
    content = session_content("B\udce4ume", chart_result(), Annotations())
    assert content.title == "B\ufffdume"
    assert write_report(content, tmp_path / f"r{ending}").exists()


def test_a_report_on_a_disk_that_fills_up_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource", reason="the system limits no files")
    content = session_content("full", chart_result(), Annotations())
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        with pytest.raises(StoreError, match="could not be written"):
            write_report(content, tmp_path / "r.pdf")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("nm", [500.0, np.nan, None])
def test_a_result_whose_bands_have_no_wavelengths_of_their_own_has_no_report(nm: float | None) -> None:
    result = chart_result()
    same = result.assign_coords(wavelength_nm=np.full(result.sizes["wavelength_nm"], nm or 0.0))
    same = same.drop_vars("wavelength_nm") if nm is None else same
    with pytest.raises(StoreError, match=r"^leaf has a reflectance, but not one wavelength for each"):
        session_content("leaf", same, MARKS)
