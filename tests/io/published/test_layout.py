"""What a published folder holds, file by file: names, numbers, sizes and what to do about them."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from dsl_core.io.published.layout import (
    FileRecord,
    FolderSurvey,
    PngInfo,
    as_published,
    find_folder,
    probe_png,
    survey,
)
from dsl_core.model.plan import MOST_PX, CapturePlan, GrayCode, LineComb, Role, Setting


def test_what_is_optional_may_be_absent_and_everything_else_is_wanted() -> None:
    records = [
        FileRecord("a", "a", "ok", ""),
        FileRecord("b", "b", "ok", ""),
        FileRecord("c", None, "missing", "put it there"),
        FileRecord("d", None, "optional", ""),
    ]
    assert as_published(records) == (2, 3)


PLAN = CapturePlan(
    camera_size_px=(24, 16),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=0.4), Setting(exposure_ms=20.0, level=0.8)),
    code_settings=(0,),
)


def png(path: Path, width: int = 24, height: int = 16, bits: int = 16, colour: int = 2) -> Path:
    """A file with the head and the end of a PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    head = struct.pack(">IIBB", width, height, bits, colour) + bytes(7)
    path.write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + head + b"\0\0\0\0IEND\xaeB`\x82")
    return path


def test_a_head_says_size_bits_and_channels(tmp_path: Path) -> None:
    channels = [probe_png(png(tmp_path / f"{colour}.png", 30, 20, 8, colour)) for colour in (0, 2, 3, 4, 6)]
    assert channels == [PngInfo(30, 20, 8, count) for count in (1, 3, 1, 2, 4)]
    assert "declares 0 x 20 px" in str(probe_png(png(tmp_path / "none.png", 0, 20)))
    assert "declares 30 x 0 px" in str(probe_png(png(tmp_path / "flat.png", 30, 0)))
    assert probe_png(png(tmp_path / "least.png", 1, 1)) == PngInfo(1, 1, 16, 3)
    widest = png(tmp_path / "widest.png", MOST_PX, 1), png(tmp_path / "highest.png", 1, MOST_PX)
    assert [probe_png(path) for path in widest] == [PngInfo(MOST_PX, 1, 16, 3), PngInfo(1, MOST_PX, 16, 3)]
    for size in ((MOST_PX + 1, 1), (1, MOST_PX + 1), (MOST_PX, MOST_PX)):
        assert "px, which no camera has" in str(probe_png(png(tmp_path / "more.png", *size)))
    whole = png(tmp_path / "a.png").read_bytes()
    for content, why in (
        (whole[:-1], "is cut off"), (b"x" + whole[1:], "is not a PNG image"),
        (whole[:20], "is not a PNG image"), (whole[:12] + b"IHDX" + whole[16:], "is not a PNG image"),
    ):  # fmt: skip
        (tmp_path / "b.png").write_bytes(content)
        assert probe_png(tmp_path / "b.png") == why
    assert str(probe_png(tmp_path / "nowhere.png")).startswith("cannot be read (")


def looked_at(root: Path, role: Role, count: int, setting: int = 0) -> FolderSurvey:
    found = FolderSurvey(root, PLAN)
    found.look_at_folder(role, setting, count)
    return found


def test_frames_under_their_published_names_are_used(tmp_path: Path) -> None:
    wanted = [png(tmp_path / f"ldr_exposure2/capture_{n:04d}.png") for n in range(3)]
    found = looked_at(tmp_path, "spectral", 3, 1)
    assert found.files == {("spectral", 1, n): path for n, path in enumerate(wanted)}
    assert [record.status for record in found.records] == ["ok"] * 3
    assert found.records[2].expected == found.records[2].found == "ldr_exposure2/capture_0002.png"


def test_numbers_from_one_are_used_as_if_from_zero(tmp_path: Path) -> None:
    files = [png(tmp_path / f"graycode_exposure1/graycode_{n:02d}.png") for n in (1, 2, 3)]
    found = looked_at(tmp_path, "code", 3)
    assert found.files == {("code", 0, n): path for n, path in enumerate(files)}
    assert {(record.status, record.advice) for record in found.records} == {
        ("misnamed", "the numbers start at 1; used as if they started at 0")
    }
    files[2].unlink()
    assert [record.status for record in looked_at(tmp_path, "code", 3).records] == ["missing", "ok", "ok"]


def test_numbers_from_one_are_doubted_where_another_setting_counts_from_zero(tmp_path: Path) -> None:
    for setting, numbers in ((1, (1, 2, 3)), (2, (0, 1, 2))):
        for n in numbers:
            png(tmp_path / f"ldr_exposure{setting}/capture_{n:04d}.png")
    told = {record.advice for record in looked_at(tmp_path, "spectral", 3).records}
    assert told == {
        "the numbers start at 1; used as if they started at 0, though those of ldr_exposure2 do: check that"
        " the first one is not missing here"
    }
    assert {record.advice for record in looked_at(tmp_path, "spectral", 3, 1).records} == {""}


def test_a_frame_of_another_name_is_used_by_its_number_and_what_is_too_many_is_not(tmp_path: Path) -> None:
    folder = tmp_path / "graycode_exposure1"
    png(folder / "graycode_00.png")
    png(folder / "frame 1.png")
    png(folder / "a0.png")
    png(folder / "cover.png")
    png(folder / "graycode_07.png")
    found = looked_at(tmp_path, "code", 3)
    assert [(r.expected.rpartition("/")[2], r.status) for r in found.records] == [
        ("graycode_00.png", "ok"), ("graycode_01.png", "misnamed"), ("graycode_02.png", "missing"),
        ("", "extra"), ("", "extra"), ("", "extra"),
    ]  # fmt: skip
    assert "rename it to graycode_01.png" in found.records[1].advice
    extra = [str(record.found).rpartition("/")[2] for record in found.records[3:]]
    assert extra == ["a0.png", "cover.png", "graycode_07.png"]
    assert set(found.files) == {("code", 0, 0), ("code", 0, 1)}


def test_the_only_image_of_a_folder_may_have_any_name(tmp_path: Path) -> None:
    path = png(tmp_path / "intensity1/white 12.png")
    found = looked_at(tmp_path, "white", 1)
    assert found.files == {("white", 0, 0): path}
    assert [record.status for record in found.records] == ["ok"]


@pytest.mark.parametrize(
    ("how", "status", "said"),
    [
        ({"width": 25}, "wrong size", "is 25 x 16 px, 24 x 16 is needed"),
        ({"height": 15}, "wrong size", "is 24 x 15 px, 24 x 16 is needed"),
        ({"colour": 0}, "wrong type", "has 1 channel(s) of 16 bit"),
        ({"bits": 4}, "wrong type", "has 3 channel(s) of 4 bit"),
        ({"bits": 8}, "ok", "8 bit only"),
        ({"bits": 16}, "ok", ""),
    ],
)
def test_a_frame_has_the_size_and_type_of_the_plan(
    tmp_path: Path, how: dict[str, int], status: str, said: str
) -> None:
    png(tmp_path / "black_exposure1/capture_0000.png", **how)
    (record,) = looked_at(tmp_path, "black", 1).records
    assert record.status == status
    assert record.advice.startswith(said)
    assert bool(looked_at(tmp_path, "black", 1).files) == (status == "ok")


def test_folders_are_found_under_earlier_names_and_in_spite_of_signs(tmp_path: Path) -> None:
    setting = PLAN.settings[0]
    assert find_folder(tmp_path, "white", 0, setting) is None
    near = tmp_path / "Intensity-1"
    near.mkdir()
    assert find_folder(tmp_path, "white", 0, setting) == near
    earlier = tmp_path / "intensity_40_white_crop/calibration00"
    earlier.mkdir(parents=True)
    assert find_folder(tmp_path, "white", 0, setting) == earlier
    (tmp_path / "intensity1").mkdir()
    assert find_folder(tmp_path, "white", 0, setting) == tmp_path / "intensity1"
    lines = tmp_path / "step2_20ms_crop/calibration00"
    lines.mkdir(parents=True)
    assert find_folder(tmp_path, "spectral", 1, PLAN.settings[1]) == lines
    png(near / "w.png")
    (tmp_path / "intensity1").rmdir()
    earlier.rmdir()
    (record,) = looked_at(tmp_path, "white", 1).records
    assert (record.status, record.advice) == ("misnamed", "used; rename the folder to intensity1")


def test_a_survey_has_a_line_for_a_folder_that_is_missing_and_for_depth(tmp_path: Path) -> None:
    found = survey(tmp_path, PLAN)
    spectral = next(record for record in found.records if record.expected == "ldr_exposure1/")
    assert f"({PLAN.spectral_count} images)" in spectral.advice
    white = next(record for record in found.records if record.expected == "intensity1/")
    assert "(1 image)" in white.advice
    assert len(found.by_place) == PLAN.shot_count
    assert found.by_place["spectral", 1, 0].expected == "ldr_exposure2/"
    assert (found.records[-1].expected, found.records[-1].status) == ("depth.npy", "optional")
    (tmp_path / "depth.npy").write_bytes(b"")
    assert survey(tmp_path, PLAN).records[-1].status == "ok"
