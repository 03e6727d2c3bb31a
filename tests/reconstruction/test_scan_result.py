"""What a result says of spectra: flags on both sides of their limits, deviations with the calibration."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.result import Flag
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid
from dsl_core.reconstruction.scan_result import _spectral_flags, with_calibration
from dsl_core.reconstruction.spectral.spectral_maps import SpectralMaps
from dsl_core.simulation.published_rig import published_rig

GRID = WavelengthGrid(start_nm=500.0, stop_nm=520.0, step_nm=10.0)


def maps(columns: int) -> SpectralMaps:
    """Three bands of a row of pixels about which all is well."""
    found = SpectralMaps.empty(3, (1, columns))
    found.data_share[:], found.chi_square[:], found.at_bound[:] = 0.9, 1.0, False
    found.reflectance[:], found.std[:] = 0.5, 0.01
    return found


def test_spectra_are_flagged_by_their_weakest_band_their_fit_and_their_bounds() -> None:
    found = maps(7)
    found.data_share[1, 0, 1], found.data_share[2, 0, 2] = 0.49, 0.51
    found.chi_square[0, 3:5] = 2.9, 3.1
    found.at_bound[0, 5] = True
    found.data_share[:, 0, 6] = np.nan
    assert _spectral_flags(found).tolist() == [
        [0, int(Flag.BANDS_UNREACHED), 0, 0, int(Flag.POOR_FIT), int(Flag.AT_BOUND), 0]
    ]


def test_what_the_calibration_leaves_open_is_a_share_of_reflectance() -> None:
    rig = published_rig().model_copy(update={"white_scale_rel_std": 0.03, "chain_rel_std": None})
    assert with_calibration(rig, GRID, maps(1))[:, 0, 0] == pytest.approx([np.hypot(0.01, 0.015)] * 3)
    chain = SpectralCurve.of(np.array([500.0, 520.0]), np.array([0.04, 0.0]))
    both = with_calibration(rig.model_copy(update={"chain_rel_std": chain}), GRID, maps(1))[:, 0, 0]
    shares = np.hypot([0.04, 0.02, 0.0], 0.03)
    assert both == pytest.approx(np.hypot(0.01, 0.5 * shares))
    none = rig.model_copy(update={"white_scale_rel_std": 0.0})
    assert with_calibration(none, GRID, maps(1))[:, 0, 0] == pytest.approx([0.01] * 3)
