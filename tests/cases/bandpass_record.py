"""A calibration with bandpass filters whose usual figures stand once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dsl_core.model.calibration.bandpass import BandpassCalibration, FilterSample
from dsl_core.model.spectral import SpectralCurve


def bandpass_record(
    filters: Sequence[FilterSample],
    efficiency: SpectralCurve,
    response: tuple[SpectralCurve, SpectralCurve, SpectralCurve],
    **others: Any,
) -> BandpassCalibration:
    """What filters and curves, alike in both orders, are part of; ``others`` stand for the usual figures."""
    usual = {
        "second_order_share": 0.04,
        "second_order_share_std": 0.01,
        "misfit": {1: 1.0, -1: 1.0},
        "white_scale": 1.0,
        "white_scale_rel_std": 0.01,
        "blur_px": 0.69,
        "blur_std_px": 0.02,
        "halo_peak_per_px": 0.0,
        "halo_peak_std_per_px": 0.0,
        "halo_decay_px": 30.0,
        "halo_decay_std_px": 1.0,
    }
    curves = {"efficiency": {1: efficiency, -1: efficiency}, "response": response}
    return BandpassCalibration.model_validate({"filters": tuple(filters)} | curves | usual | others)
