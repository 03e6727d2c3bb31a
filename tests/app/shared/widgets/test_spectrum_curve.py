"""Curves of spectra."""

from __future__ import annotations

import numpy as np
from dsl_app.shared.widgets.spectrum_curve import split_by_share


def test_curves_are_dashed_where_the_prior_decides() -> None:
    share = np.array([0.1, 0.9, 0.9, 0.9, 0.2])
    solid, dashed = split_by_share(np.arange(5.0), share)
    assert np.isfinite(solid).tolist() == [False, True, True, True, False]
    assert np.isfinite(dashed).tolist() == [True, True, False, True, True]
