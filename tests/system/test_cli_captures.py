"""A stranger's folder, from pictures to exported columns and depth, by commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dsl_core.cli import main
from dsl_core.io.result.result_file import load_result
from dsl_core.model.captured_code import Stripes
from tests.cases.foreign_captures import CAMERA, PROJECTOR, counted_sinusoids, for_screens, frames, write


def test_pictures_become_columns_and_with_a_calibration_depth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    write(tmp_path / "set", {f"im{i:02d}.png": p for i, p in enumerate([*pictures, white, black])})
    assert main(["import", "set", "--guess", "--projector", "128x96", "-o", "a.dsl"]) == 0
    said = capsys.readouterr().out
    assert "columns, gray bit 6 inverse" in said
    assert "set.mapping.json" in said
    assert main(["reconstruct", "a.dsl"]) == 0
    assert "Name one with --calibration" in " ".join(capsys.readouterr().out.split())
    assert main(["export", "a.zarr", "npy", "a.npy"]) == 0
    assert np.isfinite(np.load("a_column.npy")).mean() > 0.9

    width, height = CAMERA
    focal = 1.5 * width
    stereo = {
        "cam_K": [[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]],
        "proj_K": [[focal * 0.72, 0, 42], [0, focal * 0.72, PROJECTOR[1] / 2], [0, 0, 1]],
        "R": np.eye(3).tolist(),
        "T": [100, 0, 0],
    }
    Path("stereo.json").write_text(json.dumps(stereo), encoding="utf-8")
    sizes = ["--camera-size", "160x120", "--projector", "128x96"]
    assert main(["import", "stereo.json", *sizes, "-o", "rig.json"]) == 0
    assert "no camera distortion" in capsys.readouterr().out
    assert (
        main(["import", "set", "--mapping", "set.mapping.json", "--calibration", "rig.json", "-o", "b.dsl"])
        == 0
    )
    assert main(["import", "set", "--guess"]) == 2
    assert "set.mapping.json" in capsys.readouterr().err
    assert main(["reconstruct", "b.dsl"]) == 0
    assert "have a depth" in capsys.readouterr().out
    # The wall is where its columns meet the rays of the camera: 0.72 * 240 px * 100 mm over 20.7 px and more.
    depth = load_result(Path("b.zarr"))["depth_mm"].values
    assert np.nanmedian(depth[:10]) == pytest.approx(834, rel=0.1)


def test_pictures_that_go_against_a_mapping_are_told_or_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    named = {f"{i:02d}.png": p for i, p in enumerate([*pictures, white, black])}
    write(tmp_path / "set", named)
    assert main(["import", "set", "--guess", "--projector", "128x96"]) == 0
    capsys.readouterr()
    by_mapping = ["--mapping", "set.mapping.json"]
    assert main(["import", "set", *by_mapping]) == 0
    assert "Unsure" not in capsys.readouterr().out
    write(tmp_path / "spoilt", named | {"05.png": pictures[0]})
    assert main(["import", "spoilt", *by_mapping]) == 0
    assert "Unsure: 04.png and 05.png should be a pattern" in " ".join(capsys.readouterr().out.split())
    write(tmp_path / "shifted", named | {"dark.png": black})
    (tmp_path / "shifted" / "07.png").unlink()
    assert main(["import", "shifted", *by_mapping, "-o", "a.dsl"]) == 2
    assert "a picture is missing, or another stands in its place" in " ".join(capsys.readouterr().err.split())
    assert not Path("a.dsl").exists()


def test_a_folder_of_no_capture_ends_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "few", {"a.png": np.zeros((8, 8), np.uint16)})
    assert main(["import", str(tmp_path / "few"), "--guess"]) == 2
    assert "contains 1 picture (" in capsys.readouterr().err
    assert main(["import", str(tmp_path / "few")]) == 2
    assert "Add --guess for pictures of another program." in capsys.readouterr().err


@pytest.mark.slow
def test_values_are_judged_before_and_after_an_import(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    named = {f"im{i:02d}.png": for_screens(p) for i, p in enumerate([*pictures, white, black])}
    write(tmp_path / "set", named)

    def say(*words: str) -> str:
        assert main(list(words)) == 0
        return " ".join(capsys.readouterr().out.split())

    said = say("import", "set", "--guess", "--projector", "128x96", "-o", "a.dsl")
    assert "they are decoded from sRGB" in said
    assert "Values, decoded from sRGB, are linear in light" in said
    # A person may correct the mapping in an editor: it carries no checksum.
    text = Path("set.mapping.json").read_text(encoding="utf-8")
    Path("set.mapping.json").write_text(text.replace('"srgb"', '"linear"'), encoding="utf-8")
    said = say("import", "set", "--mapping", "set.mapping.json", "-o", "b.dsl")
    assert "Warning: set encoding of the mapping to srgb" in said
    facts = list[str]()
    # Values that are not linear in light are a finding, as wrong pictures are.
    for name, ends_with in (("a.dsl", 0), ("b.dsl", 2)):
        assert main(["info", name, "--verify", "--json"]) == ends_with
        facts.append(json.loads(capsys.readouterr().out)["values"])
    assert facts[0].startswith("linear in light")
    assert facts[1].startswith("not linear in light but encoded, as sRGB")
    told = json.loads(say("import", "set", "--mapping", "set.mapping.json", "--encoding", "srgb", "--json"))
    assert (told["encoding"], told["linearity"]["verdict"]) == ("srgb", "linear")
    assert main(["import", "set", "--encoding", "srgb"]) == 2
    assert "needs --guess or --mapping" in capsys.readouterr().err
    assert main(["import", "set", "--guess", "--encoding", "gamma"]) == 2
    assert "must be linear or srgb" in capsys.readouterr().err


def test_rows_alone_are_imported_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pictures, white, black = frames([("rows", Stripes(bits=7))])
    write(tmp_path / "set", {f"im{i:02d}.png": p for i, p in enumerate([*pictures, white, black])})
    assert main(["import", "set", "--guess", "--projector", "128x96", "-o", "a.dsl"]) == 0
    assert main(["reconstruct", "a.dsl"]) == 0
    assert " % of the pixels have a row." in " ".join(capsys.readouterr().out.split())


def test_an_interrupted_import_by_a_guess_is_continued_by_the_same_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    write(tmp_path / "set", {f"im{i:02d}.png": p for i, p in enumerate([*pictures, white, black])})
    line = ["import", "set", "--guess", "--projector", "128x96", "-o", "a.dsl"]

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("dsl_core.workflows.captures._write", stop)
        assert main(line) != 0
    assert Path("set.mapping.json").exists()
    assert main(line) == 0
    assert "Imported to a.dsl" in capsys.readouterr().out
    changed = Path("set.mapping.json")
    changed.write_text(changed.read_text().replace('"inverse"', '"none"'))
    content = changed.read_bytes()
    assert main(line) == 2
    assert "set.mapping.json already exists" in capsys.readouterr().err
    assert changed.read_bytes() == content


def test_a_guess_that_decodes_little_is_kept_but_not_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    pictures, white, black = frames([("columns", Stripes(bits=7))])
    write(tmp_path / "set", {f"im{i:02d}.png": p for i, p in enumerate([*pictures, white, black])})
    line = ["import", "set", "--guess", "--projector", "128x96"]
    assert main([*line, "-o", "a.dsl", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["decided_share"] > 0.95
    monkeypatch.setattr("dsl_core.cli.captures.FAIR_SHARE", 1.1)
    assert main([*line, "-o", "b.dsl", "--force"]) == 2
    assert "nothing was imported. Correct set.mapping.json" in capsys.readouterr().err
    assert not Path("b.dsl").exists()
    assert main(["import", "set", "--mapping", "set.mapping.json"]) == 0
    assert "Warning: the mapping is likely wrong" in " ".join(capsys.readouterr().out.split())


def test_a_width_that_nothing_tells_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    _, size = counted_sinusoids(tmp_path / "set")
    assert main(["import", "set", "--guess", "--projector", size, "-o", "a.dsl"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "stripes of 10 px just cover 160 px, those of 16 px do as well" in said
    assert "nothing was imported. Correct set.mapping.json (unit_px of the stripes" in said
    assert main(["import", "set", "--mapping", "set.mapping.json", "-o", "a.dsl"]) == 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("set", "--guess", "--from-projector"),
            "set is a folder; --from-projector belongs to a stereo",
        ),
        (
            ("set", "--camera-curves", "a", "--led-curves", "b"),
            "--camera-curves, --led-curves belong to a stereo",
        ),
        (("set", "--unit-mm", "1000"), "has no lengths; --unit-mm belongs to a stereo file or a published"),
        (
            ("c.json", "--encoding", "srgb"),
            "is a stereo file; --encoding belongs to a folder of",
        ),
        (
            ("c.json", "--guess", "--set", "cam2"),
            "--guess, --set belong to a folder of pictures. Name",
        ),
    ],
)
def test_options_of_another_kind_of_source_are_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    write(Path("set"), {"a.png": np.zeros((4, 4), np.uint16)})
    Path("c.json").write_text("{}", encoding="utf-8")
    assert main(["import", *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
