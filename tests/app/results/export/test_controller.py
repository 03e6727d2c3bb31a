"""Exporting a result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.layers import Layers, rgb_of
from dsl_app.results.state import ResultView

from dsl_core.io.export import formats
from dsl_core.io.result.result_file import load_result, save_result
from tests.app.support.results_controller import Bench, exports
from tests.app.support.results_controller import bench as bench
from tests.app.support.small_result import write_small_result


@pytest.mark.slow
def test_export_says_what_it_wrote_and_replaces_nothing_unasked(bench: Bench, tmp_path: Path) -> None:
    bench.control.marks.pin((3, 3))
    targets = {
        "ply": tmp_path / "a.ply",
        "csv": tmp_path / "a.csv",
        "envi": tmp_path / "a.hdr",
        "tiff": tmp_path / "a.tiff",
        "obj": tmp_path / "a.obj",
    }
    assert exports(bench.control).taken(targets) == []
    exports(bench.control).write(targets, overwrite=False)
    assert "Wrote 12 files" in bench.told
    assert len(exports(bench.control).taken(targets)) == 12
    exports(bench.control).write(targets, overwrite=False)
    assert "already exists" in bench.told
    exports(bench.control).write(targets, overwrite=True)
    assert "Wrote 12 files" in bench.told


def test_pictures_are_exported_as_they_are_shown(bench: Bench, tmp_path: Path) -> None:
    import cv2

    bench.control.step_band(-3)
    bench.control.relight("A", adapted=False)
    bench.state.view.set(ResultView.QUALITY)
    exports(bench.control).write({"png": tmp_path / "a.png"}, overwrite=False)
    files = {path.name: np.asarray(cv2.imread(str(path)))[..., ::-1] for path in tmp_path.glob("a_*.png")}
    assert set(files) == {"a_rgb_A_unadapted.png", "a_depth.png", "a_530nm.png", "a_flags.png"}
    result, picture = bench.state.result.value, bench.state.picture.value
    assert result is not None
    assert picture is not None
    lit = picture[..., 3] > 0
    np.testing.assert_array_equal(files["a_rgb_A_unadapted.png"][lit], picture[lit, :3])
    layer = Layers(result).layer(bench.state)
    assert layer is not None
    flagged = result["flags"] != 0
    assert flagged.sum() == 2
    np.testing.assert_array_equal(files["a_flags.png"][:24, :36][flagged], rgb_of(layer)[flagged])


@pytest.mark.parametrize("name", ["cup", "cup[1]"])
def test_only_pictures_that_would_be_written_are_in_the_way(tmp_path: Path, name: str) -> None:
    saved = write_small_result(tmp_path)
    bench = Bench(saved)
    targets = {"png": tmp_path / f"{name}.png"}
    for other in ("photo", "2_depth", "rgb_A"):
        (tmp_path / f"{name}_{other}.png").touch()
    assert exports(bench.control).taken(targets) == []
    bench.state.bands.set((0, 1, 2))
    exports(bench.control).write(targets, overwrite=False)
    written = {path.name for path in exports(bench.control).taken(targets)}
    parts = ("rgb", "depth", "545nm", "430_435_440nm", "flags")
    assert written == {f"{name}_{part}.png" for part in parts}
    bench.control.relight("A", adapted=True)
    assert f"{name}_rgb_A.png" in {path.name for path in exports(bench.control).taken(targets)}


def test_files_of_what_a_result_lacks_are_not_in_the_way(tmp_path: Path) -> None:
    whole = load_result(write_small_result(tmp_path), lazy=False)
    lacking = whole.drop_vars(["depth_std_mm", "flags", "reflectance_std"])
    bench = Bench(save_result(lacking, tmp_path / "lacking.zarr"))
    targets = {form: tmp_path / f"a.{suffix}" for form, suffix in (("tiff", "tiff"), ("envi", "hdr"))}
    for name in ("a_std.tiff", "a_flags.tiff", "a_std.hdr", "a_std.img"):
        (tmp_path / name).touch()
    assert exports(bench.control).taken(targets) == []


@pytest.mark.parametrize(
    ("name", "forms", "replace", "trouble"),
    [
        ("new", (), False, "Select at least one format."),
        ("", ("ply",), False, "Enter a name for the files."),
        ("new", ("ply",), False, ""),
        ("old", ("ply", "png"), False, "old.ply already exists. Choose another name, or allow replacing."),
        ("old", ("ply",), True, ""),
        ("old", ("ply", "envi"), False, "old.ply, old.hdr already exist. Choose another"),
    ],
)
def test_what_stands_in_the_way_of_an_export_is_said(
    bench: Bench, tmp_path: Path, name: str, forms: tuple[str, ...], replace: bool, trouble: str
) -> None:
    for suffix in ("ply", "hdr"):
        (tmp_path / f"old.{suffix}").touch()
    targets = {
        form.key: tmp_path / f"{name}{form.suffix}" for form in formats().values() if form.key in forms
    }
    found = exports(bench.control).trouble(str(tmp_path), name, targets, replace)
    assert found.startswith(trouble)
    assert bool(found) == bool(trouble)
    nowhere = str(tmp_path / "nowhere")
    assert "not a folder" in exports(bench.control).trouble(nowhere, "a", {"ply": tmp_path}, True)


@pytest.mark.parametrize(
    ("spectra", "pinned", "refused"),
    [
        (True, True, {}),
        (True, False, {"csv": "Pin a pixel first"}),
        (False, False, {"csv": "Pin a pixel first", **dict.fromkeys(("envi", "exr"), "depth only")}),
    ],
)
def test_formats_that_lack_spectra_or_pins_are_refused(
    tmp_path: Path, spectra: bool, pinned: bool, refused: dict[str, str]
) -> None:
    bench = Bench(write_small_result(tmp_path, spectra=spectra))
    if pinned:
        bench.control.marks.pin((3, 3))
    for form in formats().values():
        refusal = exports(bench.control).refusal(form)
        assert refused.get(form.key, "") in refusal
        assert bool(refusal) == (form.key in refused)
