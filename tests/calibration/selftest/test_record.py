"""The points behind the figures of a self-test agree with what is true of the rig."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.selftest.record import analyse, selftest_curves
from dsl_core.campaign.selftest.capture import SelfTestRun
from dsl_core.progress import NoProgress
from tests.cases.light_rig import LightWorld, light_rig


def test_points_agree_with_the_figures() -> None:
    capture = SelfTestRun(light_rig(LightWorld(late_ms=12.0)), NoProgress(), (100.0,)).capture()
    found, curves = analyse(capture), selftest_curves(capture)
    for line, percent in zip(curves.lines, found.camera.linearity_percent, strict=True):
        assert 100 * np.abs(line.residual_dn).max() / curves.full_scale_dn == pytest.approx(percent.value)
    assert [ramp.colour for ramp in curves.ramps] == ["white", "red", "green", "blue"]
    for ramp in curves.ramps:
        assert len(ramp.level) >= 4
        assert ramp.light == pytest.approx(ramp.level**2.2, abs=0.01)
    assert curves.right_share[curves.waits_ms >= found.latency.wait_ms.value].min() == 1
    assert curves.right_share[curves.waits_ms < 12.0].max() < 1
