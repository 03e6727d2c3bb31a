"""A picture that is reconstructed by rows is that which is reconstructed as a whole, to the bit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.io.atomic import write_atomic
from dsl_core.io.result import row_writer
from dsl_core.io.result.result_file import load_result
from dsl_core.model.fit import Fit
from dsl_core.model.frames import read_rows
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Shot
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.reconstruction.rows.bands import BESIDE, bands_of
from dsl_core.reconstruction.spectral import spectra
from tests.cases.twin_scan import MemoryScan, twin_scan

GRID = WavelengthGrid(step_nm=10.0)


class Counting:
    """A `FrameSource` and `RowSource` that counts what was read as a whole and by rows."""

    def __init__(self, scan: MemoryScan) -> None:
        self._scan, self.plan, self.whole, self.by_rows = scan, scan.plan, 0, 0

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        self.whole += 1
        return self._scan.read(shot)

    def read_rows(self, shot: Shot, rows: slice) -> NDArray[np.uint16]:
        self.by_rows += 1
        return self._scan.read(shot)[rows]


@pytest.fixture(scope="module")
def scanned() -> tuple[Rig, MemoryScan]:
    """A plane of patches in light that rises by 30 % and differs between settings."""
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=9, step_px=8))
    devices, scan = twin_scan(plan, size="64x48", scene="color-checker")
    assert devices.calibration is not None
    gains = np.linspace(1.0, 1.3, len(scan.frames))
    black = devices.calibration.sensor.black_level_dn
    frames = (
        np.rint(black + (frame - black) * gain).astype(np.uint16)
        for frame, gain in zip(scan.frames, gains, strict=True)
    )
    return devices.calibration, replace(scan, frames=tuple(frames))


@pytest.fixture(scope="module")
def whole(scanned: tuple[Rig, MemoryScan]) -> Iterator[xr.Dataset]:
    """All of the picture at once, in tiles that are low enough for bands of 16 rows."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(spectra, "TILE", (16, 96))
        yield pipeline.reconstruct(scanned[1], scanned[0], pipeline.Options(grid=GRID))


@pytest.mark.slow
def test_rows_one_after_the_other_give_the_result_of_the_whole(
    scanned: tuple[Rig, MemoryScan], whole: xr.Dataset
) -> None:
    rig, scan = scanned
    source = Counting(scan)
    banded = pipeline.reconstruct(source, rig, pipeline.Options(grid=GRID, band_rows=16))
    xr.testing.assert_identical(whole, banded)
    fit = Fit.read({str(name): value for name, value in whole.attrs.items()})
    assert fit is not None
    assert any(each.name == "drift of the light" and each.significant for each in fit.findings)
    assert source.by_rows > 2 * scan.plan.shot_count
    assert np.isfinite(whole["reflectance"].values[0]).mean() > 0.5


@pytest.mark.slow
def test_a_part_of_the_picture_is_that_part_of_the_whole(
    scanned: tuple[Rig, MemoryScan], whole: xr.Dataset
) -> None:
    rig, scan = scanned
    part = pipeline.Options(grid=GRID, band_rows=16, region_px=(20, 10, 30, 15))
    found = pipeline.reconstruct(scan, rig, part)
    xr.testing.assert_equal(found, whole.isel(y=slice(10, 25), x=slice(20, 50)))


@pytest.mark.slow
def test_a_reconstruction_that_was_killed_goes_on_and_ends_the_same(
    scanned: tuple[Rig, MemoryScan], whole: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig, scan = scanned
    options = pipeline.Options(grid=GRID, band_rows=16)
    notes, solved = list[str](), list[slice]()
    write, solve = write_atomic, spectra.SpectralReconstruction.solve

    def killed(path: Path, data: bytes) -> None:
        notes.append(path.name)
        if len(notes) == 3:
            raise KeyboardInterrupt  # after the rows were written, and before that was noted
        write(path, data)

    def solving(solver: spectra.SpectralReconstruction, rows: slice, *given: Any, **more: Any) -> Any:
        solved.append(rows)
        return solve(solver, rows, *given, **more)

    def reconstructed(name: str) -> xr.Dataset:
        with row_writer.RowWriter(tmp_path / name, "all that it depends on") as writer:
            found = pipeline.reconstruct(scan, rig, options, sink=writer)
            return load_result(writer.publish(found.attrs), lazy=False)

    with monkeypatch.context() as patch:
        patch.setattr(row_writer, "write_atomic", killed)
        with pytest.raises(KeyboardInterrupt):
            reconstructed("killed.zarr")
    assert notes == ["key.json", "rows.32.48.json", "rows.16.32.json"]
    monkeypatch.setattr(spectra.SpectralReconstruction, "solve", solving)
    gone_on = reconstructed("killed.zarr")
    assert solved == [slice(16, 32), slice(0, 16)]
    xr.testing.assert_identical(gone_on, reconstructed("at once.zarr"))
    xr.testing.assert_allclose(gone_on, whole, atol=2.1e-3, rtol=0)
    assert gone_on.attrs["fit"] == whole.attrs["fit"]


def test_bands_cover_the_picture_once_and_begin_at_multiples() -> None:
    plan = CapturePlan(camera_size_px=(2048, 1536), spectral=ScanLines())
    bands = bands_of(plan, multiple=64)
    rows = np.concatenate([np.arange(band.rows.start, band.rows.stop) for band in bands])
    assert rows.tolist() == list(range(1536))
    assert all(band.rows.start % 64 == 0 for band in bands)
    assert max(band.near.stop - band.near.start for band in bands) == 64 + 2 * BESIDE
    assert bands[1].own == slice(BESIDE, BESIDE + bands[1].rows.stop - bands[1].rows.start)
    assert len(bands_of(plan, multiple=None)) == 1
    assert len(bands_of(plan.model_copy(update={"camera_size_px": (112, 72)}), multiple=64)) == 1


def test_rows_of_any_source_can_be_read(scanned: tuple[Rig, MemoryScan]) -> None:
    scan = scanned[1]
    shot = next(iter(scan.plan.shots()))
    np.testing.assert_array_equal(read_rows(scan, shot, slice(3, 9)), scan.frames[0][3:9])
