"""How accurate a scan of the full-effects twin is, on windows of 64 x 48 pixels at full magnification."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from dsl_core import pipeline
from dsl_core.evaluation.summary import Evaluation, Truth
from dsl_core.evaluation.uncertainty import check_honesty
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Setting, Shot
from dsl_core.model.result import DEPTH_INVALID, Flag, Reach
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.spectral import spectra
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from dsl_core.solve.threads import one_kernel_thread
from dsl_core.workflows import truths
from tests.cases.crop import cropped_twin
from tests.cases.twin_scan import MemoryScan, capture, solver_input, twin_scan

GRID = WavelengthGrid()
COLUMNS_ONLY = CapturePlan(code=GrayCode(rows=False))
#: Corners of windows (px) of the full image: two patches of the chart, a filter, beyond the first orders.
CHART, FILTER, GAP = (282, 200), (412, 110), (440, 0)


@dataclass(frozen=True)
class Scanned:
    """A scan with its rig and the truth of its scene."""

    rig: Rig
    frames: MemoryScan
    truth: Truth

    def reconstruct(self, grid: WavelengthGrid = GRID) -> xr.Dataset:
        """The result of the pipeline."""
        return pipeline.reconstruct(self.frames, self.rig, pipeline.Options(grid=grid))


def scan(
    scene: str, corner_px: tuple[int, int], plan: CapturePlan, size_px: tuple[int, int] = (64, 48)
) -> Scanned:
    devices = cropped_twin(scene, corner_px, size_px)
    with one_kernel_thread():
        frames = capture(devices, plan)
    truth = truths.twin_truth(devices, GRID)
    assert truth is not None
    assert devices.calibration is not None
    return Scanned(devices.calibration, frames, truth)


@pytest.fixture(scope="module")
def chart() -> Scanned:
    return scan("color-checker", CHART, COLUMNS_ONLY)


@pytest.fixture(scope="module")
def chart_result(chart: Scanned) -> xr.Dataset:
    return chart.reconstruct()


@pytest.fixture(scope="module")
def maps(chart: Scanned) -> SpectralMaps:
    return solve(chart, threads=1)


def solve(scanned: Scanned, threads: int) -> SpectralMaps:
    stack, pixels = solver_input(scanned.rig, scanned.frames)
    model = correspondence(scanned.rig)
    solver = SpectralReconstruction(
        scanned.rig, scanned.frames.plan, GRID, model, stack.radiance, stack.std, pixels
    )
    return solver.run(threads=threads)


def patch_rmse(evaluation: Evaluation) -> dict[str, float]:
    return {patch.name: patch.rmse for patch in evaluation.patches}


def require_chart(evaluation: Evaluation, limit: float) -> None:
    rmse = patch_rmse(evaluation)
    assert set(rmse) == {"purplish blue", "moderate red"}
    assert max(rmse.values()) <= limit, rmse


def require_depth(evaluation: Evaluation) -> None:
    assert evaluation.depth is not None
    assert evaluation.depth.rmse_mm < 0.3
    assert evaluation.depth.coverage > 0.98


def test_patches_of_the_chart_have_their_spectra(chart: Scanned, chart_result: xr.Dataset) -> None:
    require_chart(pipeline.evaluate(chart_result, chart.truth), 0.01)


def test_depth_with_the_22_frames_of_the_columns(chart: Scanned, chart_result: xr.Dataset) -> None:
    assert chart.frames.plan.code_count + 2 == 22
    evaluation = pipeline.evaluate(chart_result, chart.truth)
    require_depth(evaluation)


def test_stated_depth_deviation_covers_the_truth(chart: Scanned) -> None:
    # The twin's calibration is the true one, so that noise is all there is.
    rig = chart.rig.model_copy(update={"column_std_px": 0.0})
    result = pipeline.reconstruct(chart.frames, rig, pipeline.Options(spectra=False))
    found = pipeline.evaluate(result, chart.truth).depth_calibration
    assert found is not None
    assert 0.90 <= found.coverage_95 <= 0.999


def test_stated_spectral_deviation_covers_the_truth(chart: Scanned, chart_result: xr.Dataset) -> None:
    found = pipeline.evaluate(chart_result, chart.truth).spectral_calibration
    assert found is not None
    assert 0.90 <= found.coverage_95 <= 0.999


def test_noise_model_explains_what_the_spectra_leave(maps: SpectralMaps) -> None:
    solved = np.isfinite(maps.reflectance).all(0)
    assert 0.8 <= float(np.median(maps.chi_square[solved])) <= 1.3


@pytest.mark.slow
def test_half_as_many_bands(chart: Scanned) -> None:
    grid = WavelengthGrid(step_nm=10.0)
    devices = cropped_twin("color-checker", CHART)
    truth = truths.twin_truth(devices, grid)
    assert truth is not None
    result = chart.reconstruct(grid)
    assert result.sizes["wavelength_nm"] == 24
    require_chart(pipeline.evaluate(result, truth), 0.01)


@pytest.mark.slow
def test_filter_keeps_its_width() -> None:
    scanned = scan("filters", FILTER, COLUMNS_ONLY)
    (patch,) = pipeline.evaluate(scanned.reconstruct(), scanned.truth).patches
    assert patch.peak is not None
    assert 8.0 <= patch.peak.fwhm_nm <= 12.0
    assert abs(patch.peak.centre_nm - 475.0) < 1.0


@pytest.mark.slow
def test_comb_of_53_frames_through_the_dense_solver() -> None:
    plan = CapturePlan(spectral=LineComb(width_px=5, step_px=2, period_px=106))
    assert plan.spectral_count == 53
    scanned = scan("color-checker", (290, 200), plan, size_px=(48, 16))
    evaluation = pipeline.evaluate(scanned.reconstruct(), scanned.truth)
    # A comb mixes distant bands, which leaves more noise at the ends of the spectrum than single lines do.
    require_chart(evaluation, 0.05)
    require_depth(evaluation)


@pytest.mark.slow
@pytest.mark.parametrize("step_px", [1, 4])
def test_lines_of_another_step(step_px: int) -> None:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=step_px))
    scanned = scan("color-checker", CHART, plan)
    require_chart(pipeline.evaluate(scanned.reconstruct(), scanned.truth), 0.01)


@pytest.mark.slow
@pytest.mark.parametrize("step_px", [1, 4])
def test_bright_frames_of_a_coarse_camera_are_solved(step_px: int) -> None:
    """The data weigh so much more than the prior that any indefinite part of their matrix would show."""
    plan = CapturePlan(
        code=GrayCode(rows=False),
        spectral=ScanLines(step_px=step_px),
        settings=(Setting(exposure_ms=1000.0 / 3.0, level=0.8),),
        code_settings=(0,),
    )
    with one_kernel_thread():
        devices, frames = twin_scan(plan, scene="color-checker", size="48x32")
    assert devices.calibration is not None
    result = pipeline.reconstruct(frames, devices.calibration)
    assert np.isfinite(result["reflectance"].values).all(0).mean() > 0.4


@pytest.mark.slow
def test_pixels_of_the_order_gap_keep_a_spectrum() -> None:
    scanned = scan("leaves", GAP, COLUMNS_ONLY)
    result = scanned.reconstruct()
    valid = (result["flags"].values & int(DEPTH_INVALID)) == 0
    unlit = result["reach"].values == int(Reach.ZERO_ONLY)
    gap = valid & unlit.all(0)
    # Samples of neighbours belong to a pixel as well: its bands count as unlit where they do for all of them.
    some = valid & minimum_filter(unlit, (1, 3, 3)).any(0) & ~gap
    assert min(gap.sum(), some.sum()) > 300
    assert np.isfinite(result["reflectance"].values[:, valid]).all()
    unreached = (result["flags"].values & int(Flag.BANDS_UNREACHED)) != 0
    assert unreached[gap].all()
    # A band just outside the frame may still be measured by the outermost lines.
    assert unreached[some].mean() > 0.95
    assert scanned.truth.material is not None
    assert scanned.truth.spectra is not None
    truth = scanned.truth.spectra[scanned.truth.material[gap]].T
    values, std = (result[name].values[:, gap] for name in ("reflectance", "reflectance_std"))
    # Colour and prior are all there is; on a grey board that is enough, but it is told that it might not be.
    assert float(np.sqrt(np.mean((values - truth) ** 2))) < 0.1
    assert check_honesty(values, truth, std).coverage_95 >= 0.9
    assert std.mean() > 0.1


@pytest.mark.slow
def test_threads_do_not_change_the_spectra(chart: Scanned, maps: SpectralMaps) -> None:
    again = solve(chart, threads=2)
    for name, one in vars(maps).items():
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, getattr(again, name), err_msg=name)


@pytest.mark.slow
def test_tiles_do_not_change_the_spectra(
    chart: Scanned, maps: SpectralMaps, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spectra, "TILE", (20, 34))
    small = solve(chart, threads=1)
    np.testing.assert_array_equal(np.isnan(small.reflectance), np.isnan(maps.reflectance))
    with np.errstate(invalid="ignore"):
        change = np.abs(small.reflectance - maps.reflectance) / maps.std
    # Line profiles are shared by a tile, so that spectra change by less than they are known.
    assert float(np.nanquantile(change, 0.99)) < 0.2


@dataclass(frozen=True)
class Island:
    """Frames that are black outside one square of pixels."""

    whole: FrameSource
    square: tuple[slice, slice]

    @property
    def plan(self) -> CapturePlan:
        return self.whole.plan

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        pixels = self.whole.read(self._black(shot.setting)).copy()
        pixels[self.square] = self.whole.read(shot)[self.square]
        return pixels

    def _black(self, setting: int) -> Shot:
        return next(s for s in self.plan.shots() if s.role == "black" and s.setting == setting)


@pytest.mark.slow
@pytest.mark.parametrize("size_px", [2, 20])
def test_nothing_is_missing_without_a_reason(chart: Scanned, size_px: int) -> None:
    square = slice(20, 20 + size_px), slice(4, 4 + size_px)
    result = pipeline.reconstruct(Island(chart.frames, square), chart.rig)
    flags = result["flags"].values
    lit = np.zeros(flags.shape, bool)
    lit[square] = True
    assert (flags[~lit] & int(Flag.NO_LIGHT)).all()
    for name in ("depth_mm", "depth_std_mm", "column_px", "reflectance", "reflectance_std", "rgb"):
        values = result[name].values.reshape(-1, *flags.shape)
        missing = ~np.isfinite(values).all(0)
        assert (flags[missing] != 0).all(), name
        assert np.isnan(values[:, missing & ~lit]).all(), name
    assert np.isfinite(result["depth_mm"].values[lit]).all()
