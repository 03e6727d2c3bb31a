"""Light of broad filters is spread over more columns, all of which are summed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dsl_core.campaign.bandpass import recipe
from dsl_core.campaign.bandpass.recipe import BandpassRecipe
from dsl_core.campaign.common.white_shot import FilterNote
from dsl_core.model.plan import ScanLines
from dsl_core.optics.filters import nominal_filter
from dsl_core.simulation.published_rig import published_rig


@pytest.mark.parametrize(
    ("measured", "real_nm", "stated_nm", "times"),
    [(False, 10.0, 10.0, 1.0), (False, 10.0, 40.0, 2.0), (True, 40.0, 10.0, 2.0), (True, 10.0, 40.0, 1.0)],
)
def test_windows_are_as_wide_as_the_filter_that_is_there(
    monkeypatch: pytest.MonkeyPatch, measured: bool, real_nm: float, stated_nm: float, times: float
) -> None:
    rig = published_rig()
    note = FilterNote(filter_nm=550.0, transmission=nominal_filter(550.0, real_nm), measured=measured)
    bench: Any = SimpleNamespace(kept=lambda *asked: note, scan_of=lambda step: None)
    scan: Any = SimpleNamespace(pixels=np.arange(4))
    given = list[Any]()

    def light(*parts: Any) -> SimpleNamespace:
        given.extend(parts)
        return SimpleNamespace(saturated=0.0)

    monkeypatch.setattr(recipe, "scan_lines_of", lambda source: ScanLines(width_px=5, step_px=5))
    monkeypatch.setattr(recipe, "line_frames", lambda *asked: (np.zeros((1, 4)), np.ones((1, 4))))
    monkeypatch.setattr(recipe, "plane_pixels", lambda *asked: None)
    monkeypatch.setattr(recipe, "filter_light", light)
    step: Any = SimpleNamespace(title="a filter")
    seen = BandpassRecipe(fwhm_nm=stated_nm)._filter(bench, rig, step, scan)
    assert seen.measured_curve == measured
    assert given[-1] == pytest.approx(times, rel=0.01)
