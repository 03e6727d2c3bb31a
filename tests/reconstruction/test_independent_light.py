"""Depth, spectra and their bands on a scan that was rendered without the program's own optics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.evaluation.uncertainty import check_honesty
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from tests.cases.independent_light import NM, SPECTRA, Rendered, render, rig

if TYPE_CHECKING:
    import xarray as xr


@pytest.fixture(scope="module")
def scanned() -> tuple[Rendered, xr.Dataset]:
    known = rig(64, 42)
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))
    rendered = render(known, plan)
    return rendered, pipeline.reconstruct(rendered.scan, known)


def test_depth_is_right_and_its_band_holds_it(scanned: tuple[Rendered, xr.Dataset]) -> None:
    rendered, result = scanned
    depth = result["depth_mm"].values
    error = depth - rendered.depth_mm
    assert np.isfinite(error).mean() > 0.99
    assert abs(float(np.nanmedian(error))) < 0.01
    assert float(np.sqrt(np.nanmean(error**2))) < 0.16
    honest = check_honesty(depth, rendered.depth_mm, result["depth_std_mm"].values)
    assert 0.93 < honest.coverage_95 < 0.99
    said = Fit.read(result.attrs)
    assert said is not None
    assert said.significant == ()


def test_spectra_are_right_and_their_band_holds_them(scanned: tuple[Rendered, xr.Dataset]) -> None:
    rendered, result = scanned
    nm = result["wavelength_nm"].values
    hats = np.clip(1 - np.abs(NM - nm[:, None]) / (nm[1] - nm[0]), 0, None)
    truth = (SPECTRA @ (hats / hats.sum(1, keepdims=True)).T)[rendered.material].transpose(2, 0, 1)
    value, std, share = (result[name].values for name in ("reflectance", "reflectance_std", "data_share"))
    decided = share > 0.5
    assert decided.mean() > 0.6
    assert float(np.sqrt(np.mean((value - truth)[decided] ** 2))) < 0.03
    honest = check_honesty(value, truth, std, decided)
    assert honest.coverage_95 > 0.95
    assert 0.3 < honest.spread < 1.1
