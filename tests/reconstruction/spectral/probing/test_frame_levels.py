"""Levels of line frames are found from pixels, whose spectra cannot take them up."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.spectral.probing.frame_levels import frame_levels
from dsl_core.reconstruction.spectral.probing.probed_light import ProbedScan
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from tests.cases.twin_scan import solver_input, twin_scan

GRID = WavelengthGrid(step_nm=10.0)


def scanned(spectral: ScanLines | LineComb) -> ProbedScan:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=spectral)
    devices, scan = twin_scan(plan, size="64x48", scene="color-checker")
    assert devices.calibration is not None
    stack, pixels = solver_input(devices.calibration, scan)
    data = (devices.calibration, scan.plan, GRID, correspondence(devices.calibration))
    return SpectralReconstruction(*data, stack.radiance, stack.std, pixels).probed


@pytest.fixture(scope="module")
def steady() -> ProbedScan:
    return scanned(ScanLines(width_px=5, step_px=4))


@pytest.mark.slow
def test_frames_that_flicker_are_told_from_steady_ones(steady: ProbedScan) -> None:
    radiance = np.asarray(steady.radiance)
    true = 0.03 * np.random.default_rng(3).standard_normal(len(radiance))
    factor = np.exp(true).astype(np.float32)[:, None, None]
    shaken = ProbedScan(
        steady.model, steady.pixels, radiance * factor, np.asarray(steady.std) * factor, steady.prior
    )
    std = np.full(len(true), 0.03)
    before, found = frame_levels(steady, std), frame_levels(shaken, std)
    assert before is not None
    assert found is not None
    lit = found.std < 0.015
    assert lit.mean() > 0.7
    error = (found.log - before.log - true)[lit]
    assert error.std() < 0.2 * true[lit].std()
    assert np.mean(np.abs(before.log[lit]) < 3 * np.maximum(before.std[lit], 0.004)) > 0.9


def test_nothing_is_learned_of_a_frame_beyond_what_was_known(steady: ProbedScan) -> None:
    known = frame_levels(steady, np.full(len(steady.radiance), 1e-6))
    assert known is not None
    assert known.std.max() <= 0.0041
    assert np.abs(known.log).max() < 0.02


@pytest.mark.slow
def test_several_lines_at_once_tell_nothing() -> None:
    comb = scanned(LineComb(width_px=5, step_px=4, period_px=160))
    assert frame_levels(comb, np.full(len(comb.radiance), 0.03)) is None
