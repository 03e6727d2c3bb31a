"""Numbers of JCAMP-DX, plain and compressed (McDonald and Wilks 1988), digit by digit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.errors import CalibrationError
from dsl_core.io.spectra.formats.jcamp import _values, read_jcamp

HERE = Path("x.jdx")


@pytest.mark.parametrize(
    ("body", "values"),
    [
        ("1 2 3\n3 4 5", [2, 3, 4, 5]),
        ("1+2-3+4", [2, -3, 4]),
        ("1 2e-1 3E+2", [0.2, 300]),
        ("1A2B3c4", [12, 23, -34]),
        ("1@%", [0, 0]),
        ("1A0J2l", [10, 22, 19]),
        ("1A0K1n", [10, 31, 26]),
        ("1A5T", [15, 15]),
        ("1A5V", [15, 15, 15, 15]),
        ("1A0J0U", [10, 20, 30, 40]),
        ("1A0J0UB5", [10, 20, 30, 40, 25]),
        ("1A0U", [10, 10, 10]),
        ("1 5 A7", [5, 17]),
    ],
)
def test_digits_stand_for_values_differences_and_repetitions(body: str, values: list[float]) -> None:
    assert _values(HERE, body, 20).tolist() == values


def test_a_line_after_differences_repeats_the_last_value_as_a_check() -> None:
    assert _values(HERE, "1A0J5\n3B5J5\n5D0", 20).tolist() == [10, 25, 40]
    assert _values(HERE, "1A0\n3B5", 20).tolist() == [10, 25], "no difference, no check"
    with pytest.raises(CalibrationError, match="begins with 26 instead of 25"):
        _values(HERE, "1A0J5\n3B6J5", 20)
    # An empty line in between changes nothing.
    assert _values(HERE, "1A0J5\n\n3B5J5", 20).tolist() == [10, 25, 40]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("1S5", "repeated 15 times"), ("1A5s9", "repeated 99 times"), ("1J5", "begins with a difference"),
        ("1 2e40", "is not a number"),
    ],
)  # fmt: skip
def test_what_nobody_wrote_is_refused(body: str, said: str) -> None:
    with pytest.raises(CalibrationError, match=said):
        _values(HERE, body, 20)


def written(tmp_path: Path, **fields: str) -> Path:
    lines = {
        "TITLE": " grey   tile ", "XUNITS": "NANOMETERS", "YUNITS": "REFLECTANCE", "FIRSTX": "500",
        "LASTX": "520", "NPOINTS": "3", "YFACTOR": "0.5", "XYDATA": "(X++(Y..Y))\n500 1 2 3", "END": "",
    }  # fmt: skip
    path = tmp_path / "x.jdx"
    path.write_text(
        "".join(f"##{key}={value}\n" for key, value in {**lines, **fields}.items() if value != "-")
    )
    return path


def test_wavelengths_run_from_the_first_to_the_last(tmp_path: Path) -> None:
    (found,) = read_jcamp(written(tmp_path))
    assert (found.name, found.quantity) == ("grey tile", "reflectance")
    assert found.nm.tolist() == [500, 510, 520]
    assert found.values.tolist() == [0.5, 1.0, 1.5]
    (falling,) = read_jcamp(written(tmp_path, FIRSTX="520", LASTX="500"))
    assert (falling.nm.tolist(), falling.values.tolist()) == ([500, 510, 520], [1.5, 1.0, 0.5])
    (plain,) = read_jcamp(written(tmp_path, YFACTOR="-"))
    assert plain.values.tolist() == [1, 2, 3]


def test_wavenumbers_become_wavelengths(tmp_path: Path) -> None:
    (found,) = read_jcamp(written(tmp_path, XUNITS="1/CM", FIRSTX="20000", LASTX="16000"))
    assert found.nm == pytest.approx(1e7 / np.array([20000, 18000, 16000]))
    with pytest.raises(CalibrationError, match="a wavenumber is not above zero"):
        read_jcamp(written(tmp_path, XUNITS="CM-1", FIRSTX="0", LASTX="16000"))


def test_pairs_have_a_factor_for_each_axis(tmp_path: Path) -> None:
    pairs = {"XYDATA": "-", "XFACTOR": "10", "XYPOINTS": "(XY..XY)\n50,2; 51,4\n52 6"}
    (found,) = read_jcamp(written(tmp_path, **pairs))
    assert (found.nm.tolist(), found.values.tolist()) == ([500, 510, 520], [1, 2, 3])
    with pytest.raises(CalibrationError, match="a pair lacks its second value"):
        read_jcamp(written(tmp_path, **{**pairs, "XYPOINTS": "(XY..XY)\n50,2; 51"}))
    with pytest.raises(CalibrationError, match="no two wavelengths"):
        read_jcamp(written(tmp_path, **{**pairs, "XYPOINTS": "(XY..XY)\n50,2"}))


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"NPOINTS": "4"}, "4 values are declared, but there are 3"), ({"NPOINTS": "1"}, "NPOINTS is 1"),
        ({"XYDATA": "(R..R)\n1"}, r"the data has the form \(R..R\)"), ({"XYDATA": "-"}, "contains no XYDATA"),
        ({"NTUPLES": "NMR"}, "contains NTUPLES"), ({"FIRSTX": "-"}, "'' is not a number"),
    ],
)  # fmt: skip
def test_a_file_that_says_something_else_is_refused(
    tmp_path: Path, fields: dict[str, str], said: str
) -> None:
    with pytest.raises(CalibrationError, match=said):
        read_jcamp(written(tmp_path, **fields))


def test_two_points_are_a_spectrum_and_blocks_are_read_one_by_one(tmp_path: Path) -> None:
    two = written(tmp_path, NPOINTS="2", XYDATA="(X++(Y..Y))\n500 1 2 $$ comment")
    (found,) = read_jcamp(two)
    assert (found.nm.tolist(), found.values.tolist()) == ([500, 520], [0.5, 1.0])
    block = two.read_text()
    two.write_text(block + block.replace("grey   tile", "white").replace("##YFACTOR=0.5\n", ""))
    assert [(each.name, each.values.tolist()) for each in read_jcamp(two)] == [
        ("grey tile", [0.5, 1.0]), ("white", [1.0, 2.0]),
    ]  # fmt: skip


def test_functions_of_absorption_are_called_so(tmp_path: Path) -> None:
    (found,) = read_jcamp(written(tmp_path, YUNITS="KUBELKA-MUNK"))
    assert found.quantity == "absorbance"
