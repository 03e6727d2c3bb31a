"""Which columns of a table are spectra: by whole words of their titles, and not by letters in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.columns import read_columns
from dsl_core.io.spectra.reference_file import read_references
from dsl_core.io.spectra.units import quantity_of

NM = np.arange(400, 701, 10)
LEAF = 0.2 + 0.1 * np.sin(NM / 50)
#: Titles of columns that are neither spectra nor wavelengths.
_ASIDE = ("std", "Wavelength error")


def table(path: Path, titles: str, *columns: np.ndarray) -> Path:
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([titles, *(",".join(f"{value:g}" for value in row) for row in rows)]))
    return path


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        ("wavelength,camouflage,grass", ["camouflage", "grass"]),
        ("nm,No. 1 red,pixel 2", ["No. 1 red", "pixel 2"]),
        ("nm,microwave dish,mechanical part", ["microwave dish", "mechanical part"]),
        ("nm,Terror red,Red error", ["Terror red"]),
        ("nm,leaf,leaf_std", ["leaf"]),
        ("Wavelength (nm),R,U (k=2)", ["R"]),
        ("Wavelength (nm),R(λ),u(R)", ["R(λ)"]),
        ("λ (nm),ρ(λ),U", ["ρ(λ)"]),
        ("lambda (nm),R(lambda),T(lambda)", ["R(lambda)", "T(lambda)"]),
        ("nm,T,U", ["T"]),
        ("nm,L_λ [W/m2/sr/nm]", ["L_λ [W/m2/sr/nm]"]),
        ("Lambda (nm),Eλ,Δλ", ["Eλ"]),
        ("λ (nm),R_lambda,dλ,Δλ,FWHM_λ", ["R_lambda"]),
        ("nm,S,U", ["S", "U"]),
        ("nm,ref +/- 5,paint k=2", ["ref +/- 5", "paint k=2"]),
        ("nm,Reflectance,StDev", ["Reflectance"]),
        ("nm,R,2σ,Unc.,ΔR,uc(R)", ["R"]),
        ("nm,leaf SNR 40,bandwidth 5 nm", ["leaf SNR 40", "bandwidth 5 nm"]),
        ("nm,leaf,SNR (dB),FWHM (nm)", ["leaf"]),
        (
            "nm,absorptive black,K/S paper,optical density filter",
            ["absorptive black", "K/S paper", "optical density filter"],
        ),
        ("nm,Leaf (A),s", ["Leaf (A)", "s"]),
        ("nm,leaf,leafStd", ["leaf"]),
        ("nm,Channel,leaf", ["leaf"]),
        ("pixel number,nm,leaf", ["leaf"]),
    ],
)
def test_columns_are_left_out_by_whole_words(titles: str, names: list[str], tmp_path: Path) -> None:
    columns = [NM if "nm" in title or "wavel" in title else LEAF for title in titles.split(",")]
    found = read_columns(table(tmp_path / "some.csv", titles, *columns))
    assert [each.name for each in found] == names


@pytest.mark.parametrize("titles", ["R1,nm,R2,nm", "nm,R1,nm,R2", "X,R1,X,R2"])
def test_each_spectrum_of_pairs_has_its_own_wavelengths_wherever_these_are(
    titles: str, tmp_path: Path
) -> None:
    values = iter((LEAF, LEAF / 2))
    axes = iter((NM, NM + 5))
    columns = [next(values) if "R" in title else next(axes) for title in titles.split(",")]
    found = read_columns(table(tmp_path / "some.csv", titles, *columns))
    assert [(each.name, each.nm[0]) for each in found] == [("R1", 400), ("R2", 405)]
    np.testing.assert_allclose(found[1].values, LEAF / 2, rtol=1e-4)


def test_a_column_that_counts_rows_under_no_title_is_no_spectrum(tmp_path: Path) -> None:
    """It would pass for percent, and make the others a hundred times too dark."""
    path = table(tmp_path / "frame.csv", ",wavelength,leaf,bark", np.arange(NM.size), NM, LEAF, LEAF / 2)
    found = read_references(path)
    assert [each.name for each in found.references] == ["leaf", "bark"]
    assert found.as_percent is None
    assert found.references[0].curve.values[0] == pytest.approx(LEAF[0], rel=1e-5)


@pytest.mark.parametrize(
    ("header", "titles", "scale"),
    [
        ("Y unit: % reflectance", "Wavelength,Reflectance", 0.01),
        ("Y unit: % reflectance", "Wavelength,R", 0.01),
        ("Unit: %", "Wavelength,Reflectance", 0.01),
        ("Reflectance 0-100 %", "Wavelength,sample", 0.01),
        ("Reflectance, 0..100%", "Wavelength,sample", 0.01),
        ("Unit: 0 to 100 percent", "Wavelength,Reflectance", 0.01),
        ("own", "Wavelength,Reflectance (0–100 %)", 0.01),
        ("own", "Wavelength,sample 12 %R", 0.01),
        ("own", "Wavelength,sample 12 %Reflectance", 0.01),
        ("own", "Wavelength,sample 12 %r", 0.01),
        ("own", "Wavelength,leaf 3 % T", 0.01),
        ("own", "Wavelength,Reflectance of leaf 3 %R", 0.01),
        # None of these is the unit of the values.
        ("White: reflectance 99 %R", "Wavelength,Reflectance", 1.0),
        ("own", "Wavelength,Spectralon 99%", 1.0),
        ("own", "Wavelength,Reflectance of Spectralon 99 %", 1.0),
        ("Reflectance, white 10.0-100 %", "Wavelength,sample", 1.0),
        ("White: 99 % reflectance, Spectralon 99%", "Wavelength,Reflectance", 1.0),
        ("White: 99% reflectance standard, 99 %", "Wavelength,R", 1.0),
        ("Humidity (%)", "Wavelength,Reflectance", 1.0),
        ("own", "Wavelength,Reflectance,Std dev [%]", 1.0),
        ("Reflectance of 2020-10-1", "Wavelength,Reflectance [%]", 0.01),
    ],
)
def test_percent_of_a_header_is_that_of_a_column_without_a_unit(
    tmp_path: Path, header: str, titles: str, scale: float
) -> None:
    path = table(tmp_path / "felt.csv", f"{header}\n{titles}", *[NM, LEAF, LEAF][: titles.count(",") + 1])
    (found,) = read_columns(path)
    np.testing.assert_allclose(found.values, LEAF * scale, rtol=1e-4)


@pytest.mark.parametrize("title", ["Radiance", "L", "Value"])
def test_a_unit_of_radiance_in_the_header_holds_whatever_the_column_is_called(
    tmp_path: Path, title: str
) -> None:
    head = "Irradiance unit: W/m2/nm\nUnit: mW/(m2 sr nm)" if title == "Radiance" else "Unit: mW/(m2 sr nm)"
    path = table(tmp_path / "light.csv", f"{head}\nWavelength (nm),{title}", NM, LEAF)
    (found,) = read_columns(path)
    assert (found.quantity, found.scaled) == ("radiance", True)
    np.testing.assert_allclose(found.values, LEAF * 1e-3, rtol=1e-4)


def test_a_date_beside_a_quantity_does_not_state_shares(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", "Reflectance of 2020-10-1\nWavelength,Reflectance", NM, LEAF * 100)
    assert read_references(path).references[0].curve.values[0] == pytest.approx(LEAF[0], rel=1e-4)


@pytest.mark.parametrize("word", ["NA", "NaN", "nan", "n.a.", "N/A", "#N/A", "NULL", "-", "--"])
@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", ","), (" ", "."), (" ", ","), ("\t", ".")]
)
def test_a_word_for_no_value_is_a_missing_value(
    tmp_path: Path, word: str, separator: str, decimal: str
) -> None:
    lost = (400, 480, 540, 600)
    rows = [
        f"{nm}{decimal}0{separator}" + (word if nm in lost else f"{value:.4f}".replace(".", decimal))
        for nm, value in zip(NM, LEAF, strict=True)
    ]
    path = tmp_path / "leaf.txt"
    path.write_text("\n".join([f"nm{separator}reflectance", *rows]), encoding="utf-8")
    (leaf,) = read_columns(path)
    assert leaf.nm.tolist() == NM.tolist()
    # Between spaces, commas of decimals hide where a title ends.
    assert leaf.name == ("" if (separator, decimal) == (" ", ",") else "reflectance")
    np.testing.assert_allclose(leaf.values, np.where(np.isin(NM, lost), np.nan, LEAF), atol=1e-4)
    (seen,) = read_references(path).references
    assert (seen.curve.wavelengths_nm[0], seen.curve.wavelengths_nm[-1]) == (410, 700)


def in_lines(path: Path, head: str, behind: str = "", ids: str = "{}") -> Path:
    """Ten samples, one a line: their numbers, the values of a leaf, and what is behind those."""
    values = ",".join(f"{value:.5f}" for value in LEAF)
    path.write_text("\n".join([head, *(f"{ids.format(i)},{values}{behind}" for i in range(1, 11))]))
    return path


@pytest.mark.parametrize("ids", ["{}", "oak {}", "10{}", "10{:02}"])
@pytest.mark.parametrize(
    ("head", "behind", "falls"),
    [
        ("id," + ",".join(map(str, NM[::-1])), "", True),
        ("id," + ",".join(f"{nm / 1000:g} um" for nm in NM), "", False),
        ("wavelength (µm)," + ",".join(f"{nm / 1000:g}" for nm in NM), "", False),
        ("id," + ",".join(map(str, NM)) + ",species,plot", ",oak,3", False),
        ("id," + ",".join(f"X{nm}" for nm in NM) + ",year2020", ",3", False),
        ("wavelength," + ",".join(map(str, NM)), "", False),
    ],
)
def test_spectra_in_lines_are_read_whatever_is_around_them(
    tmp_path: Path, head: str, behind: str, falls: bool, ids: str
) -> None:
    found = read_columns(in_lines(tmp_path / "oaks.csv", head, behind, ids))
    assert [each.name for each in found] == [ids.format(i) for i in range(1, 11)]
    np.testing.assert_allclose(found[0].nm, NM)
    np.testing.assert_allclose(found[0].values, LEAF[::-1] if falls else LEAF, atol=1e-5)


@pytest.mark.parametrize(
    ("first", "labels"),
    [
        ("id", [f"{nm / 1000:g}" for nm in NM]),
        ("", [f"{nm / 1000:g}" for nm in NM]),
        ("plot", [f"{nm / 1000:g}" for nm in NM]),
        ("id", [*map(str, NM[:15]), *map(str, NM[:16])]),
    ],
)
def test_numbers_of_samples_do_not_pass_for_wavelengths(
    tmp_path: Path, first: str, labels: list[str]
) -> None:
    path = in_lines(tmp_path / "oaks.csv", ",".join([first, *labels]))
    with pytest.raises(CalibrationError, match=f"wavelengths over its columns, from '{labels[0]}' to"):
        read_columns(path)


@pytest.mark.parametrize(
    ("first", "title"),
    [
        ("nm", "0.{}"),
        ("", "0.{}"),
        ("X", "{}"),
        ("Wavelength", "{}.5"),
        ("WL", "{}.1"),
        ("Wavelength", "S10{:02}"),
        ("wavelength_nm", "1{:02}0"),
        ("nm", "leaf_2{:02}"),
    ],
)
def test_numbers_over_columns_are_names_beside_a_column_of_wavelengths(
    tmp_path: Path, first: str, title: str
) -> None:
    titles = [title.format(i) for i in range(1, 11)]
    path = table(tmp_path / "doses.csv", ",".join([first, *titles]), NM, *[LEAF + i / 99 for i in range(10)])
    found = read_columns(path)
    assert [each.name for each in found] == titles
    np.testing.assert_allclose(found[0].nm, NM)


def test_a_row_of_rising_or_falling_values_is_no_line_of_wavelengths(tmp_path: Path) -> None:
    columns = [LEAF * 1000 * (1 - 0.01 * i) for i in range(12)]
    titles = ",".join(["wavelength", *(f"leaf {chr(97 + i)}" for i in range(12))])
    found = read_columns(table(tmp_path / "counts.csv", titles, NM / 1000, *columns))
    assert len(found) == 12
    np.testing.assert_allclose(found[0].nm, NM)


@pytest.mark.parametrize(
    "titles",
    [
        "nm,reflectance,SNR",
        "nm,R,n",
        "nm,R,CV (%)",
        "nm,mean,FWHM (nm)",
        "n,nm,R",
        "nm,R,bandwidth",
        "nm,reflectance,quality",
    ],
)
def test_a_column_of_other_figures_does_not_make_shares_percent(tmp_path: Path, titles: str) -> None:
    given = {"nm": NM, "n": np.arange(NM.size) + 5}
    columns = [
        given.get(title, LEAF if title in ("R", "mean", "reflectance") else LEAF * 0 + 150)
        for title in titles.split(",")
    ]
    found = read_references(table(tmp_path / "leaf.csv", titles, *columns))
    assert found.as_percent is None
    assert len(found.references) == 1
    np.testing.assert_allclose(found.references[0].curve.values, LEAF, rtol=1e-5)
    assert found.notes == ()


def test_a_figure_beside_reflectance_is_left_out_and_told_unless_it_can_be_one(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", "nm,reflectance,bark,steps", NM, LEAF, LEAF / 2, LEAF + 400)
    found = read_references(path)
    assert [each.name for each in found.references] == ["reflectance", "bark"]
    np.testing.assert_allclose(found.references[0].curve.values, LEAF, rtol=1e-5)
    assert found.notes == ("left out, as values above 2 cannot be shares: steps.",)
    path = table(path, "nm,reflectance,bark", NM, LEAF * 100, LEAF * 50)
    found = read_references(path)
    assert found.notes == ()
    np.testing.assert_allclose(found.references[1].curve.values, LEAF / 2, rtol=1e-5)


@pytest.mark.parametrize("names", [["m", "n"], ["matt", "gloss"], ["cv Gala", "detector 2"]])
def test_words_of_samples_are_names(tmp_path: Path, names: list[str]) -> None:
    found = read_columns(table(tmp_path / "a.csv", ",".join(["nm", *names]), NM, LEAF, LEAF))
    assert [each.name for each in found] == names


@pytest.mark.parametrize(
    "title",
    ["Absorbance", "Absorption", "absorption coefficient", "Extinktion", "Extinction", "optical density",
     "OD", "Abs", "Abs.", "K/S", "Kubelka-Munk", "log(1/R)", "log10 (1 / R)", "A=-log10(R)", "-log R"],
)  # fmt: skip
def test_absorption_is_no_reflectance(tmp_path: Path, title: str) -> None:
    with pytest.raises(CalibrationError, match=r"absorbance, not a reflectance\. Export reflectance\."):
        read_references(table(tmp_path / "a.csv", f"nm,{title}", NM, LEAF))


@pytest.mark.parametrize("title", ["First derivative", "2nd Derivative of reflectance", "dR/dnm"])
def test_a_derivative_is_no_reflectance(tmp_path: Path, title: str) -> None:
    with pytest.raises(CalibrationError, match="contains derivative, not a reflectance"):
        read_references(table(tmp_path / "a.csv", f"nm,{title}", NM, LEAF))


def test_a_header_that_knows_of_derivatives_leaves_reflectance_what_it_is(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", "Derivative: none\nnm,catalog T", NM, LEAF)
    (found,) = read_references(path).references
    np.testing.assert_allclose(found.curve.values, LEAF, rtol=1e-5)


def test_counts_become_reflectance_over_those_of_a_white(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"counts, not a reflectance\. Divide it by the spectrum of a"):
        read_references(table(tmp_path / "a.csv", "nm,counts", NM, LEAF))


@pytest.mark.parametrize(
    "title",
    [
        "Reflectance (absorption of the cell removed)",
        "Abs. reflectance",
        "ABS white",
        "ABS",
        "filter OD 2",
        "Absinth",
    ],
)
def test_words_like_absorption_do_not_refuse_reflectance(tmp_path: Path, title: str) -> None:
    path = table(tmp_path / "a.csv", f"nm,{title}", NM, LEAF)
    np.testing.assert_allclose(read_references(path).references[0].curve.values, LEAF, rtol=1e-4)


@pytest.mark.parametrize(("title", "left_out"), [("s", True), ("tolerance", True), ("U", True), ("S", True)])
def test_a_short_title_is_an_uncertainty_where_its_values_are_small(
    title: str, left_out: bool, tmp_path: Path
) -> None:
    for values, is_out in ((LEAF / 100, left_out), (LEAF, False)):
        path = table(tmp_path / "some.csv", f"nm,tile 7,{title}", NM, LEAF, values)
        assert [each.name for each in read_columns(path)] == ["tile 7", title][: 2 - is_out]


@pytest.mark.parametrize(
    "titles",
    ["UL,UR,LL,LR", "DG,DR,DB", "TiO2,CI 77492,CI 77499", "Q,R,S,T,U,V", "NE,NW,SE,SW", "Ur,Au", "U95,U96"],
)
def test_a_series_of_samples_is_whole_whatever_short_names_look_like(titles: str, tmp_path: Path) -> None:
    """One dark sample among others, or one called as a sign, was left out without a word."""
    names = titles.split(",")
    columns = [LEAF / 10 if name in ("SE", "DR") else LEAF for name in names]
    found = read_columns(table(tmp_path / "some.csv", f"nm,{titles}", NM, *columns))
    assert [each.name for each in found] == names


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        ("A,s,B,s", ["A", "B"]),
        ("A,B,se", ["A", "B"]),
        ("R,UR", ["R"]),
        ("ρ(λ),U95", ["ρ(λ)"]),
        ("R,U,T,U", ["R", "T"]),
        ("R,dR", ["R"]),
    ],
)
def test_each_sample_may_have_its_uncertainty_behind_it(
    titles: str, names: list[str], tmp_path: Path
) -> None:
    columns = [LEAF if name in names else LEAF / 100 for name in titles.split(",")]
    found = read_columns(table(tmp_path / "some.csv", f"nm,{titles}", NM, *columns))
    assert [each.name for each in found] == names


@pytest.mark.parametrize(
    "said",
    ["# water absorption bands removed", "Comment: absorption corrected", "Title: extinction corrected leaf"],
)
def test_absorption_in_passing_leaves_reflectance_what_it_is(said: str, tmp_path: Path) -> None:
    path = table(tmp_path / "some.csv", f"{said}\nwavelength,value", NM, LEAF)
    assert read_columns(path)[0].quantity == "unstated"
    assert len(read_references(path).references) == 1


@pytest.mark.parametrize(
    "title",
    [
        "20%reflectance tile",
        "50%refl",
        "99 % reflectance",
        "reflectance 50 pct tile",
        "95th percentile",
        "soil (0-100)",
        "reflectance of soil (0-100)",
    ],
)
def test_percent_in_the_name_of_a_tile_is_no_unit(title: str) -> None:
    assert quantity_of(title)[1] == 1.0


@pytest.mark.parametrize(
    "title", ["Reflectance_pct", "Reflexionsgrad in Prozent", "Remission (v.H.)", "R (0-100)", "leaf 12 %R"]
)
def test_percent_in_words_is_a_unit(title: str) -> None:
    assert quantity_of(title)[1:] == (0.01, True)


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("uW cm^{-2} sr^{-1} nm^{-1}", 1e-2),
        ("microW/(cm2 sr nm)", 1e-2),
        ("W/sr/cm**2/nm", 1e4),
        ("mW/(mm² sr nm)", 1e3),
        ("W/(m² sr Å)", 10.0),
        ("W m^{-2} sr^{-1} \\mu m^{-1}", 1e-3),
        ("MW/(sr m2 nm)", 1e6),
        ("mWm-2sr-1nm-1", 1e-3),
        ("µWcm⁻²sr⁻¹nm⁻¹", 1e-2),
        ("mWsr-1m-2nm-1", 1e-3),
    ],
)
def test_units_of_radiance_are_read_as_others_write_them(unit: str, factor: float) -> None:
    quantity, found, is_stated = quantity_of(f"Radiance ({unit})")
    assert (quantity, is_stated) == ("radiance", True)
    assert found == pytest.approx(factor)


def test_a_letter_over_another_column_is_no_unit_of_wavelengths(tmp_path: Path) -> None:
    nm = np.linspace(350, 2500, 44)
    path = table(tmp_path / "some.csv", "Wavelength,Leaf (A),Leaf (B)", nm, nm / 5000, nm / 6000)
    assert read_columns(path)[0].nm[-1] == 2500


@pytest.mark.parametrize(
    "titles",
    [
        "Wavelength (nm),%R,Wavelength (nm),%R",
        "nm,%R,nm,%R",
        "Wavelength a,a (%),λ of b,b (%)",
        "Wavelength,R(λ) [%],wave (nm),wave,R(λ) [%]",
        "Wavelength,R [%],std,Wavelength,Wavelength error,R [%]",
    ],
)
@pytest.mark.parametrize("others", [NM + 100, NM[::-1], 400 + NM / 10])
def test_values_are_over_the_nearest_wavelengths_before_them(
    tmp_path: Path, titles: str, others: np.ndarray
) -> None:
    columns: list[np.ndarray] = []
    nm, values = NM, LEAF * 100
    for title in titles.split(","):
        if columns and "%" not in title and title != "std":
            nm, values = others, LEAF * 50
        columns.append(values if "%" in title else values * 0 + 0.1 if title in _ASIDE else nm)
    found = read_columns(table(tmp_path / "pairs.csv", titles, *columns))
    assert len(found) == 2
    np.testing.assert_allclose(found[0].nm, NM)
    np.testing.assert_allclose(found[0].values, LEAF, rtol=1e-4)
    step = 1 if others[1] > others[0] else -1
    np.testing.assert_allclose(found[1].nm, others[::step])
    np.testing.assert_allclose(found[1].values, LEAF[::step] / 2, rtol=1e-4)


@pytest.mark.parametrize(
    ("at", "between"),
    [
        (25, "# filter change\n"),
        (25, "\n"),
        (3, "// 2nd grating\n\n"),
        (12, ",,\n"),
        (None, "\n"),
        (None, "\r\n"),
    ],
)
@pytest.mark.parametrize("falls", [False, True])
def test_rows_behind_a_remark_or_an_empty_line_are_read(
    tmp_path: Path, at: int | None, between: str, falls: bool
) -> None:
    step = -1 if falls else 1
    given = zip(NM[::step], LEAF[::step], strict=True)
    rows = [f"{nm},{r:.5f}\n" + (between if at in (None, i) else "") for i, (nm, r) in enumerate(given)]
    path = tmp_path / "leaf.csv"
    path.write_bytes("".join(["nm,R\n", *rows]).encode())
    (leaf,) = read_columns(path)
    assert (leaf.name, leaf.nm.tolist()) == ("R", NM.tolist())
    np.testing.assert_allclose(leaf.values, LEAF, atol=1e-5)


def test_rows_that_begin_again_or_are_far_away_are_no_part_of_a_table(tmp_path: Path) -> None:
    path = table(tmp_path / "two.csv", "1,2\n3,4\n\nnm,R", NM, LEAF)
    rows = [f"{nm},{r / 2:.5f}" for nm, r in zip(NM, LEAF, strict=True)]
    path.write_text("\n".join([path.read_text(), "", *rows, "", "5000,1", *[""] * 99]))
    first, second = read_columns(path)
    assert first.nm.tolist() == second.nm.tolist() == NM.tolist()
    np.testing.assert_allclose(second.values, LEAF / 2, atol=1e-5)


@pytest.mark.parametrize("before", [",", ",,", "\t"])
@pytest.mark.parametrize("titles", ["Wavelength (nm){}%R", "nm{}R (%)"])
def test_empty_columns_before_the_wavelengths_are_passed_over(
    tmp_path: Path, before: str, titles: str
) -> None:
    between = before[0]
    rows = [f"{before}{nm}{between}{100 * r:.5f}{between}" for nm, r in zip(NM, LEAF, strict=True)]
    path = tmp_path / "filter.csv"
    path.write_text("\n".join(['"FL532"' + between * 4, before + titles.format(between), *rows]))
    (found,) = read_columns(path)
    assert found.nm.tolist() == NM.tolist()
    np.testing.assert_allclose(found.values, LEAF, atol=1e-6)


def test_of_pairs_the_first_may_be_the_shorter_one(tmp_path: Path) -> None:
    rows = [
        f"{nm},{r:.5f},{nm},{r / 2:.5f}" if nm < 600 else f",,{nm},{r / 2:.5f}"
        for nm, r in zip(NM, LEAF, strict=True)
    ]
    path = tmp_path / "pairs.csv"
    path.write_text("\n".join(["nm,a,nm,b", *rows]))
    short, full = read_columns(path)
    assert short.nm.tolist() == NM[NM < 600].tolist()
    np.testing.assert_allclose(full.values, LEAF / 2, atol=1e-5)
