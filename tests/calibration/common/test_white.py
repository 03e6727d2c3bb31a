"""What is stated of a target counts first, then what is known of the rig's white."""

from __future__ import annotations

import numpy as np

from dsl_core.calibration.common.white import SPECTRALON, white_target
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.published_rig import published_rig


def test_a_target_is_what_is_stated_else_the_rigs_white_else_a_fresh_spectralon() -> None:
    rig, curve = published_rig(), SpectralCurve.of([400.0, 700.0], [0.8, 0.9])
    known = rig.model_copy(update={"white_reflectance": curve})
    nm = np.arange(430.0, 661.0, 5.0)
    assert white_target(known) == curve
    assert set(white_target(known, 0.5).at(nm)) == {0.5}
    assert rig.white_reflectance is None
    assert set(white_target(rig).at(nm)) == {SPECTRALON}
