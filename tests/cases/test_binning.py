"""Binned rigs see the same field with less noise."""

from __future__ import annotations

import pytest

from tests.cases.binning import binned
from tests.cases.small_rig import small_rig


def test_binning_keeps_the_field_and_lowers_the_noise() -> None:
    rig = small_rig()
    half = binned(rig, 2)
    assert half.camera.width_px == rig.camera.width_px // 2 // 2 * 2
    assert half.camera.fx_px / half.camera.width_px == pytest.approx(
        rig.camera.fx_px / rig.camera.width_px, rel=0.01
    )
    assert half.sensor.electrons_per_dn == 4 * rig.sensor.electrons_per_dn
