"""Whatever is wrong ends in one clear sentence and exit code 2, and nothing is lost."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.io import atomic
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.frame_store import FrameStore
from dsl_core.io.sealed import unseal
from dsl_core.model.frames import Frame

from .conftest import SMALL_PLAN, SMALL_RIG, Give

Damage = Callable[[Path], None]


def _chunk(scan: Path, index: int) -> Path:
    return scan / "frames" / f"c.{index}.0.0"


def _missing(scan: Path) -> None:
    _chunk(scan, 7).unlink()


def _extra(scan: Path) -> None:
    shutil.copy(_chunk(scan, 7), _chunk(scan, 999))


def _swapped(scan: Path) -> None:
    one, other = _chunk(scan, 7).read_bytes(), _chunk(scan, 9).read_bytes()
    _chunk(scan, 7).write_bytes(other)
    _chunk(scan, 9).write_bytes(one)


def _truncated(scan: Path) -> None:
    _chunk(scan, 7).write_bytes(_chunk(scan, 7).read_bytes()[:100])


def _repeated(scan: Path) -> None:
    log = scan / "frames.jsonl"
    entries = [json.loads(unseal(line)) for line in log.read_bytes().splitlines()]
    entries[8]["frame_id"] = entries[7]["frame_id"]
    log.write_text("".join(json.dumps(entry) + "\n" for entry in entries))


def _wrong_size(scan: Path) -> None:
    FrameStore(scan / "frames", 1, 36, 56).write(7, np.zeros((36, 56), np.uint16))


def _wrong_type(scan: Path) -> None:
    from numcodecs import blosc  # type: ignore[import-untyped]

    _chunk(scan, 7).write_bytes(blosc.Blosc("zstd").encode(np.zeros((72, 112), np.uint8)))


def _half_a_manifest(scan: Path) -> None:
    path = scan / "manifest.json"
    path.write_text(path.read_text()[:200])


def _lost_metadata(scan: Path) -> None:
    (scan / "frames" / "zarr.json").unlink()


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (_missing, "lacks 1 of 154 frames, the first is frame 8 (code pattern 8, setting 1). Resume"),
        (_extra, "contains 1 more frames than the 154 of its plan, the first is number 1000"),
        (_swapped, "(swapped or copied)"),
        (_truncated, "has 100 of"),
        (_repeated, "Frame 9 (code pattern 9, setting 1)"),
        (_wrong_size, "contains 4032 bytes of 16 bit values instead of 16128"),
        (_wrong_type, "contains 8064 bytes of 8 bit values instead of 16128"),
        (_half_a_manifest, "manifest.json is damaged"),
        (_lost_metadata, "zarr.json is missing or damaged"),
    ],
)
def test_damaged_frames(give: Give, scan_copy: Path, damage: Damage, sentence: str) -> None:
    damage(scan_copy)
    ending = give("reconstruct", scan_copy)
    assert (ending.code, ending.out) == (2, "")
    assert sentence in ending.sentence
    assert not scan_copy.with_suffix(".zarr").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (_missing, "lacks 1 frame."),
        (_swapped, "has 2 damaged frames, captured again now."),
        (_truncated, "has 1 damaged frame, captured again now."),
        (_wrong_size, "has 1 damaged frame, captured again now."),
        (_wrong_type, "has 1 damaged frame, captured again now."),
    ],
)
def test_resume_mends_damaged_frames_to_the_bit(
    give: Give, scan_copy: Path, finished: Path, damage: Damage, says: str
) -> None:
    damage(scan_copy)
    ending = give("resume", scan_copy)
    assert (ending.code, says in ending.out) == (0, True)
    assert "All 154 frames are saved" in ending.out
    sound, mended = ScanReader(finished / "scan.dsl"), ScanReader(scan_copy)
    for shot in sound.plan.shots():
        np.testing.assert_array_equal(mended.read(shot), sound.read(shot))


def _calibration(scan: Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((scan / "manifest.json").read_text())["calibration"]
    return found


def _with(**changes: object) -> Callable[[Path], str]:
    return lambda scan: json.dumps({**_calibration(scan), **changes})


def _other_size(scan: Path) -> str:
    calibration = ScanReader(scan).calibration
    assert calibration is not None
    return calibration.model_copy(update={"camera": calibration.camera.resized(100, 60)}).model_dump_json()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (_other_size, "camera of 112 x 72 pixels, the calibration 'twin' is for 100 x 60"),
        (_with(white_scale=float("nan")), "white_scale must be a finite number"),
        (_with(white_scale=-1), "white_scale must be greater than 0"),
        (_with(schema_version=99), "schema version 99"),
        (lambda scan: "{", "is not JSON"),
        (lambda scan: "", "is not JSON"),
    ],
)
def test_bad_calibrations(
    give: Give, finished: Path, tmp_path: Path, text: Callable[[Path], str], sentence: str
) -> None:
    path = tmp_path / "rig.json"
    path.write_text(text(finished / "scan.dsl"))
    ending = give("reconstruct", finished / "scan.dsl", "-o", tmp_path / "a.zarr", "--calibration", path)
    assert ending.code == 2
    assert sentence in ending.sentence
    assert not (tmp_path / "a.zarr").exists()


def _dark(rng: np.random.Generator) -> NDArray[np.uint16]:
    return rng.normal(260, 2, (72, 112)).round().astype(np.uint16)


def _blinding(rng: np.random.Generator) -> NDArray[np.uint16]:
    return np.full((72, 112), 4095, np.uint16)


@pytest.mark.parametrize(
    ("picture", "sentence"),
    [
        (_dark, "too little projector light"),
        (_blinding, "The white frame is saturated in 100% of its pixels at every setting"),
    ],
)
def test_frames_that_show_nothing(
    give: Give,
    finished: Path,
    tmp_path: Path,
    picture: Callable[[np.random.Generator], NDArray[np.uint16]],
    sentence: str,
) -> None:
    good = ScanReader(finished / "scan.dsl")
    scan, rng = tmp_path / "scan.dsl", np.random.default_rng(1)
    with ScanWriter.create(scan, good.plan) as writer:
        for shot in writer.missing():
            writer.write(shot, Frame(picture(rng), shot.exposure_ms, shot.index + 1.0, shot.index + 1))
    rig = tmp_path / "rig.json"
    rig.write_text(json.dumps(_calibration(finished / "scan.dsl")))
    assert "contains no calibration" in give("reconstruct", scan).sentence
    ending = give("reconstruct", scan, "--calibration", rig)
    assert ending.code == 2
    assert sentence in ending.sentence


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("", "Missing command"),
        ("scna", "There is no command 'scna'"),
        ("scan", "SCAN.dsl is missing: New folder for the frames. See"),
        ("scan a.dsl --rigg twin", "There is no option --rigg. Did you mean --rig?"),
        ("scan a.dsl --rig twinn", "no rig 'twinn'; installed rigs: "),
        ("scan a.dsl -O scene", "must be key=value"),
        ("scan a.dsl -O scene=plane -O scene=box", "is given twice"),
        ("scan a.dsl -O scene=plain", "no scene 'plain'"),
        ("scan a.dsl -O sise=112x72", "no option sise"),
        ("scan a.dsl -O size=112", "size must be like 890x580"),
        ("scan a.dsl -O noise=maybe", "must be 'on' or 'off'"),
        ("scan a.dsl -O size=112x72 --lines 5", "--lines must be WIDTHxSTEP"),
        ("scan a.dsl -O size=112x72 --lines 5x9", "leave columns between them dark"),
        ("scan a.dsl -O size=112x72 --lines 5x2 --comb 5x2x50", "cannot be combined"),
        ("scan a.dsl -O size=112x72 --comb 50x2x50", "narrower than its period"),
        ("scan a.dsl -O size=112x72 --code rows", "one of full, columns, xor-04"),
        ("scan a.dsl -O size=112x72 --setting 100", "--setting must be EXPOSURE_MS@LEVEL"),
        ("scan a.dsl -O size=112x72 --setting 100@2", "settings.0.level"),
        ("scan a.dsl -O size=112x72 --setting nan@0.5", "settings.0.exposure_ms"),
        ("scan a.dsl -O size=112x72 --setting 99999@0.5", "the camera supports"),
        ("scan a.dsl --plan absent.json", "absent.json cannot be read"),
        ("scan a.dsl --plan empty.json", "empty.json is not valid"),
        ("scan a.dsl --plan empty.json --code full", "leave out --code"),
        ("scan file/a.dsl -O size=112x72", "cannot be created: a file is where a folder is needed"),
        ("scan s3://bucket/a.dsl -O size=112x72", "s3://bucket/a.dsl is an address of an object store"),
        ("plan s3://bucket/a.json -O size=112x72", "Give a path of this computer"),
        ("resume absent.dsl", "is not a scan"),
        ("reconstruct absent.dsl", "is not a scan"),
        ("reconstruct folder", "is not a scan"),
        ("reconstruct absent.dsl --bands 430-660", "--bands must be START:STOP:STEP"),
        ("reconstruct absent.dsl --bands 430:660:7", "does not end on a band"),
        ("reconstruct absent.dsl --model magic", "--model must be one of auto, grating, hybrid, grid"),
        ("reconstruct absent.dsl --solver magic", "--solver must be one of best, published, nearest-line"),
        ("reconstruct absent.dsl --device tpu", "--device must be one of"),
        ("reconstruct absent.dsl -o folder", "already exists"),
        ("reconstruct absent.dsl --calibration absent.json", "There is no file absent.json"),
        ("evaluate absent.zarr", "is not a result"),
        ("export absent.zarr ply a.ply", "is not a result"),
        ("export absent.zarr stl a.stl", "is not a result"),
        ("export absent.zarr ply a.ply --pixel 1,2", "--pixel is for csv"),
        ("export absent.zarr csv a.csv --pixel 1;2", "--pixel must be x,y"),
        ("import absent", "is not a folder"),
        ("import folder", "folder is empty. Choose the folder"),
        ("info absent", "does not exist"),
        ("info folder", "is neither a scan"),
        ("info empty.json", "is not JSON"),
        ("demo --size small", "--size must be WIDTHxHEIGHT"),
        ("demo --size 64x42 --scene nowhere", "no scene 'nowhere'"),
    ],
)
def test_wrong_use(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    (tmp_path / "empty.json").write_text("")
    ending = give(*command.split())
    assert ending.code == 2
    assert sentence in ending.sentence
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == ["empty.json", "file", "folder"]


def test_an_error_in_json(give: Give) -> None:
    ending = give("reconstruct", "absent.dsl", "--json")
    assert ending.json["error"]["kind"] == "StoreError"
    assert ending.json["error"]["message"] == ending.sentence
    assert ending.json["exit_code"] == ending.code == 2


def test_a_traceback_only_when_asked(give: Give) -> None:
    for arguments in (("--debug", "info", "absent"), ("info", "absent", "--debug")):
        ending = give(*arguments)
        assert ending.code == 2
        assert "Traceback" in ending.err


def test_a_scan_is_named_so_that_it_is_found_again(
    give: Give, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for command in (("scan",), ("import", finished, "-o"), ("import", finished, "--guess", "-o")):
        told = give(*command, "figure.json")
        assert told.code == 2
        assert "Name it figure.dsl" in told.sentence
    assert not list(tmp_path.iterdir())


def test_a_scan_and_its_result_are_given_from_inside(
    give: Give, finished: Path, scan_copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(scan_copy)
    assert "already contains a scan" in give("scan", ".").sentence
    assert give("reconstruct", ".", "--depth-only").code == 0
    assert "exists" in give("reconstruct", "../scan.dsl", "--depth-only").sentence
    assert give("batch", ".", "--depth-only").out.endswith("1 complete before.\n")
    monkeypatch.chdir(shutil.copytree(finished / "scan.zarr", scan_copy.parent / "whole.zarr"))
    for command in ("evaluate", "report"):
        assert give(command, ".").code == 0
    assert "Nothing is marked" in give("spectra", ".", "--pins").sentence
    made = {"scan.dsl", "scan.zarr", "whole.zarr", "whole.html", "whole_report.html"}
    assert {each.name for each in scan_copy.parent.iterdir()} == made


def test_a_bug_is_called_one(give: Give, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dsl_core.io.describe.describe", lambda *_: 1 / 0)
    ending = give("info", "absent")
    assert ending.code == 1
    assert "bug in dsl-scan (ZeroDivisionError" in ending.sentence


def test_a_result_is_not_replaced_unasked(give: Give, finished: Path) -> None:
    before = (finished / "scan.zarr" / "zarr.json").stat().st_mtime_ns
    assert "already exists" in give("reconstruct", finished / "scan.dsl").sentence
    assert "already contains a scan" in give("scan", finished / "scan.dsl", *SMALL_RIG).sentence
    assert (finished / "scan.zarr" / "zarr.json").stat().st_mtime_ns == before


def test_force_replaces_no_scan_and_nobodys_folder(
    give: Give, scan_copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "dsl_core.workflows.scans.reconstruct_scan", lambda *_: 1 / 0
    )  # told before long work
    onto_itself = give("reconstruct", scan_copy, "-o", scan_copy, "--force")
    assert (onto_itself.code, "contains a scan and is not replaced" in onto_itself.sentence) == (2, True)
    assert ScanReader(scan_copy).missing() == []
    documents = tmp_path / "docs"
    documents.mkdir()
    (documents / "thesis.txt").write_text("years")
    for command in (["reconstruct", scan_copy, "-o", documents], ["export", scan_copy, "dataset", documents]):
        ending = give(*command, "--force")
        assert (ending.code, "is not replaced" in ending.sentence) == (2, True)
    assert (documents / "thesis.txt").read_text() == "years"


def test_a_disk_that_is_too_small_is_told_before_the_scan(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=1000))
    ending = give("scan", tmp_path / "a.dsl", *SMALL_RIG, *SMALL_PLAN)
    assert ending.code == 2
    assert "has 0 MB free" in ending.sentence
    assert not (tmp_path / "a.dsl").exists()


@pytest.mark.slow
def test_a_disk_that_fills_up_loses_nothing(
    give: Give, tmp_path: Path, finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, scan = [0], tmp_path / "a.dsl"

    def write_all(descriptor: int, data: bytes) -> None:
        written[0] += 1
        if written[0] > 50:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        whole(descriptor, data)

    whole = atomic.write_all
    with monkeypatch.context() as patch:
        patch.setattr(atomic, "write_all", write_all)
        ending = give("scan", scan, *SMALL_RIG, *SMALL_PLAN)
    assert ending.code == 2
    assert "disk is full" in ending.sentence
    assert 100 <= len(ScanReader(scan).missing()) < 154
    assert give("resume", scan).code == 0
    sound, mended = ScanReader(finished / "scan.dsl"), ScanReader(scan)
    for shot in sound.plan.shots():
        np.testing.assert_array_equal(mended.read(shot), sound.read(shot))


@pytest.mark.slow
def test_a_full_disk_while_the_result_is_saved(
    give: Give, tmp_path: Path, finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("dsl_core.io.result.row_writer.new_array", full)
    ending = give("reconstruct", finished / "scan.dsl", "-o", tmp_path / "a.zarr", "--depth-only")
    assert ending.code == 2
    assert "disk is full" in ending.sentence
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        ["batch", ".", "--report", "r.pdf"],
        ["evaluate", "a.zarr", "-o", "r.csv"],
        ["tradeoff", "--budget", "60s", "--report", "r.json"],
        ["calibrations", "show", "twin", "-o", "r.png"],
    ],
)
def test_a_page_is_not_written_under_the_ending_of_another_kind_of_file(
    give: Give, command: list[str]
) -> None:
    ending = give(*command)
    assert ending.code == 2
    assert ending.sentence.startswith(f"{command[-1]} is to be an HTML page")
