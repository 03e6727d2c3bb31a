"""A mapping says which picture is which frame; what is missing or too much is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from dsl_core.errors import StoreError
from dsl_core.io.pictures.arrange import Arrangement, arrange, draft_table, picture_files
from dsl_core.io.pictures.mapping import Mapping, Part, PhasePictures, Skipped, StripePictures, WhitePicture
from dsl_core.model.captured_code import CapturedCode, Phases, Stripes
from dsl_core.model.plan import GrayCode, XorCode
from tests.cases.foreign_captures import write

SIZE = (8, 4)


def _folder(tmp_path: Path, names: list[str]) -> Path:
    return write(tmp_path / "set", {name: np.full((3, 4), i, np.uint16) for i, name in enumerate(names)})


def _arranged(
    folder: Path, *parts: Part, missing: tuple[int, ...] = (), files: tuple[str, ...] = ("*",)
) -> Arrangement:
    return arrange(folder, Mapping(parts=parts, projector_size_px=SIZE, missing=missing, files=files))


def _order(found: Arrangement) -> list[str]:
    return [picture.path.stem for picture in found.frames]


def test_names_are_sorted_as_a_person_counts(tmp_path: Path) -> None:
    folder = _folder(tmp_path, [f"im{i}.png" for i in range(12)])
    assert [path.stem for path in picture_files(folder, ("*",))] == [f"im{i}" for i in range(12)]


@pytest.mark.parametrize(
    ("part", "order"),
    [
        (StripePictures(bits=3), "012345"),
        (StripePictures(bits=3, first="least"), "452301"),
        (StripePictures(bits=3, inverse="after"), "031425"),
        (StripePictures(bits=3, inverse_first=True), "103254"),
    ],
)
def test_digits_come_in_the_order_of_the_code(tmp_path: Path, part: StripePictures, order: str) -> None:
    found = _arranged(_folder(tmp_path, [f"{i}.png" for i in range(6)]), part)
    assert "".join(_order(found)) == order
    assert found.code == GrayCode(rows=False)


def test_steps_come_set_by_set(tmp_path: Path) -> None:
    folder = _folder(tmp_path, [f"{i}.png" for i in range(6)])
    found = _arranged(folder, PhasePictures(fringes=(1, 4), steps=3, order="step"))
    assert "".join(_order(found)) == "024135"
    assert found.code == CapturedCode(column_sets=(Phases(periods_px=(8.0, 2.0), steps=3),))


def test_parts_may_name_their_own_files_and_skip_others(tmp_path: Path) -> None:
    folder = _folder(tmp_path, ["full.png", *(f"c{i}.png" for i in range(6)), "r0.png", "r1.png", "room.png"])
    found = _arranged(
        folder,
        StripePictures(axis="rows", bits=2, inverse="none", files=("r[0-9].png",)),
        StripePictures(bits=3, files=("c*.png",)),
        WhitePicture(files=("full.png",)),
        Skipped(),
    )
    assert _order(found) == ["c0", "c1", "c2", "c3", "c4", "c5", "r0", "r1"]
    assert found.white is not None
    assert found.white.path.stem == "full"
    assert found.code == CapturedCode(
        column_sets=(Stripes(bits=3),), row_sets=(Stripes(bits=2, inverse=False),)
    )


def test_of_inverses_alone_each_pattern_is_lacking(tmp_path: Path) -> None:
    folder = _folder(tmp_path, ["0.png", "1.png", "2.png"])
    found = _arranged(folder, StripePictures(bits=3, inverse="none", inverse_first=True))
    assert found.code == CapturedCode(column_sets=(Stripes(bits=3, lacking=(0, 2, 4)),))
    assert [said for _, said in found.table] == [f"columns, gray bit {bit} inverse" for bit in (2, 1, 0)]


def test_absent_pictures_leave_their_digit_to_the_other(tmp_path: Path) -> None:
    folder = _folder(tmp_path, [f"{i}.png" for i in (0, 1, 2, 4, 5)])
    found = _arranged(folder, StripePictures(bits=3), missing=(3,))
    assert found.code == CapturedCode(column_sets=(Stripes(bits=3, lacking=(3,)),))
    assert ("-", "columns, gray bit 1 inverse: missing") in found.table
    with pytest.raises(StoreError, match=r"has 5 pictures where the mapping wants 6.*begins with columns"):
        _arranged(folder, StripePictures(bits=3))
    with pytest.raises(StoreError, match="missing of the mapping must name places 0 to 5"):
        _arranged(folder, StripePictures(bits=3), missing=(9,))


def test_an_xor_code_as_ours_is_ours(tmp_path: Path) -> None:
    folder = _folder(tmp_path, [f"{i}.png" for i in range(6)])
    found = _arranged(folder, StripePictures(bits=3, code="xor", base_bit=1))
    assert found.code == XorCode(rows=False, base_px=4)


def test_a_code_of_more_digits_or_wider_stripes_than_ours_stays_what_it_is(tmp_path: Path) -> None:
    folder = _folder(tmp_path, [f"{i}.png" for i in range(9)])
    for part in (StripePictures(bits=4), StripePictures(bits=3, unit_px=2)):
        found = _arranged(folder, part, Skipped(count=9 - 2 * part.bits)).code
        assert isinstance(found, CapturedCode)


@pytest.mark.parametrize(("code", "base_bit"), [("binary", 0), ("xor", 2)])
def test_a_code_that_is_not_ours_stays_what_it_is(tmp_path: Path, code: Any, base_bit: int) -> None:
    folder = _folder(tmp_path, [f"{i}.png" for i in range(6)])
    part = StripePictures(bits=3, code=code, base_bit=base_bit)
    assert isinstance(_arranged(folder, part).code, CapturedCode)


def test_columns_and_rows_of_two_codes_are_not_our_code(tmp_path: Path) -> None:
    folder = _folder(tmp_path, [f"{i:02}.png" for i in range(10)])
    columns, rows = (
        StripePictures(bits=3, code="xor"),
        StripePictures(axis="rows", bits=2, code="xor", base_bit=1),
    )
    assert isinstance(_arranged(folder, columns, rows).code, CapturedCode)


def test_a_mapping_cannot_leave_its_folder_or_code_nothing() -> None:
    for name in ("../*", "/etc/*", "a/../../b.png", "C:/x.png"):
        with pytest.raises(ValidationError, match="inside the folder"):
            Mapping(parts=(StripePictures(bits=3),), projector_size_px=SIZE, files=(name,))
    with pytest.raises(ValidationError, match="nothing is coded"):
        Mapping(parts=(WhitePicture(),), projector_size_px=SIZE)


def test_a_mapping_that_does_not_fit_yet_has_a_table_all_the_same(tmp_path: Path) -> None:
    folder = _folder(tmp_path, ["0.png", "1.png", "2.png", "w.png"])
    parts: tuple[Part, ...] = (StripePictures(bits=1), WhitePicture(files=("w.png", "x.png")))
    mapping = Mapping(parts=parts, projector_size_px=SIZE, files=("*",))
    assert draft_table(folder, mapping) == (
        ("0.png", "columns, gray bit 0"),
        ("1.png", "columns, gray bit 0 inverse"),
        ("2.png", "not in the mapping"),
        ("w.png", "white"),
    )
    more = mapping.model_copy(update={"parts": (StripePictures(bits=2), parts[1])})
    assert draft_table(folder, more)[3] == ("-", "columns, gray bit 0 inverse: no picture")
    lacking = mapping.model_copy(update={"missing": (1,), "files": ("0.png",)})
    assert draft_table(folder, lacking)[:1] == (("0.png", "columns, gray bit 0"),)


def test_two_codes_of_rows_are_not_our_code(tmp_path: Path) -> None:
    folder = _folder(tmp_path, [f"{i:02}.png" for i in range(14)])
    columns, rows = StripePictures(bits=3), StripePictures(axis="rows", bits=2)
    assert isinstance(_arranged(folder, columns, rows, Skipped(count=4)).code, GrayCode)
    assert isinstance(_arranged(folder, columns, rows, rows).code, CapturedCode)
