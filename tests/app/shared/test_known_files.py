from __future__ import annotations

import json
from pathlib import Path

import pytest
from dsl_app.shared.known_files import RESULT_NAME, Kind, breakable, first_free, kind_of, meant_by, refusal
from dsl_app.shared.settings import RecentFiles, Settings

from dsl_core.io import MANIFEST_NAME
from dsl_core.io.result.annotations_file import annotations_path


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("manifest.json", Kind.SCAN),
        ("zarr.json", Kind.RESULT),
        ("campaign.json", Kind.CAMPAIGN),
    ],
)
def test_folders_are_known_by_a_file_which_may_be_meant_instead(
    tmp_path: Path, name: str, kind: Kind
) -> None:
    (tmp_path / name).write_text("{}")
    assert kind_of(tmp_path) is kind
    assert meant_by(tmp_path / name) == tmp_path


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (json.dumps({"film": {}, "name": "lab"}), Kind.CALIBRATION),
        (json.dumps({"spectral": {}}), Kind.PLAN),
        (json.dumps({"levels": "", "frames": 32}), Kind.PATTERNS),
        (json.dumps([1, 2]), Kind.UNKNOWN),
        ("{ cut off", Kind.UNKNOWN),
    ],
)
def test_json_is_known_by_what_it_holds(tmp_path: Path, content: str, kind: Kind) -> None:
    path = tmp_path / "a.json"
    path.write_text(content)
    assert kind_of(path) is kind
    assert path.name in refusal(path)


def test_a_folder_of_pictures_has_as_many_as_a_capture_needs(tmp_path: Path) -> None:
    for name in ("a.PNG", "b.tif", "c.bmp", "notes.txt"):
        (tmp_path / name).touch()
    assert kind_of(tmp_path) is Kind.UNKNOWN
    (tmp_path / "d.jpg").touch()
    assert kind_of(tmp_path) is Kind.PICTURES


def test_every_refusal_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "spectrum.csv").write_text("nm,r\n")
    (tmp_path / "cat.jpeg").write_bytes(b"\xff\xd8")
    assert "Open a result first" in refusal(tmp_path / "spectrum.csv")
    assert "only with all pictures of its capture" in refusal(tmp_path / "cat.jpeg")
    few = tmp_path / "few"
    few.mkdir()
    (few / "white.png").touch()
    assert "has 1 picture; a capture has at least 4" in refusal(few)
    (few / "frames.npz").touch()
    assert kind_of(few) is Kind.PICTURES, "an archive may hold them all"
    assert "no longer exists" in refusal(tmp_path / "gone.zarr")


def test_folders_and_files_of_no_use_are_told_in_a_sentence(tmp_path: Path) -> None:
    said = {}
    for name in ("empty", "part.dsl", "part.zarr"):
        (tmp_path / name).mkdir()
        if name != "empty":
            (tmp_path / name / "Bläu <b>.txt").touch()
    (tmp_path / "a.json").write_text('{"a": 1}')
    for name in ("empty", "part.dsl", "part.zarr", "a.json"):
        said[name] = refusal(tmp_path / name)
        assert len(said[name]) < 130, "nobody reads more of a message"
    assert "empty is empty" in said["empty"]
    assert f"not a whole scan: it has no {MANIFEST_NAME}" in said["part.dsl"]
    assert f"not a whole result: it has no {RESULT_NAME}" in said["part.zarr"]
    assert "neither a plan" in said["a.json"]


def test_marks_mean_the_result_beside_them(tmp_path: Path) -> None:
    assert meant_by(tmp_path / "leaf.marks.json") == tmp_path / "leaf.zarr"
    (tmp_path / "leaf 1.5").mkdir()
    (tmp_path / "leaf 1.5" / RESULT_NAME).touch()
    for result in (tmp_path / "leaf 1.5", tmp_path / "leaf 1.6.zarr"):
        assert meant_by(annotations_path(result)) == result


def test_a_free_name_counts_on_from_those_that_are_taken(tmp_path: Path) -> None:
    assert first_free(tmp_path, "scan.v1", ".dsl") == tmp_path / "scan.v1.dsl"
    for name in ("scan.v1.dsl", "scan.v1-2.dsl", "scan.v1-4.dsl"):
        (tmp_path / name).mkdir()
    assert first_free(tmp_path, "scan.v1", ".dsl") == tmp_path / "scan.v1-3.dsl"
    assert first_free(tmp_path, "campaign") == tmp_path / "campaign"


def test_a_path_may_break_at_its_slashes() -> None:
    assert breakable(Path("a/b/c")).split("\u200b") == ["a/", "b/", "c"]


def test_recent_files_are_kept_in_the_settings(tmp_path: Path) -> None:
    settings = Settings()
    recent = RecentFiles(settings)
    seen: list[tuple[Path, ...]] = []
    recent.paths.changed.connect(seen.append)
    for name in ("a", "b", "a"):
        recent.add(tmp_path / name)
    assert recent.paths.value == (tmp_path / "a", tmp_path / "b")
    recent.forget(tmp_path / "a")
    assert settings.recent == [str(tmp_path / "b")]
    assert seen[-1] == (tmp_path / "b",)
