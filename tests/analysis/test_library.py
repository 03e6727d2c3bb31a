from pathlib import Path

import numpy as np
import pytest

import dsl_core as dsl
from dsl_core.analysis.classes import classes_of_library
from dsl_core.analysis.classify import ClassMap, score
from dsl_core.analysis.library import read_groups, read_library
from dsl_core.api.accessor import ResultAccessor
from dsl_core.errors import CalibrationError
from tests.cases.small_result import small_result
from tests.cases.spectra_files import NM, SHARE, asd

BANDS_NM = np.arange(430.0, 661.0, 10.0)


def _csv(path: Path, *columns: np.ndarray, titles: tuple[str, ...], nm: np.ndarray = NM) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [",".join(f"{value:.6g}" for value in row) for row in zip(nm, *columns, strict=True)]
    path.write_text("\n".join([",".join(("wavelength_nm", *titles)), *rows]), encoding="utf-8")
    return path


def test_folders_are_groups_and_any_format_is_read(tmp_path: Path) -> None:
    _csv(tmp_path / "blätter" / "a.csv", SHARE, titles=("<b>Ahorn</b>",))
    (tmp_path / "blätter" / "b.asd").write_bytes(asd())
    _csv(tmp_path / "stein" / "c.csv", SHARE / 2, titles=("granite",))
    library = read_library([tmp_path])
    assert library.groups == ("blätter", "stein")
    assert [entry.name for entry in library.entries if entry.group == "stein"] == ["c"]
    classes, notes = classes_of_library(library, BANDS_NM)
    assert [each.name for each in classes] == ["blätter", "stein"]
    assert classes[1].mean == pytest.approx(classes[0].mean / 2, rel=1e-3)
    assert not notes


@pytest.mark.parametrize(("title", "name"), [("Malachite, natural", "Malachite, natural"), ("", "m17")])
def test_a_spectrum_alone_in_its_file_keeps_its_title_where_the_format_has_one(
    tmp_path: Path, title: str, name: str
) -> None:
    head = f"##TITLE={title}\n##JCAMP-DX=4.24\n##XUNITS=NANOMETERS\n##YUNITS=REFLECTANCE\n"
    values = "\n".join(f"{nm:g} {share:g}" for nm, share in zip(NM, SHARE, strict=True))
    (tmp_path / "m17.jdx").write_text(f"{head}##XYPOINTS=(XY..XY)\n{values}\n##END=\n", encoding="utf-8")
    assert [entry.name for entry in read_library([tmp_path]).entries] == [name]


def test_what_lies_beside_the_subfolders_of_a_library_is_no_class_of_its_own(tmp_path: Path) -> None:
    for name in ("leaf", "sea"):
        _csv(tmp_path / f"{name}.csv", SHARE, titles=("reflectance",))
    _csv(tmp_path / "stone" / "a.csv", SHARE, titles=("reflectance",))
    assert read_library([tmp_path]).groups == ("leaf", "sea", "stone")
    assert read_library([tmp_path], "folder").groups == (tmp_path.name, "stone")


def test_percent_is_told_and_dark_spectra_of_such_a_file_are_percent_too(tmp_path: Path) -> None:
    _csv(tmp_path / "two.csv", SHARE * 100, SHARE * 2, titles=("bright", "dark"))
    library = read_library([tmp_path / "two.csv"])
    bright, dark = (np.asarray(entry.curve.values) for entry in library.entries)
    assert bright == pytest.approx(SHARE, rel=1e-4)
    # Values up to 1.4 look like shares, but the other spectrum of the file shows that they are percent.
    assert dark == pytest.approx(SHARE * 0.02, rel=1e-4)
    assert "read as percent" in library.notes[0]


def test_what_else_was_made_of_a_file_is_told(tmp_path: Path) -> None:
    values = np.where(NM[-1] == NM, -9999.0, SHARE)
    _csv(tmp_path / "leaf.csv", values, SHARE + 60, titles=("reflectance", "steps"))
    library = read_library([tmp_path])
    assert len(library.entries) == 1
    assert "leaf.csv: left out, as values above 2 cannot be shares: steps." in library.notes
    assert "leaf.csv: values below -0.9 are taken as deleted: 1." in library.notes


def test_two_hundred_entries_of_one_name_are_one_class_that_varies(tmp_path: Path) -> None:
    levels = np.linspace(0.8, 1.2, 200)
    _csv(tmp_path / "l.csv", *(SHARE * level for level in levels), titles=("leaf",) * 200)
    library = read_library([tmp_path / "l.csv"])
    assert library.groups == ("leaf",)
    (one,), _ = classes_of_library(library, BANDS_NM)
    assert len(one.members) == 1
    # All that varies is the level.
    component = one.members[0].components[0]
    assert np.abs(component / one.mean) == pytest.approx(np.std(levels, ddof=1), rel=0.02)


@pytest.mark.parametrize("kind", ["region", "spectrum", "pixels"])
def test_exported_materials_are_a_class_each_by_their_files(tmp_path: Path, kind: str) -> None:
    result = small_result()
    for name in ("orange", "green"):
        if kind == "pixels":
            dsl.export(result, tmp_path / f"{name}.csv", pixels=[(4, 2)])
        else:
            of = ResultAccessor(result)
            place = of.region((2, 2, 2, 2)) if kind == "region" else of.spectrum(4, 2)
            place.dsl.export(tmp_path / f"{name}.csv")
    library = read_library([tmp_path])
    assert library.groups == ("green", "orange")
    assert not library.notes


def test_one_class_of_several_files_is_told(tmp_path: Path) -> None:
    for name in ("a", "b"):
        _csv(tmp_path / f"{name}.csv", SHARE, SHARE / 2, titles=("leaf", name))
    library = read_library([tmp_path])
    assert library.groups == ("leaf", "a", "b")
    assert library.notes == (
        "Each is one class, since the names are the same: leaf (2 files). Group by file if not.",
    )
    assert read_library([tmp_path], "name").notes == ()


def test_groups_by_name_and_by_table(tmp_path: Path) -> None:
    titles = ("oak 1", "oak 2", "ash_01")
    file = _csv(tmp_path / "l.csv", SHARE, SHARE, SHARE, titles=titles)
    assert read_library([file]).groups == titles
    assert read_library([file], "name").groups == ("oak", "ash")
    table = tmp_path / "groups.csv"
    table.write_text("name,group\noak 1,tree\nash_01,tree\n")
    assert read_library([tmp_path], table=table).groups == ("tree", "oak 2")


def test_what_cannot_be_used_is_left_out_and_told(tmp_path: Path) -> None:
    _csv(tmp_path / "good.csv", SHARE, titles=("reflectance",))
    _csv(tmp_path / "counts.csv", SHARE * 9000, titles=("counts",))
    _csv(tmp_path / "part.csv", SHARE[10:20], titles=("reflectance",), nm=NM[10:20])
    library = read_library([tmp_path])
    assert [entry.name for entry in library.entries] == ["good", "part"]
    assert "counts.csv" in library.notes[0]
    classes, notes = classes_of_library(library, BANDS_NM)
    assert len(classes) == 1
    assert "It covers 500 to 590 nm" in notes[0]


def test_nothing_to_read_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="no file of a format"):
        read_library([tmp_path])
    with pytest.raises(CalibrationError, match="no library"):
        read_library([tmp_path / "not there"])


def test_spectra_of_another_instrument_fit_by_the_error_stated_for_them(
    tmp_path: Path,
) -> None:
    library = read_library([_csv(tmp_path / "l.csv", SHARE, SHARE[::-1], titles=("one", "other"))])
    (own, _), _ = classes_of_library(library, BANDS_NM)
    noise = 0.001 * np.random.default_rng(0).standard_normal((len(BANDS_NM), 4, 5))
    pixels = (1.02 * own.mean[:, None, None] + noise).astype(np.float32)
    std = np.full_like(pixels, 0.001)
    flags = np.zeros((4, 5), np.uint16)

    def shares(relative_error: float) -> tuple[float, float]:
        classes, _ = classes_of_library(library, BANDS_NM, relative_error=relative_error)
        found = ClassMap.of(score(pixels, std, None, flags, classes))
        return float((found.values == 1).mean()), float((found.values == found.none).mean())

    assert shares(0.0) == (0.0, 1.0)
    assert shares(0.02)[0] >= 0.95


def test_an_error_in_percent_is_refused(tmp_path: Path) -> None:
    library = read_library([_csv(tmp_path / "l.csv", SHARE, titles=("one",))])
    with pytest.raises(CalibrationError, match=r"share from 0 to 1, not 2\. Give 0\.02 for 2 %"):
        classes_of_library(library, BANDS_NM, relative_error=2.0)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_groups_are_read_whatever_separates_them(separator: str, tmp_path: Path) -> None:
    table = tmp_path / "groups.csv"
    lines = (("name", "group"), ("oak 1", "oak"), ("elm", "elm"))
    table.write_text("\n".join(separator.join(line) for line in lines), encoding="utf-8-sig")
    assert read_groups(table) == {"oak 1": "oak", "elm": "elm"}
