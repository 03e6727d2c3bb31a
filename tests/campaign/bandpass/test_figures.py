"""What a calibration with bandpass filters is judged by."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.campaign.bandpass import recipe
from dsl_core.campaign.bandpass.recipe import BandpassRecipe, bandpass_figures
from dsl_core.campaign.common.white_shot import FilterNote
from dsl_core.model.calibration.bandpass import BandpassCalibration, FilterSample
from dsl_core.model.plan import ScanLines
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import nominal_filter
from tests.cases.bandpass_record import bandpass_record
from tests.cases.small_rig import small_rig

NM = np.arange(400.0, 701.0, 2.0)
CENTRES_NM = (450.0, 640.0)


def record(between_rel_std: float) -> BandpassCalibration:
    """Two filters: efficiency as good as .1 % at their centres, and less good elsewhere."""
    known = np.abs(np.subtract.outer(NM, CENTRES_NM)).min(1) < 5
    efficiency = SpectralCurve.of(NM, 0.1 + 0 * NM, std=0.1 * np.where(known, 1e-3, between_rel_std))
    response = SpectralCurve.of(NM, 1 + 0 * NM, std=np.full(len(NM), 1e-3))
    filters = [
        FilterSample(
            filter_nm=nm,
            effective_nm=nm,
            found_nm=nm,
            found_std_nm=1.0,
            curve_measured=False,
            zero_dn_per_ms=(1.0, 1.0, 1.0),
            orders=(),
        )
        for nm in CENTRES_NM
    ]
    return bandpass_record(filters, efficiency, (response, response, response))


def test_efficiency_is_judged_between_the_filters_as_well() -> None:
    for between, passes in ((0.019, True), (0.1, False)):
        figures = [each for each in bandpass_figures(record(between)) if "efficiency" in each.name]
        assert [each.passed for each in figures] == [passes, passes]
        assert np.allclose([each.value for each in figures], 100 * between)
    assert "Use more filters, spread from blue to red" in figures[0].advice


@pytest.mark.parametrize("measured", [False, True])
def test_a_width_that_is_stated_after_the_capture_counts(
    monkeypatch: pytest.MonkeyPatch, measured: bool
) -> None:
    curve = nominal_filter(450.0)
    bench: Any = SimpleNamespace(
        kept=lambda *given: FilterNote(filter_nm=450.0, transmission=curve, measured=measured),
        scan_of=lambda step: None,
    )
    scan: Any = SimpleNamespace(pixels=None)
    for name, value in {
        "scan_lines_of": ScanLines(width_px=5, step_px=5),
        "line_frames": (None, None),
        "plane_pixels": None,
        "filter_light": SimpleNamespace(saturated=0.0),
    }.items():
        monkeypatch.setattr(recipe, name, lambda *given, value=value: value)
    step: Any = SimpleNamespace(title="Blue")
    seen = BandpassRecipe(fwhm_nm=20.0)._filter(bench, small_rig(), step, scan)
    assert seen.transmission == (curve if measured else nominal_filter(450.0, 20.0))
    assert seen.measured_curve == measured
