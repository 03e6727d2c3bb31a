from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.devices.registry import open_rig
from dsl_core.errors import CalibrationError, DecodeError, StoreError
from dsl_core.io.calibration_library import CalibrationLibrary
from dsl_core.io.result.result_arrays import ResultArrays, load_arrays
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.io.scan.folder import ScanReader
from dsl_core.io.scan.origin import model_notes, rig_notes
from dsl_core.model.plan import CapturePlan, GrayCode, Setting
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.resources import HOME_VARIABLE
from dsl_core.workflows.inspection import find_scan, intensity_graph, read_block
from dsl_core.workflows.scans import reconstruct_scan


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> ResultArrays:
    folder, options = tmp_path_factory.mktemp("inspection"), {"size": "160x104", "scene": "plane"}
    with open_rig("twin", options) as rig:
        plan = pipeline.fit_plan(
            CapturePlan(
                code=GrayCode(rows=False),
                settings=(Setting(exposure_ms=333.3, level=0.8),),
                code_settings=(0,),
            ),
            rig,
        )
        pipeline.scan(rig, plan, folder / "a.dsl", None, rig_notes("twin", options))
    made = reconstruct_scan(folder / "a.dsl", options=pipeline.Options(WavelengthGrid(step_nm=10)))
    return load_arrays(save_result(made, folder / "other-name.zarr"))


def test_the_model_explains_what_a_pixel_saw(result: ResultArrays) -> None:
    solid = np.argwhere(np.isfinite(result["reflectance"][0]) & np.isfinite(result["shading"]))
    y, x = solid[len(solid) // 2].tolist()
    pixel = (x, y)
    block = read_block(result, pixel)
    graph = intensity_graph(block, result, pixel)
    assert graph.model is not None
    assert graph.zero is not None
    assert graph.measured.shape == graph.model.shape == graph.std.shape
    peak = int(graph.measured.sum(0).argmax())
    assert abs(peak - graph.zero) < 3
    # Beside the zero order, whose steep flanks the large pixels of a small picture smear.
    beside = np.abs(np.arange(graph.model.shape[1]) - graph.zero) > 20
    assert np.corrcoef(graph.measured[:, beside].ravel(), graph.model[:, beside].ravel())[0, 1] > 0.97
    reached = [frames[np.isfinite(frames)] for frames in graph.orders.values()]
    assert any(frames.size for frames in reached)
    far = np.concatenate(reached)
    assert (np.abs(far - graph.zero) > 20).all()


def test_a_pixel_at_the_corner_has_a_graph_too(result: ResultArrays) -> None:
    block = read_block(result, (0, 0))
    assert block.holds((0, 0))
    assert not block.holds((90, 60))
    assert intensity_graph(block, result, (0, 0)).measured.shape[0] == 3
    with pytest.raises(DecodeError, match="outside"):
        intensity_graph(block, result, (90, 60))


def test_a_monochrome_camera_has_one_curve(result: ResultArrays) -> None:
    y, x = np.argwhere(np.isfinite(result["reflectance"][0]) & np.isfinite(result["shading"]))[0].tolist()
    block = read_block(result, (x, y))
    sensor = block.rig.sensor.model_copy(update={"bayer": "MONO"})
    mono = replace(block, rig=block.rig.model_copy(update={"sensor": sensor}))
    graph = intensity_graph(mono, result, (x, y))
    assert graph.model is not None
    assert graph.measured.shape == graph.std.shape == graph.model.shape == (1, block.plan.spectral_count)


def test_a_scan_that_is_elsewhere_is_asked_for(result: ResultArrays, tmp_path: Path) -> None:
    moved = ResultArrays(tmp_path / "b.zarr", result.wavelengths_nm, result.arrays, result.attributes)
    with pytest.raises(StoreError, match="Put it there"):
        find_scan(moved)


def test_the_model_is_that_of_the_calibration_of_the_result(
    result: ResultArrays, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(HOME_VARIABLE, str(tmp_path))
    own = ScanReader(find_scan(result)).calibration
    assert own is not None
    other = own.model_copy(update={"white_scale": own.white_scale * 1.5})
    attributes = {**result.attributes, **model_notes(other, "grating")}
    made = ResultArrays(result.path, result.wavelengths_nm, result.arrays, attributes)
    with pytest.raises(CalibrationError, match="a calibration other than"):
        read_block(made, (80, 52))
    CalibrationLibrary().store("bench", other.model_copy(update={"name": "renamed"}))
    assert read_block(made, (80, 52)).rig.white_scale == other.white_scale
    assert read_block(result, (80, 52)).rig == own


def test_the_model_is_that_of_the_correspondence_of_the_result(result: ResultArrays) -> None:
    y, x = np.argwhere(np.isfinite(result["reflectance"][0])).tolist()[0]
    block = read_block(result, (x, y))
    assert intensity_graph(block, result, (x, y)).zero is not None
    attributes = {**result.attributes, "correspondence": "grid"}
    by_grid = ResultArrays(result.path, result.wavelengths_nm, result.arrays, attributes)
    with pytest.raises(CalibrationError, match="data-driven"):
        intensity_graph(block, by_grid, (x, y))


def test_a_part_of_the_picture_reads_the_frames_of_its_own_pixels(result: ResultArrays) -> None:
    solid = np.argwhere(np.isfinite(result["reflectance"][0]) & np.isfinite(result["shading"]))
    y, x = next((y, x) for y, x in solid.tolist() if y > 40 and x > 70)
    whole = intensity_graph(read_block(result, (x, y)), result, (x, y))
    left, top = x - 11, y - 7
    cut = load_result(result.path).isel(x=slice(left, left + 30), y=slice(top, top + 20))
    part = load_arrays(save_result(cut, result.path.parent / "part.zarr"))
    own = intensity_graph(read_block(part, (11, 7)), part, (11, 7))
    assert own.pixel == whole.pixel == (x, y)
    np.testing.assert_array_equal(own.measured, whole.measured)
    assert own.model is not None
    assert whole.model is not None
    np.testing.assert_allclose(own.model, whole.model, rtol=1e-6)
