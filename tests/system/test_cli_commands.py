"""Every command does its work and says the same in words and in JSON."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import dsl_core
from dsl_core import pipeline
from dsl_core.cli.options import PlanChoice, PlanSource
from dsl_core.cli.scans import next_step
from dsl_core.devices.replay import replay_rig
from dsl_core.errors import PlanError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.objects import rooms
from dsl_core.io.plan_file import load_plan, save_plan
from dsl_core.io.result.result_file import load_result
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.origin import rig_notes
from dsl_core.model.plan import EnsembleCode, GrayCode, LineComb, Setting, XorCode
from dsl_core.model.presets import PRESETS, preset_plan
from tests.cases.memory_sink import MemorySink
from tests.cases.object_store import running

from .conftest import SMALL_PLAN, SMALL_RIG, Give

ROOT = Path(__file__).parents[2]


def test_help_and_version_need_no_heavy_library() -> None:
    program = (
        "import sys; from dsl_core.cli import main; main(['--help']); main(['--version']);"
        "print(sorted(set(sys.modules) & {'numpy', 'torch', 'scipy', 'cv2', 'xarray', 'zarr', 'pydantic'}))"
    )
    answer = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert "reconstruct" in answer
    assert answer.splitlines()[-2:] == [f"dsl-scan {dsl_core.__version__}", "[]"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    ["design out.json --calibration missing.json", "calibrate all campaign --rig nothing"],
)
def test_a_refusal_does_not_wait_for_torch(arguments: str, tmp_path: Path) -> None:
    code = (
        f"import sys; from dsl_core.cli import main;print(main({arguments.split()}), 'torch' in sys.modules)"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert answer.stdout.split() == ["2", "False"]


@pytest.mark.parametrize(
    "command",
    [
        "demo",
        "rigs",
        "scenes",
        "plan",
        "scan",
        "resume",
        "reconstruct",
        "evaluate",
        "export",
        "mesh",
        "import",
        "info",
    ],
)
def test_every_command_has_help_and_json(give: Give, command: str) -> None:
    ending = give(command, "--help")
    assert ending.code == 0
    assert "--json" in ending.out


def test_rigs_and_scenes(give: Give) -> None:
    assert {rig["name"] for rig in give("rigs", "--json").json["rigs"]} >= {"twin", "replay"}
    assert "twin of the published rig" in give("rigs").out
    scenes = {scene["name"]: scene for scene in give("scenes", "--json").json["scenes"]}
    assert scenes["plane"]["options"]["depth_mm"] > 0
    assert "color-checker" in give("scenes").out


def test_a_plan_is_written_for_the_rig_and_says_what_it_takes(give: Give, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    said = give(
        "plan", path, *SMALL_RIG, "--code", "columns", "--comb", "20x20x160",
        "--setting", "100@0.2", "--setting", "300@0.8", "--json",
    ).json  # fmt: skip
    plan = load_plan(path)
    assert plan.camera_size_px == (112, 72)
    assert plan.code == GrayCode(rows=False)
    assert plan.spectral == LineComb(width_px=20, step_px=20, period_px=160)
    assert plan.settings == (Setting(exposure_ms=100, level=0.2), Setting(exposure_ms=300, level=0.8))
    assert plan.code_settings == (0, 1)
    assert said["frames"] == plan.shot_count
    assert said["minutes"] == pytest.approx(plan.duration_s(50.0) / 60, abs=1e-3)
    assert said["needed_bytes"] > plan.raw_bytes * 0.5
    assert said["free_bytes"] > 0
    info = give("info", path, "--json").json
    assert (info["kind"], info["frames"]) == ("plan", plan.shot_count)
    assert give("scan", tmp_path / "a.dsl", *SMALL_RIG, "--plan", path).code == 0
    assert ScanReader(tmp_path / "a.dsl").plan == plan


@pytest.mark.parametrize(
    ("name", "code", "frames"),
    [("ensemble-04", EnsembleCode(rows=False), 40), ("full-xor-02", XorCode(base_px=2), 38)],
)
def test_other_codes_are_planned_by_name(
    give: Give, tmp_path: Path, name: str, code: object, frames: int
) -> None:
    gray, other = (
        give(
            "plan", tmp_path / f"{word}.json", *SMALL_RIG, "--code", word, "--comb", "20x20x160", "--json"
        ).json
        for word in ("columns", name)
    )
    plan = load_plan(tmp_path / f"{name}.json")
    assert plan.code == code
    assert plan.code_count == frames
    # At both settings.
    assert other["frames"] - gray["frames"] == 2 * (frames - 20)
    assert other["minutes"] > gray["minutes"]
    refused = give("plan", tmp_path / "no.json", *SMALL_RIG, "--code", "gray")
    assert refused.code == 2
    assert "ensemble-04" in refused.sentence


@pytest.mark.slow
def test_a_scan_says_before_it_starts_what_it_takes(give: Give, tmp_path: Path) -> None:
    said = give("scan", tmp_path / "a.dsl", *SMALL_RIG, *SMALL_PLAN).out.splitlines()
    assert "154 frames, 1.0 min on the rig" in said[0]
    assert "free" in said[0]
    assert f"dsl-scan reconstruct {tmp_path / 'a.dsl'}" in said[-1]


@pytest.mark.parametrize(
    ("words", "metered"),
    [
        ([], True),
        (["--keep-exposure"], False),
        (["--setting", "166.7@0.2"], False),
        (["--setting", "166.7@0.2", "--match-exposure"], True),
    ],
)
def test_a_scan_exposes_for_the_scene_unless_exposures_were_chosen(
    give: Give, tmp_path: Path, words: list[str], metered: bool
) -> None:
    scene = ["--rig", "twin", "-O", "size=32x24", "-O", "scene=plane", "-O", "reflectance=0.002"]
    patterns = ["--code", "columns", "--comb", "80x80x640", "--no-sentinels"]
    ending = give("scan", tmp_path / "a.dsl", *scene, *patterns, *words, "--json")
    assert ending.code == 0
    manifest = ScanReader(tmp_path / "a.dsl").manifest
    longer = manifest.plan.settings[0].exposure_ms / 166.7
    assert longer == pytest.approx(4.0 if metered else 1.0, abs=0.01)
    assert manifest.notes.get("exposures") == ending.json.get("metered")
    assert ("metered" in ending.json) == metered


@pytest.mark.slow
@pytest.mark.parametrize("is_replay", [False, True])
def test_what_plays_a_scan_back_is_not_to_be_calibrated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_replay: bool
) -> None:
    monkeypatch.setattr(CalibrationLibrary, "names", lambda self: [])
    plan, folder = preset_plan("reference"), tmp_path / "a.dsl"
    assert plan is not None
    rig = replay_rig(MemorySink(plan))
    ScanWriter.create(folder, plan, rig if is_replay else None).close()
    advice = next_step(folder)
    assert ("the rig that captured the scan played back" in advice) == is_replay
    assert ("'dsl-scan calibrate all" in advice) != is_replay


def test_commands_to_copy_are_quoted_for_a_shell(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(CalibrationLibrary, "names", lambda self: [])
    assert "Next: dsl-scan scan SCAN.dsl --plan 'my plan.json' and" in give("plan", "my plan.json").out
    scan, plan = Path("my scan.dsl"), PRESETS[0].plan
    ScanWriter.create(scan, plan, notes=rig_notes("lab", {"port": "COM 3"})).close()
    assert "calibrate all CAMPAIGN --rig lab --option 'port=COM 3''" in next_step(scan)
    assert give("scan", scan).sentence.endswith("resume it with: dsl-scan resume 'my scan.dsl'")
    monkeypatch.setattr(pipeline, "scan", stop)
    stopped = give("scan", "new scan.dsl", *SMALL_RIG, *SMALL_PLAN, "--keep-exposure")
    assert stopped.sentence.endswith("Resume with: dsl-scan resume 'new scan.dsl'")


def test_reconstruct_says_what_each_stage_costs(give: Give, finished: Path, tmp_path: Path) -> None:
    target = tmp_path / "depth.zarr"
    ending = give("reconstruct", finished / "scan.dsl", "-o", target, "--depth-only", "--no-refine", "--json")
    said = ending.json
    assert {stage["name"] for stage in said["stages"]} >= {"columns, depth, normals", "save the result"}
    assert all(stage["seconds"] >= 0 and stage["peak_bytes"] > 0 for stage in said["stages"])
    result = load_result(target)
    assert "reflectance" not in result
    assert said["pixels_with_depth"] == pytest.approx(float(np.isfinite(result["depth_mm"]).mean()))
    assert said["pixels_with_depth"] > 0.3
    assert "save the result" in give(
        "reconstruct", finished / "scan.dsl", "-o", target, "--depth-only", "--force"
    ).out  # fmt: skip


def test_frames_are_not_brought_from_a_store_where_the_result_is_taken(
    give: Give, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("obstore", reason="the extra s3 is not installed")
    monkeypatch.setattr(rooms, "own_folder", lambda kind: tmp_path / "cache")
    with running() as store:
        for name, value in store.environment().items():
            monkeypatch.setenv(name, value)
        for file in (each for each in (finished / "scan.dsl").rglob("*") if each.is_file()):
            store.put(f"a.dsl/{file.relative_to(finished / 'scan.dsl').as_posix()}", file.read_bytes())
        ended = give("reconstruct", "s3://bucket/a.dsl", "-o", finished / "scan.zarr")
        assert (ended.code, "already exists" in ended.sentence) == (2, True)
        assert not [name for _, name in store.requests if "/frames/c." in name]
        assert give("reconstruct", "s3://bucket/a.dsl", "-o", tmp_path / "a.zarr", "--depth-only").code == 0


def test_evaluate_finds_the_truth_by_itself(give: Give, finished: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    said = give("evaluate", finished / "scan.zarr", "--report", report, "--json").json
    assert said["figures"]["depth_rmse_mm"] < 2
    assert said["figures"]["spectral_rmse"] < 0.05
    assert 0 < said["deviations"]["depth_rmse_mm"] < said["figures"]["depth_rmse_mm"]
    assert set(said["deviations"]) < set(said["figures"])
    page = report.read_text()
    assert "Dark Skin" in page or "dark skin" in page.lower()
    assert "columns, depth, normals" in page
    # Another scene at another distance must give worse figures, or truth would not be looked at.
    other = give(
        "evaluate", finished / "scan.zarr", "--report", tmp_path / "other.html", "--json",
        "--truth-rig", "twin", *SMALL_RIG, "-O", "scene=plane", "-O", "depth_mm=800",
    ).json  # fmt: skip
    assert other["figures"]["depth_rmse_mm"] > 50


def test_figures_of_the_readme_have_the_names_and_units_that_are_printed(
    give: Give, finished: Path, tmp_path: Path
) -> None:
    readme = ROOT.joinpath("README.md").read_text(encoding="utf-8")
    shown = re.search(r"It ends like this:.*?```\n(.*?)\.\.\.\n", readme, re.DOTALL)
    assert shown is not None
    printed = give("evaluate", finished / "scan.zarr", "--report", tmp_path / "a.html").out.splitlines()
    # Figures differ by plan; what stands before and behind them does not.
    known = {(line[:58], *line[58:].split()[3:]) for line in printed}
    assert {(line[:58], *line[58:].split()[3:]) for line in shown[1].splitlines()} <= known


@pytest.mark.parametrize(
    ("form", "name", "more", "files"),
    [
        ("ply", "a.ply", [], 1),
        ("envi", "a.hdr", [], 4),
        ("exr", "a.exr", [], 1),
        ("png", "a.png", [], 4),
        ("tiff", "a.tiff", [], 3),
        ("npy", "a.npy", [], 3),
        ("csv", "a.csv", ["--pixel", "50,30", "--pixel", "60,40"], 1),
    ],
)
def test_export_of_a_result(
    give: Give, finished: Path, tmp_path: Path, form: str, name: str, more: list[str], files: int
) -> None:
    said = give("export", finished / "scan.zarr", form, tmp_path / name, *more, "--json").json
    assert len(said["files"]) == files
    assert all(Path(file).stat().st_size > 0 for file in said["files"])
    again = give("export", finished / "scan.zarr", form, tmp_path / name, *more)
    assert again.code == 2
    assert "already exists" in again.sentence
    assert give("export", finished / "scan.zarr", form, tmp_path / name, *more, "--force").code == 0


def test_the_surface_of_a_result_as_a_mesh(give: Give, finished: Path, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    for every in (1, 2):
        target = tmp_path / f"{every}.glb"
        said = give("mesh", finished / "scan.zarr", target, "--every", every, "--json").json
        assert said["files"] == [str(target)]
    fine, coarse = (trimesh.load_mesh(tmp_path / f"{every}.glb") for every in (1, 2))
    assert len(fine.faces) > 3 * len(coarse.faces) > 0
    result = load_result(finished / "scan.zarr")
    assert float(-fine.bounds[0, 2] * 1000) == pytest.approx(float(result["depth_mm"].max()), rel=1e-3)
    assert "does not end in" in give("mesh", finished / "scan.zarr", tmp_path / "x.doc").sentence


@pytest.mark.slow
def test_reconstruct_by_another_solver(give: Give, finished: Path, tmp_path: Path) -> None:
    target = tmp_path / "again.zarr"
    options = ("--solver", "colour-basis", "--bands", "450:650:50", "-o", target)
    assert give("reconstruct", finished / "scan.dsl", *options).code == 0
    result = load_result(target)
    assert result["wavelength_nm"].values.tolist() == [450, 500, 550, 600, 650]
    assert bool(result["reflectance_std"].isnull().all())


def test_what_the_calibration_lacks_is_said_before_a_frame_is_read(
    give: Give, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(ScanReader, "read")
    ending = give("reconstruct", finished / "scan.dsl", "--model", "grid", "-o", tmp_path / "a.zarr")
    assert ending.code == 2
    assert "has no data-driven correspondence" in ending.sentence


@pytest.mark.slow
def test_a_scan_goes_out_and_comes_back_in_the_published_layout(
    give: Give, finished: Path, tmp_path: Path
) -> None:
    scan, dataset, rig = finished / "scan.dsl", tmp_path / "dataset", tmp_path / "rig"
    assert give("export", scan, "dataset", dataset).code == 0
    assert give("export", scan, "calibration", rig).code == 0
    checked = give("import", dataset, "--json").json
    assert checked["kind"] == "dataset"
    assert not (tmp_path / "again.dsl").exists()
    assert give("import", dataset, "-o", tmp_path / "again.dsl").code == 2  # the published rig's size
    own = tmp_path / "own.json"
    own.write_text(ScanReader(scan).calibration.model_dump_json())  # type: ignore[union-attr]
    assert give("import", dataset, "-o", tmp_path / "back.dsl", "--calibration", own).code == 0
    before, after = ScanReader(scan), ScanReader(tmp_path / "back.dsl")
    for shot in after.plan.shots():
        np.testing.assert_array_equal(after.read(shot), before.read(shot))
    assert give("import", rig, "-o", tmp_path / "rig.json", "--camera-size", "112x72").code == 0
    info = give("info", tmp_path / "rig.json", "--json").json
    assert (info["kind"], info["camera_px"]) == ("rig", [112, 72])


def test_info_of_a_scan_and_a_result(give: Give, finished: Path) -> None:
    scan = give("info", finished / "scan.dsl", "--verify", "--json").json
    assert (scan["kind"], scan["complete"], scan["frames_stored"]) == ("scan", True, 154)
    assert scan["notes"]["scanned_with"] == "twin"
    assert (scan["problems"], scan["moved"], scan["wrong_pictures"]) == ([], [], [])
    assert scan["values"].startswith("linear in light")
    result = give("info", finished / "scan.zarr", "--json").json
    assert (result["kind"], result["size_px"]) == ("result", [112, 72])
    assert result["bands"] == "24 from 430 to 660 nm"
    assert "frames stored      154" in give("info", finished / "scan.dsl").out
    told = give("info", finished / "scan.zarr").out
    assert max(map(len, told.splitlines())) < 2000, "long attributes are left to --json"
    assert result["attributes"]["fit"].startswith("{")
    assert f"verdict            {result['verdict']}" in told
    assert f"to {result['depth_mm'][2]}, median {result['depth_mm'][1]}" in told


def test_info_ends_as_for_wrong_input_where_a_verified_scan_is_damaged(give: Give, scan_copy: Path) -> None:
    frames = (file for file in scan_copy.rglob("*") if file.is_file() and "frames" in file.parts)
    max(frames, key=lambda file: file.stat().st_size).unlink()
    assert give("info", scan_copy).code == 0, "it says what there is, and judges nothing"
    found = give("info", scan_copy, "--verify", "--json")
    assert found.code == 2
    assert found.json["problems"]


def test_a_plan_is_a_preset_by_name_or_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    quick = preset_plan("quick")
    assert quick is not None
    assert PlanChoice("quick").build() == quick
    assert not PlanChoice("quick").is_written, "it is fitted to the rig"
    save_plan(quick.model_copy(update={"name": "mine"}), tmp_path / "quick")
    assert PlanChoice("quick").build().name == "mine", "a file wins"
    assert PlanChoice("quick").is_written
    with pytest.raises(PlanError, match=r"no plan 'quik'; give a file .* or one of preview, comb, quick"):
        PlanChoice("quik").build()
    with pytest.raises(PlanError, match="--plan gives the whole plan; leave out --code"):
        PlanChoice("comb", code="columns").build()
    (option,) = get_args(PlanSource)[1:]
    assert all(preset.key in option.help for preset in PRESETS)


def test_a_plan_bears_the_name_of_a_preset_only_while_it_is_that_one() -> None:
    assert [PlanChoice().build().name, PlanChoice(sentinels=True).build().name] == ["reference"] * 2
    for changed in (PlanChoice(lines="5x5"), PlanChoice(code="columns"), PlanChoice(sentinels=False)):
        assert changed.build().name == "custom plan"


@pytest.mark.slow
def test_the_demo_leaves_a_report_and_never_writes_over_another(
    give: Give, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = PlanChoice(code="columns", lines="5x5", settings=["333.3@0.8"]).build()
    monkeypatch.setattr("dsl_core.cli.demo._plan", lambda: short)
    out = tmp_path / "demo"
    out.mkdir()
    said = give("demo", "--out", out, "--size", "112x72", "--json").json
    folder = Path(said["folder"])
    assert folder == tmp_path / "demo-2"
    assert said["figures"]["depth_rmse_mm"] < 5
    assert list(out.iterdir()) == []
    names = {path.name for path in folder.iterdir()}
    assert names >= {"scan.dsl", "result.zarr", "points.ply", "cube.hdr", "picture_rgb.png", "report.html"}
    page = (folder / "report.html").read_text()
    assert "0.038" in page
    assert "0.138" in page
