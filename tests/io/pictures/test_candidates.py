"""Captures that a folder may hold, from the names of its files alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.errors import StoreError
from dsl_core.io.pictures.arrange import picture_files
from dsl_core.io.pictures.candidates import FEWEST, MOST_ABSENT, Candidate, candidates


def folder_of(folder: Path, *names: str) -> Path:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    return folder


def numbered(stem: str, *numbers: int) -> list[str]:
    return [f"{stem}{number}.png" for number in numbers]


def names_of(candidate: Candidate) -> list[str | None]:
    return [None if picture is None else picture.path.name for picture in candidate.pictures]


def test_one_row_of_names_is_one_capture(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "scan", *numbered("im", 9, 10, 11, 12))
    whole, single = candidates(folder)
    assert single == []
    (only,) = whole
    assert (only.name, only.files, only.left_out, only.absent) == ("scan", ("*",), 0, ())
    assert names_of(only) == ["im9.png", "im10.png", "im11.png", "im12.png"]


def test_four_pictures_are_a_capture_and_three_are_none(tmp_path: Path) -> None:
    assert FEWEST == 4
    folder_of(tmp_path, *numbered("im", 1, 2, 3))
    with pytest.raises(StoreError, match="contains 3 pictures"):
        candidates(tmp_path)
    folder_of(tmp_path, "im4.png")
    assert len(candidates(tmp_path)[0][0].pictures) == 4


def test_numbers_that_are_absent_leave_places(tmp_path: Path) -> None:
    whole, _ = candidates(folder_of(tmp_path, *numbered("im", 5, 6, 8, 9, 12)))
    first, second = whole
    assert first.absent == ()
    assert second.absent == (2, 5, 6)
    assert names_of(second) == ["im5.png", "im6.png", None, "im8.png", "im9.png", None, None, "im12.png"]


@pytest.mark.parametrize(("last", "variants"), [(4, 2), (7, 2), (8, 1)])
def test_four_numbers_at_most_may_be_absent(tmp_path: Path, last: int, variants: int) -> None:
    assert MOST_ABSENT == 4
    whole, _ = candidates(folder_of(tmp_path, *numbered("im", 0, 1, 2, last)))
    assert len(whole) == variants


def test_two_kinds_of_names_may_be_two_captures(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "scan", *numbered("left_", 0, 1, 2, 3), *numbered("right_", 0, 1, 2, 3, 4))
    whole, single = candidates(folder)
    assert [len(each.pictures) for each in whole] == [9]
    assert [(each.name, len(each.pictures), each.left_out) for each in single] == [
        ("left", 4, 5),
        ("right", 5, 4),
    ]
    assert [each.files for each in single] == [("left_*.png",), ("right_*.png",)]


def test_a_folder_for_each_camera_is_a_capture_of_its_own(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, *numbered("a/im", 1, 2, 3, 4), *numbered("b/im", 1, 2, 3, 4))
    whole, single = candidates(folder)
    assert whole[0].files == ("*", "*/*")
    assert [(each.name, each.left_out) for each in single] == [("a", 4), ("b", 4)]
    assert [each.files for each in single] == [("a/*",), ("b/*",)]


def test_brackets_in_names_stand_for_themselves(tmp_path: Path) -> None:
    kinds = [f"day [{part}]/{side}" for part in "ab" for side in ("left", "right")]
    folder_of(tmp_path, *(f"{kind}[{number:02d}].png" for kind in kinds for number in range(4)))
    _, single = candidates(tmp_path)
    assert "day [[]a]/left[[]*].png" in {each.files[0] for each in single}
    for each in single:
        found = picture_files(tmp_path, each.files)
        assert found == [picture.path for picture in each.pictures if picture is not None]


def test_strays_are_left_out_of_a_second_candidate(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "scan", *numbered("im", 1, 2, 3, 4), "overview.png")
    whole, single = candidates(folder)
    assert [(len(each.pictures), each.left_out) for each in whole] == [(5, 0), (4, 1)]
    assert whole[1].files == ("im*.png",)
    assert [(each.name, len(each.pictures)) for each in single] == [("im", 4)]


def test_each_file_that_stands_alone_may_be_the_only_stray(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "scan", *numbered("im", 1, 2, 3, 4), "black.png", "white.png", "zoo.png")
    whole, _ = candidates(folder)
    alone = [{p.path.stem for p in each.pictures if p and "im" not in p.path.stem} for each in whole]
    assert alone == [{"black", "white", "zoo"}, {"black", "white"}, {"black", "zoo"}, {"white", "zoo"}, set()]
    assert [each.left_out for each in whole] == [0, 1, 1, 1, 3]


def test_pictures_named_by_numbers_alone_are_called_by_the_first(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "scan", *numbered("", 1, 2, 3, 4), *numbered("white", 1, 2, 3, 4))
    assert [each.name for each in candidates(folder)[1]] == ["1", "white"]


@pytest.mark.parametrize("within", ["", "left/"])
def test_exposures_that_end_names_are_captures_of_their_own(tmp_path: Path, within: str) -> None:
    stems = [*(f"{within}{k}_" for k in range(4)), f"{within}white_"]
    names = [f"{stem}{exposure}.png" for exposure in ("0.5ms", "80ms") for stem in stems]
    _, single = candidates(folder_of(tmp_path, *names))
    assert [each.name for each in single] == [f"{within}0.5ms", f"{within}80ms"]
    wanted = {f"{stem}80ms.png".removeprefix(within) for stem in stems}
    assert set(names_of(single[1])) == wanted


def test_times_that_end_names_are_no_exposures(tmp_path: Path) -> None:
    names = [f"cam{c}_{33 * k:04d}ms.png" for c in (1, 2) for k in range(5)]
    _, single = candidates(folder_of(tmp_path, *names))
    assert [(each.name, each.files) for each in single if not each.absent] == [
        ("cam1_ms", ("cam1_*ms.png",)), ("cam2_ms", ("cam2_*ms.png",)),
    ]  # fmt: skip
    assert candidates(folder_of(tmp_path / "one", *(f"a_{33 * k}ms.png" for k in range(5))))[1] == []
